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
    input wire fresh,            // at `read`: all charges are taken as 0
    input wire double,           // 20 kHz: a tick collects twice
    input wire [3:0] level,      // of the threshold
    input wire [1:0] rule,
    input wire stored,           // the electrons are those of the pattern memory, or else these:
    input wire rising,           // one more in each lane
    input wire [7:0] even,       // of lane 0, and of all even lanes where they do not rise
    input wire [7:0] odd,
    input wire [3:0] upper,      // 256 electrons each, in all lanes; not with `double`
    input wire hold,             // charges are compared and not changed
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
    wire store = compute && !hold;
    integer i;
    initial for (i = 0; i < DEPTH; i = i + 1) charges[i] = 48'd0;

    // One tick of one pixel: {fired, rest}. What is left after no quantum, one and two stands in
    // three sums side by side, each of which waits for the electrons alone; Q is {k, FF}.
    function [12:0] tick;
        input is_live;
        input is_double;
        input [11:0] held;
        input [3:0] higher;
        input [7:0] collected;
        input [3:0] k;
        input [1:0] reset_rule;
        reg [13:0] more;
        reg [4:0] high;
        reg [12:0] half;
        reg [11:0] none; // no more than 4094 where it is taken
        reg [13:0] once;
        reg [11:0] twice; // no more than 4095, so the bit above is 0 where it is not below 0
        reg below, unused;
        reg fired, keep, first, second, full;
        begin
            more = is_double ? {5'd0, collected, 1'b0} : {2'd0, higher, collected};
            high = {1'b0, held[11:8]} + {1'b1, ~k};
            half = {2'b00, held[11:1]} - {1'b0, k, 8'hFF};
            none = held + more[11:0];
            once = {high[4], high, held[7:0]} - ~more; // held - Q + more
            {below, unused, twice} = {half, held[0]} + more;
            fired = is_live && !once[13];
            keep = is_live && once[13];
            first = fired && reset_rule != 2'd1 && (reset_rule == 2'd2 || below);
            second = is_live && reset_rule != 2'd1 && reset_rule != 2'd2 && !below;
            full = fired && reset_rule == 2'd2 && once[12];
            tick = {
                fired,
                {12{keep}} & none | {12{first}} & once[11:0] | {12{second}} & twice
                    | {12{full}}
            };
        end
    endfunction

    // Electrons of lane `lane` in a 40 kHz tick.
    function [7:0] source;
        input kind;
        input [7:0] read_out;
        input climbs;
        input [7:0] first;
        input [7:0] lane;
        source = {8{kind}} & read_out | (first + ({8{climbs}} & lane));
    endfunction

    always @(posedge clk) begin
        if (read) charge <= fresh ? 48'd0
            : store && read_address == address ? 48'bx : charges[read_address];
        if (compute) begin : update
            reg [12:0] next_0, next_1, next_2, next_3;
            next_0 = tick(
                live[0], double, charge[11:0], upper,
                source(stored, electrons[7:0], rising, even, COLUMN + 8'd0),
                level, rule
            );
            next_1 = tick(
                live[1], double, charge[23:12], upper,
                source(stored, electrons[15:8], rising, odd, COLUMN + 8'd1),
                level, rule
            );
            next_2 = tick(
                live[2], double, charge[35:24], upper,
                source(stored, electrons[23:16], rising, even, COLUMN + 8'd2),
                level, rule
            );
            next_3 = tick(
                live[3], double, charge[47:36], upper,
                source(stored, electrons[31:24], rising, odd, COLUMN + 8'd3),
                level, rule
            );
            if (store)
                charges[address] <= {next_3[11:0], next_2[11:0], next_1[11:0], next_0[11:0]};
            bits <= {next_3[12], next_2[12], next_1[12], next_0[12]};
        end
    end
endmodule
