// The board: a serial line, and the display's pins.
module viform_board #(
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
    input wire serial_rx,
    output wire serial_tx,
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
    wire [7:0] rx_data, tx_data;
    wire rx_valid, tx_valid, tx_ready, ev_framing, uart_clear;
    wire [31:0] shortest_low;

    viform_uart #(.BIT_CLOCKS(BIT_CLOCKS)) uart (
        .clk(clk), .rst(rst), .serial_rx(serial_rx), .serial_tx(serial_tx), .rx_data(rx_data),
        .rx_valid(rx_valid), .ev_framing(ev_framing), .tx_data(tx_data), .tx_valid(tx_valid),
        .tx_ready(tx_ready), .clear(uart_clear), .shortest_low(shortest_low)
    );

    viform_core #(
        .ROWS(ROWS), .COLUMNS(COLUMNS), .LANES(LANES), .CLOCK_HZ(CLOCK_HZ),
        .BIT_CLOCKS(BIT_CLOCKS), .CAPTURE_WORDS(CAPTURE_WORDS), .SINK_WORDS(SINK_WORDS),
        .BUILD(BUILD)
    ) core (
        .clk(clk), .rst(rst), .rx_data(rx_data), .rx_valid(rx_valid), .tx_data(tx_data),
        .tx_valid(tx_valid), .tx_ready(tx_ready), .ev_framing(ev_framing),
        .shortest_low(shortest_low), .uart_clear(uart_clear), .tile_valid(tile_valid),
        .tile_clock(tile_clock), .tile_frame(tile_frame), .tile_row(tile_row),
        .tile_index(tile_index), .tile_bits(tile_bits), .sink_valid(sink_valid),
        .sink_row(sink_row), .sink_tile(sink_tile), .sink_bits(sink_bits),
        .soft_reset(soft_reset)
    );
endmodule
