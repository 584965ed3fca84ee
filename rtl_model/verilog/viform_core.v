// Uartbone and system: the board at byte level.
module viform_core #(
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
    input wire [7:0] rx_data,
    input wire rx_valid,
    output wire [7:0] tx_data,
    output wire tx_valid,
    input wire tx_ready,
    input wire ev_framing,
    input wire [31:0] shortest_low,
    output wire uart_clear,
    output wire tile_valid,
    output wire [31:0] tile_clock,
    output wire [31:0] tile_frame,
    output wire [15:0] tile_row,
    output wire [15:0] tile_index,
    output wire [LANES-1:0] tile_bits,
    output wire sink_valid,
    output wire [15:0] sink_row,
    output wire [15:0] sink_tile,
    output wire [LANES-1:0] sink_bits,
    output wire soft_reset
);
    wire [29:0] bus_adr;
    wire bus_we, bus_re, bus_rvalid;
    wire [31:0] bus_wdata, bus_rdata;
    wire ev_watchdog, ev_unknown;

    viform_uartbone #(.CLOCK_HZ(CLOCK_HZ)) uartbone (
        .clk(clk), .rst(rst), .rx_data(rx_data), .rx_valid(rx_valid), .tx_data(tx_data),
        .tx_valid(tx_valid), .tx_ready(tx_ready), .bus_adr(bus_adr), .bus_we(bus_we),
        .bus_re(bus_re), .bus_wdata(bus_wdata), .bus_rdata(bus_rdata), .bus_rvalid(bus_rvalid),
        .ev_watchdog(ev_watchdog), .ev_unknown(ev_unknown)
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
        .sink_bits(sink_bits), .ev_rx_byte(rx_valid), .ev_tx_byte(tx_valid && tx_ready),
        .ev_framing(ev_framing), .ev_watchdog(ev_watchdog), .ev_unknown(ev_unknown),
        .ev_write(bus_we), .ev_write_data(bus_wdata), .shortest_low(shortest_low),
        .uart_clear(uart_clear), .soft_reset(soft_reset)
    );
endmodule
