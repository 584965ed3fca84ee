// A queue in block RAM with valid and ready at its end: a word leaves at each clock at which both
// are high. `out_valid` does not wait for `out_ready`, and `out_data` stands until it is taken.
// `level` counts the words in memory, without the one at the end. The writer keeps level < DEPTH.
module viform_fifo #(
    parameter [31:0] DEPTH = 16,
    parameter [31:0] WIDTH = 32,
    parameter [31:0] INDEX_BITS = 4 // DEPTH is 2^INDEX_BITS
) (
    input wire clk,
    input wire reset,
    input wire put,
    input wire [WIDTH-1:0] put_data,
    output reg out_valid,
    input wire out_ready,
    output wire [WIDTH-1:0] out_data,
    output reg [INDEX_BITS:0] level
);
    localparam [INDEX_BITS:0] ONE = {{INDEX_BITS{1'b0}}, 1'b1};
    localparam [INDEX_BITS:0] NONE = {INDEX_BITS + 1{1'b0}};

    reg [INDEX_BITS-1:0] first, next;
    wire get = level != NONE && (!out_valid || out_ready);

    viform_ram #(.DEPTH(DEPTH), .WIDTH(WIDTH), .ADDRESS_BITS(INDEX_BITS)) memory (
        .clk(clk), .write(put), .write_address(next), .write_data(put_data),
        .read(get), .read_address(first), .read_data(out_data)
    );

    always @(posedge clk) begin
        out_valid <= get || out_valid && !out_ready;
        if (put) next <= next + ONE[INDEX_BITS-1:0];
        if (get) first <= first + ONE[INDEX_BITS-1:0];
        level <= level + (put ? ONE : NONE) - (get ? ONE : NONE);
        if (reset) begin
            out_valid <= 1'b0;
            first <= NONE[INDEX_BITS-1:0];
            next <= NONE[INDEX_BITS-1:0];
            level <= NONE;
        end
    end
endmodule
