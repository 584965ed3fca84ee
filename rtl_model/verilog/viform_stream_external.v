// A large pixel array with its state in an external memory, and its tiles as an AXI4-Stream.
module viform_stream_external #(
    parameter [31:0] ROWS = 128,
    parameter [31:0] COLUMNS = 128,
    parameter [31:0] LANES = 32,
    parameter [31:0] PIXELS = 4,
    parameter [31:0] IN_FLIGHT = 16,
    parameter [31:0] DEPTH = 512,
    // Derived.
    parameter [31:0] TILES = (COLUMNS + LANES - 1) / LANES,
    parameter [31:0] WORDS = ROWS * TILES * LANES / PIXELS,
    parameter [31:0] ADDRESS_BITS = $clog2(WORDS)
) (
    input wire clk,
    input wire rst,
    input wire run,
    input wire clear,
    input wire [3:0] threshold,
    input wire clock_select,
    input wire [1:0] reset_rule,
    input wire [31:0] rows,
    input wire [31:0] columns,
    input wire [31:0] tick_clocks,
    input wire [1:0] pattern,
    input wire [7:0] level,
    output wire [31:0] frames,
    output wire [31:0] late,
    output wire mem_valid,
    input wire mem_ready,
    output wire mem_write,
    output wire [ADDRESS_BITS-1:0] mem_address,
    output wire [20*PIXELS-1:0] mem_wdata,
    input wire mem_rvalid,
    input wire [20*PIXELS-1:0] mem_rdata,
    output wire m_tvalid,
    input wire m_tready,
    output wire [LANES-1:0] m_tdata,
    output wire m_tlast,
    output wire [1:0] m_tuser,
    output wire [31:0] lost_planes,
    output wire [31:0] lost_rows
);
    wire tile_valid;
    wire [31:0] tile_frame;
    wire [15:0] tile_row, tile_index;
    wire [LANES-1:0] tile_bits;

    viform_external #(
        .ROWS(ROWS), .COLUMNS(COLUMNS), .LANES(LANES), .TILES(TILES), .PIXELS(PIXELS),
        .IN_FLIGHT(IN_FLIGHT), .ADDRESS_BITS(ADDRESS_BITS)
    ) array (
        .clk(clk), .reset(rst), .run(run), .clear(clear), .threshold(threshold),
        .clock_select(clock_select), .reset_rule(reset_rule), .rows(rows), .columns(columns),
        .tick_clocks(tick_clocks), .pattern(pattern), .level(level), .frames(frames),
        .late(late), .mem_valid(mem_valid), .mem_ready(mem_ready), .mem_write(mem_write),
        .mem_address(mem_address), .mem_wdata(mem_wdata), .mem_rvalid(mem_rvalid),
        .mem_rdata(mem_rdata), .tile_valid(tile_valid), .tile_frame(tile_frame),
        .tile_row(tile_row), .tile_index(tile_index), .tile_bits(tile_bits)
    );

    viform_stream #(.LANES(LANES), .TILES(TILES), .DEPTH(DEPTH)) stream (
        .clk(clk), .reset(rst), .tile_valid(tile_valid), .tile_frame(tile_frame),
        .tile_row(tile_row), .tile_index(tile_index), .tile_bits(tile_bits),
        .m_tvalid(m_tvalid), .m_tready(m_tready), .m_tdata(m_tdata), .m_tlast(m_tlast),
        .m_tuser(m_tuser), .lost_planes(lost_planes), .lost_rows(lost_rows)
    );
endmodule
