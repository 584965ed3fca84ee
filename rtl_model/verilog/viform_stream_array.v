// The board without its serial line, and the tiles of its pixels as an AXI4-Stream.
module viform_stream_array #(
    parameter [31:0] ROWS = 32,
    parameter [31:0] COLUMNS = 32,
    parameter [31:0] LANES = 32,
    parameter [31:0] CLOCK_HZ = 48000000,
    parameter [31:0] BIT_CLOCKS = 417,
    parameter [31:0] CAPTURE_WORDS = 4096,
    parameter [31:0] SINK_WORDS = 1024,
    parameter [31:0] DEPTH = 512,
    parameter [31:0] BUILD = 0
) (
    input wire clk,
    input wire rst,
    input wire [29:0] bus_adr,
    input wire bus_we,
    input wire bus_re,
    input wire [31:0] bus_wdata,
    output wire [31:0] bus_rdata,
    output wire bus_rvalid,
    output wire m_tvalid,
    input wire m_tready,
    output wire [LANES-1:0] m_tdata,
    output wire m_tlast,
    output wire [1:0] m_tuser,
    output wire [31:0] lost_planes,
    output wire [31:0] lost_rows
);
    localparam [31:0] TILES = (COLUMNS + LANES - 1) / LANES;

    wire tile_valid, soft_reset;
    wire [31:0] tile_frame;
    wire [15:0] tile_row, tile_index;
    wire [LANES-1:0] tile_bits;

    // What the display shows, and the clock of a tile, have no place in the stream.
    wire sink_valid, uart_clear;
    wire [31:0] tile_clock;
    wire [15:0] sink_row, sink_tile;
    wire [LANES-1:0] sink_bits;
    wire unused = &{
        1'b0, sink_valid, uart_clear, tile_clock, sink_row, sink_tile, sink_bits
    };

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
        .ev_watchdog(1'b0), .ev_unknown(1'b0), .ev_write(1'b0), .ev_write_data(32'd0),
        .shortest_low(32'hFFFFFFFF), .uart_clear(uart_clear), .soft_reset(soft_reset)
    );

    viform_stream #(.LANES(LANES), .TILES(TILES), .DEPTH(DEPTH)) stream (
        .clk(clk), .reset(rst || soft_reset), .tile_valid(tile_valid), .tile_frame(tile_frame),
        .tile_row(tile_row), .tile_index(tile_index), .tile_bits(tile_bits),
        .m_tvalid(m_tvalid), .m_tready(m_tready), .m_tdata(m_tdata), .m_tlast(m_tlast),
        .m_tuser(m_tuser), .lost_planes(lost_planes), .lost_rows(lost_rows)
    );
endmodule
