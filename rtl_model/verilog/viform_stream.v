// Tiles to an AXI4-Stream: a ring buffer between a source that cannot wait and a reader that may.
//
// A packet is a row: a head {plane modulo 2^20, row}, then the row's tiles, the last with m_tlast.
// m_tuser[0] marks the head of a plane's first row; m_tuser[1], at such a head, that the plane
// before it in the stream lacks rows. A row that does not fit is lost with all that follow in its
// plane, so packets are whole, and planes without any row are known by their missing numbers.
//
// The source keeps a clock free between the tiles of two rows; tiles of a row may be further apart.
module viform_stream #(
    parameter [31:0] LANES = 32,
    parameter [31:0] TILES = 1,
    parameter [31:0] DEPTH = 512 // beats, a power of two
) (
    input wire clk,
    input wire reset,
    input wire tile_valid,
    input wire [31:0] tile_frame,
    input wire [15:0] tile_row,
    input wire [15:0] tile_index,
    input wire [LANES-1:0] tile_bits,
    output wire m_tvalid,
    input wire m_tready,
    output wire [LANES-1:0] m_tdata,
    output wire m_tlast,
    output wire [1:0] m_tuser,
    output reg [31:0] lost_planes, // with at least one row that is lost
    output reg [31:0] lost_rows
);
    localparam [31:0] INDEX_BITS = $clog2(DEPTH);
    localparam [31:0] FULLEST = DEPTH - TILES - 1; // level at which a packet still fits
    localparam [31:0] LAST_TILE = TILES - 1;

    generate
        if (DEPTH < TILES + 1 || DEPTH < 2 || (DEPTH & (DEPTH - 1)) != 0) begin : refuse_depth
            DEPTH_must_be_a_power_of_two_that_holds_a_row refused ();
        end
    endgenerate

    reg seen, taking, cut, marked;
    reg [31:0] frame;
    reg [15:0] row;
    wire [INDEX_BITS:0] level;

    wire head = tile_valid && tile_index == 16'd0;
    wire opens = !seen || tile_frame != frame || tile_row <= row; // a plane
    wire room = level <= FULLEST[INDEX_BITS:0];
    wire take = room && (opens || !cut);

    // The head takes the place of the first tile, and each tile follows a clock late.
    reg held;
    reg held_last;
    reg [LANES-1:0] held_bits;
    wire [31:0] name = {tile_frame[19:0], tile_row[11:0]};
    wire [LANES-1:0] name_beat;
    assign name_beat[31:0] = name;
    generate
        if (LANES > 32) begin : wide
            assign name_beat[LANES-1:32] = {LANES - 32{1'b0}};
        end
    endgenerate

    viform_fifo #(
        .DEPTH(DEPTH), .WIDTH(LANES + 3), .INDEX_BITS(INDEX_BITS)
    ) ring (
        .clk(clk), .reset(reset), .put(head && take || held),
        .put_data(
            held ? {2'b00, held_last, held_bits} : {marked && opens, opens, 1'b0, name_beat}
        ),
        .out_valid(m_tvalid), .out_ready(m_tready), .out_data({m_tuser, m_tlast, m_tdata}),
        .level(level)
    );

    always @(posedge clk) begin
        held <= tile_valid && (head ? take : taking);
        held_last <= tile_index == LAST_TILE[15:0];
        held_bits <= tile_bits;
        if (head) begin
            seen <= 1'b1;
            frame <= tile_frame;
            row <= tile_row;
            taking <= take;
            cut <= !take;
            if (take) begin
                if (opens) marked <= 1'b0;
            end else begin
                lost_rows <= lost_rows + 32'd1;
                if (opens || !cut) lost_planes <= lost_planes + 32'd1;
                if (!opens && !cut) marked <= 1'b1;
            end
        end
        if (reset) begin
            seen <= 1'b0;
            taking <= 1'b0;
            cut <= 1'b0;
            marked <= 1'b0;
            held <= 1'b0;
            lost_planes <= 32'd0;
            lost_rows <= 32'd0;
        end
    end
endmodule
