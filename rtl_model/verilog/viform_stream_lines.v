// A sensor chip's data lanes, and its tiles as an AXI4-Stream: what stands in place of
// viform_stream_array when there is a chip.
module viform_stream_lines #(
    parameter [31:0] ROWS = 32,
    parameter [31:0] COLUMNS = 32,
    parameter [31:0] LANES = 32,
    parameter [31:0] DEPTH = 512
) (
    input wire clk,
    input wire rst,
    input wire [LANES-1:0] bits,
    output wire [LANES/8-1:0] aligned,
    output wire [31:0] losses,
    output wire [31:0] bad_rows,
    output wire [31:0] missed_rows,
    output wire m_tvalid,
    input wire m_tready,
    output wire [LANES-1:0] m_tdata,
    output wire m_tlast,
    output wire [1:0] m_tuser,
    output wire [31:0] lost_planes,
    output wire [31:0] lost_rows
);
    localparam [31:0] TILES = (COLUMNS + LANES - 1) / LANES;

    wire tile_valid;
    wire [31:0] tile_frame;
    wire [15:0] tile_row, tile_index;
    wire [LANES-1:0] tile_bits;

    viform_lines #(.ROWS(ROWS), .LANES(LANES), .TILES(TILES)) front_end (
        .clk(clk), .reset(rst), .bits(bits), .aligned(aligned), .losses(losses),
        .bad_rows(bad_rows), .missed_rows(missed_rows), .tile_valid(tile_valid),
        .tile_frame(tile_frame), .tile_row(tile_row), .tile_index(tile_index),
        .tile_bits(tile_bits)
    );

    viform_stream #(.LANES(LANES), .TILES(TILES), .DEPTH(DEPTH)) stream (
        .clk(clk), .reset(rst), .tile_valid(tile_valid), .tile_frame(tile_frame),
        .tile_row(tile_row), .tile_index(tile_index), .tile_bits(tile_bits),
        .m_tvalid(m_tvalid), .m_tready(m_tready), .m_tdata(m_tdata), .m_tlast(m_tlast),
        .m_tuser(m_tuser), .lost_planes(lost_planes), .lost_rows(lost_rows)
    );
endmodule
