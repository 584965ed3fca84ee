// Numbered writes (write_mem): number, byte address (bit 0: all to one address), count, then data.
// Data are passed on only if the number is the next one, so that a line may lose, repeat or reorder
// writes. Only a power cycle clears the number.
module viform_numbered (
    input wire clk,
    input wire power_on,
    input wire write,
    input wire read,
    input wire [7:0] index,
    input wire [31:0] wdata,
    output wire pass,           // this write goes to pass_adr
    output wire [29:0] pass_adr,
    output reg [31:0] rdata
);
    reg [31:0] number, arrived;
    reg open, fixed;
    reg [29:0] address;
    reg [7:0] left;

    wire head = index < 8'd3;
    wire last = left == 8'd1;
    assign pass = write && !head && open && left != 8'd0;
    assign pass_adr = address;

    always @(posedge clk) begin
        if (write && index == 8'd0) begin
            open <= wdata == number;
            arrived <= arrived + 32'd1;
        end
        if (write && index == 8'd1) begin
            address <= wdata[31:2];
            fixed <= wdata[0];
        end
        if (write && index == 8'd2) left <= wdata[7:0];
        if (pass) begin
            if (!fixed) address <= address + 30'd1;
            left <= left - 8'd1;
            if (last) begin
                open <= 1'b0;
                number <= number + 32'd1;
            end
        end
        if (power_on) begin
            number <= 32'd0;
            arrived <= 32'd0;
            open <= 1'b0;
            left <= 8'd0;
        end
        if (read) rdata <= index == 8'd0 ? number : index == 8'd1 ? arrived : 32'd0;
    end
endmodule
