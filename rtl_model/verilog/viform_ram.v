// A memory of one write and one read port, block RAM in an FPGA. The read is registered. All words
// are 0 at power-on. With COLLIDES = 1 a read sees what stood there before a write of the same
// clock, which costs logic in some families; with 0 such a read's word is never used.
module viform_ram #(
    parameter DEPTH = 256,
    parameter WIDTH = 32,
    parameter ADDRESS_BITS = 8,
    parameter COLLIDES = 0
) (
    input wire clk,
    input wire write,
    input wire [ADDRESS_BITS-1:0] write_address,
    input wire [WIDTH-1:0] write_data,
    input wire read,
    input wire [ADDRESS_BITS-1:0] read_address,
    output reg [WIDTH-1:0] read_data
);
    (* ram_style = "block" *)
    reg [WIDTH-1:0] words[0:DEPTH-1];

    integer i;
    initial for (i = 0; i < DEPTH; i = i + 1) words[i] = {WIDTH{1'b0}};

    always @(posedge clk) begin
        if (read) read_data <= COLLIDES == 0 && write && write_address == read_address
            ? {WIDTH{1'bx}} : words[read_address];
        if (write) words[write_address] <= write_data;
    end
endmodule
