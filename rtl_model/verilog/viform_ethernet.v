// The board behind LiteEth's Etherbone: AXI-Lite instead of a serial line.
module viform_ethernet #(
    parameter [31:0] ROWS = 32,
    parameter [31:0] COLUMNS = 32,
    parameter [31:0] LANES = 32,
    parameter [31:0] CLOCK_HZ = 48000000,
    parameter [31:0] BIT_CLOCKS = 417,
    parameter [31:0] CAPTURE_WORDS = 4096,
    parameter [31:0] SINK_WORDS = 1024,
    parameter [31:0] BUILD = 0
) (
    input wire clk,
    input wire rst,
    input wire [31:0] mmap_awaddr,
    input wire mmap_awvalid,
    output wire mmap_awready,
    input wire [31:0] mmap_wdata,
    input wire [3:0] mmap_wstrb,
    input wire mmap_wvalid,
    output wire mmap_wready,
    output wire [1:0] mmap_bresp,
    output wire mmap_bvalid,
    input wire mmap_bready,
    input wire [31:0] mmap_araddr,
    input wire mmap_arvalid,
    output wire mmap_arready,
    output wire [31:0] mmap_rdata,
    output wire [1:0] mmap_rresp,
    output wire mmap_rvalid,
    input wire mmap_rready,
    output wire sink_valid,
    output wire [15:0] sink_row,
    output wire [15:0] sink_tile,
    output wire [LANES-1:0] sink_bits,
    output wire tile_valid,
    output wire [31:0] tile_clock,
    output wire [31:0] tile_frame,
    output wire [15:0] tile_row,
    output wire [15:0] tile_index,
    output wire [LANES-1:0] tile_bits,
    output wire soft_reset
);
    wire [29:0] bus_adr;
    wire bus_we, bus_re, bus_rvalid, uart_clear;
    wire [31:0] bus_wdata, bus_rdata;
    assign mmap_bresp = 2'd0;
    assign mmap_rresp = 2'd0;
    wire unused = &{1'b0, mmap_wstrb, uart_clear};

    viform_axi_lite axi_lite (
        .clk(clk), .rst(rst), .mmap_awaddr(mmap_awaddr), .mmap_awvalid(mmap_awvalid),
        .mmap_awready(mmap_awready), .mmap_wdata(mmap_wdata), .mmap_wvalid(mmap_wvalid),
        .mmap_wready(mmap_wready), .mmap_bvalid(mmap_bvalid), .mmap_bready(mmap_bready),
        .mmap_araddr(mmap_araddr), .mmap_arvalid(mmap_arvalid), .mmap_arready(mmap_arready),
        .mmap_rdata(mmap_rdata), .mmap_rvalid(mmap_rvalid), .mmap_rready(mmap_rready),
        .bus_adr(bus_adr), .bus_we(bus_we), .bus_re(bus_re), .bus_wdata(bus_wdata),
        .bus_rdata(bus_rdata), .bus_rvalid(bus_rvalid)
    );

    viform_system #(
        .ROWS(ROWS), .COLUMNS(COLUMNS), .LANES(LANES), .CLOCK_HZ(CLOCK_HZ),
        .BIT_CLOCKS(BIT_CLOCKS), .CAPTURE_WORDS(CAPTURE_WORDS), .SINK_WORDS(SINK_WORDS),
        .BUILD(BUILD)
    ) system (
        .clk(clk), .rst(rst), .bus_adr(bus_adr), .bus_we(bus_we), .bus_re(bus_re),
        .bus_wdata(bus_wdata), .bus_rdata(bus_rdata), .bus_rvalid(bus_rvalid),
        .tile_valid(tile_valid), .tile_clock(tile_clock), .tile_frame(tile_frame),
        .tile_row(tile_row), .tile_index(tile_index), .tile_bits(tile_bits),
        .sink_valid(sink_valid), .sink_row(sink_row), .sink_tile(sink_tile),
        .sink_bits(sink_bits), .ev_rx_byte(1'b0), .ev_tx_byte(1'b0), .ev_framing(1'b0),
        .ev_watchdog(1'b0), .ev_unknown(1'b0), .ev_write(bus_we), .ev_write_data(bus_wdata),
        .shortest_low(32'hFFFFFFFF), .uart_clear(uart_clear), .soft_reset(soft_reset)
    );
endmodule
