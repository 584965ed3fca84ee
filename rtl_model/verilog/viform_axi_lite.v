// AXI-Lite to bus: the side of LiteEth's Etherbone (`mmap`). One access at a time; a write is taken
// when address and data are both there. The bus has words only, so strobes are not looked at.
module viform_axi_lite (
    input wire clk,
    input wire rst,
    input wire [31:0] mmap_awaddr,
    input wire mmap_awvalid,
    output wire mmap_awready,
    input wire [31:0] mmap_wdata,
    input wire mmap_wvalid,
    output wire mmap_wready,
    output reg mmap_bvalid,
    input wire mmap_bready,
    input wire [31:0] mmap_araddr,
    input wire mmap_arvalid,
    output wire mmap_arready,
    output reg [31:0] mmap_rdata,
    output reg mmap_rvalid,
    input wire mmap_rready,
    output reg [29:0] bus_adr,
    output reg bus_we,
    output reg bus_re,
    output reg [31:0] bus_wdata,
    input wire [31:0] bus_rdata,
    input wire bus_rvalid
);
    reg reading;
    wire idle = !bus_we && !mmap_bvalid && !reading && !mmap_rvalid && !rst;
    wire take_write = idle && mmap_awvalid && mmap_wvalid;
    wire take_read = idle && mmap_arvalid && !take_write;
    assign mmap_awready = take_write;
    assign mmap_wready = take_write;
    assign mmap_arready = take_read;
    wire unused = &{1'b0, mmap_awaddr[1:0], mmap_araddr[1:0]};

    always @(posedge clk) begin
        bus_we <= take_write;
        bus_re <= take_read;
        if (take_write) begin
            bus_adr <= mmap_awaddr[31:2];
            bus_wdata <= mmap_wdata;
        end
        if (take_read) begin
            bus_adr <= mmap_araddr[31:2];
            reading <= 1'b1;
        end
        if (bus_we) mmap_bvalid <= 1'b1;
        else if (mmap_bready) mmap_bvalid <= 1'b0;
        if (bus_rvalid) begin
            mmap_rdata <= bus_rdata;
            mmap_rvalid <= 1'b1;
            reading <= 1'b0;
        end else if (mmap_rready) mmap_rvalid <= 1'b0;
        if (rst) begin
            reading <= 1'b0;
            bus_we <= 1'b0;
            bus_re <= 1'b0;
            mmap_bvalid <= 1'b0;
            mmap_rvalid <= 1'b0;
        end
    end
endmodule
