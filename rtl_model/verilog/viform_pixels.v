// Four pixels of each tile: their electrons a tick (a 32-bit word of the pattern memory), their
// charges, and the arithmetic of a tick. `read` fetches both; a clock later `compute` updates them.
module viform_pixels #(
    parameter [31:0] DEPTH = 32,
    parameter [31:0] ADDRESS_BITS = 5,
    parameter [31:0] FIRST_LANE = 0
) (
    input wire clk,
    input wire pattern_write,
    input wire [ADDRESS_BITS-1:0] pattern_address,
    input wire [31:0] pattern_data,
    input wire read,
    input wire [ADDRESS_BITS-1:0] read_address,
    input wire compute,
    input wire [ADDRESS_BITS-1:0] address,
    input wire [3:0] live,       // inside the window; the others are held in reset
    input wire fresh,            // all charges are taken as 0
    input wire double,           // 20 kHz: a tick collects twice
    input wire [3:0] level,      // of the threshold
    input wire [1:0] rule,
    input wire [1:0] pattern,
    input wire [7:0] constant,
    input wire [7:0] ramp,       // of lane 0
    input wire odd,              // row ^ frame, least significant bit
    output reg [3:0] bits
);
    localparam [7:0] COLUMN = FIRST_LANE[7:0];
    wire [31:0] electrons;

    viform_ram #(
        .DEPTH(DEPTH), .WIDTH(32), .ADDRESS_BITS(ADDRESS_BITS), .COLLIDES(1)
    ) pattern_memory (
        .clk(clk), .write(pattern_write), .write_address(pattern_address),
        .write_data(pattern_data), .read(read), .read_address(read_address),
        .read_data(electrons)
    );
    // A memory of its own and not a viform_ram: the arithmetic stands where it is stored, so that a
    // simulator does it for tiles only. Read and write never meet at one address.
    (* ram_style = "block" *)
    reg [47:0] charges[0:DEPTH-1];
    reg [47:0] charge;
    integer i;
    initial for (i = 0; i < DEPTH; i = i + 1) charges[i] = 48'd0;

    // One tick of one pixel: {fired, rest}.
    function [12:0] tick;
        input is_live;
        input is_fresh;
        input is_double;
        input [11:0] held;
        input [7:0] collected;
        input [3:0] k;
        input [1:0] reset_rule;
        reg [12:0] sum;
        reg [13:0] once;
        reg [13:0] twice;
        reg [12:0] left;
        begin
            sum = (is_fresh ? 13'd0 : {1'b0, held})
                + (is_double ? {4'd0, collected, 1'b0} : {5'd0, collected});
            once = {1'b0, sum} - {2'b00, k, 8'hFF};
            twice = {1'b0, sum} - {1'b0, k, 8'hFF, 1'b0};
            left = reset_rule == 2'd2 || twice[13] ? once[12:0] : twice[12:0];
            if (!is_live) tick = 13'd0;
            else if (once[13]) tick = {1'b0, sum[11:0]};
            else if (reset_rule == 2'd1) tick = {1'b1, 12'd0};
            else tick = {1'b1, left[12] ? 12'hFFF : left[11:0]};
        end
    endfunction

    // Electrons of lane `lane` in a 40 kHz tick.
    function [7:0] source;
        input [1:0] kind;
        input [7:0] stored;
        input [7:0] same;
        input [7:0] rising;
        input bright;
        case (kind)
            2'd0: source = stored;
            2'd1: source = same;
            2'd2: source = rising;
            default: source = bright ? same : 8'd0;
        endcase
    endfunction

    always @(posedge clk) begin
        if (read) charge <= compute && read_address == address ? 48'bx : charges[read_address];
        if (compute) begin : update
            reg [12:0] next_0, next_1, next_2, next_3;
            next_0 = tick(
                live[0], fresh, double, charge[11:0],
                source(pattern, electrons[7:0], constant, ramp + COLUMN + 8'd0, odd),
                level, rule
            );
            next_1 = tick(
                live[1], fresh, double, charge[23:12],
                source(pattern, electrons[15:8], constant, ramp + COLUMN + 8'd1, !odd),
                level, rule
            );
            next_2 = tick(
                live[2], fresh, double, charge[35:24],
                source(pattern, electrons[23:16], constant, ramp + COLUMN + 8'd2, odd),
                level, rule
            );
            next_3 = tick(
                live[3], fresh, double, charge[47:36],
                source(pattern, electrons[31:24], constant, ramp + COLUMN + 8'd3, !odd),
                level, rule
            );
            charges[address] <= {next_3[11:0], next_2[11:0], next_1[11:0], next_0[11:0]};
            bits <= {next_3[12], next_2[12], next_1[12], next_0[12]};
        end
    end
endmodule
