// Tiles of pixels that wait for the event encoder. A row that finds no room is lost as a whole, and
// all rows after it until the queue is half empty; two entries say where this begins and ends.
//
// kind  cycle, row            index                       bits
// 0     of a tile             of the tile                 its spikes, at least one
// 1     first that is lost    bit 0: not of the group     unused
//                             that was placed last
// 2     first of a group, or  bit 0: frames do not        31:0 the frame
//       first that is read    follow one another
//       again
module viform_event_queue #(
    parameter [31:0] LANES = 32,
    parameter [31:0] TILES = 1,
    parameter [31:0] CYCLES = 128, // of a group
    parameter [31:0] DEPTH = 256,
    parameter [31:0] WIDTH = 50 // 18 + LANES
) (
    input wire clk,
    input wire reset,
    input wire tile_valid,
    input wire [31:0] tile_frame,
    input wire [6:0] tile_row,
    input wire [1:0] tile_index,
    input wire [LANES-1:0] tile_bits,
    output wire entry_valid,
    output wire [WIDTH-1:0] entry,
    input wire take,
    output reg [31:0] lost_rows,
    output reg [31:0] lost_spikes
);
    localparam [31:0] GROUP = $clog2(CYCLES);
    localparam [31:0] BITS = $clog2(DEPTH);
    localparam [31:0] ROOM = DEPTH - TILES - 2; // a row, its place, and word of the next loss
    localparam [31:0] HALF = DEPTH / 2;
    localparam [31:0] LAST_CYCLE = CYCLES - 1;

    reg lost, seen, taking, jumped;
    reg [31:0] last_frame;        // of the row before
    reg [6:0] last_row;
    reg [31-GROUP:0] group;       // that was placed last
    wire [BITS:0] level;

    wire first = tile_valid && tile_index == 2'd0;
    wire [31:0] next_frame = last_frame + 32'd1;
    wire follows = tile_frame == next_frame || tile_frame == last_frame && tile_row > last_row;
    wire jump = first && seen && !follows;
    wire room = lost ? level <= HALF[BITS:0] : level <= ROOM[BITS:0] && !jump;
    wire taken = first ? room : taking;
    wire loss = first && !room && !lost;
    // A jump loses what lies between, from the frame that should have come.
    wire [31:0] begin_frame = loss && jump ? next_frame : tile_frame;
    wire [6:0] begin_row = loss && jump ? 7'd0 : tile_row;
    wire [6:0] begin_cycle = begin_frame[6:0] & LAST_CYCLE[6:0];
    wire fresh = begin_frame[31:GROUP] != group;
    wire place = first && room && (lost || fresh);

    // Tiles come a clock later, so that a place may stand before the first one of a row.
    reg tile_due;
    reg [6:0] due_cycle, due_row;
    reg [1:0] due_index;
    reg [LANES-1:0] due_bits;

    wire [WIDTH-1:0] pushed = loss || place
        ? {place ? 2'd2 : 2'd1, begin_cycle, begin_row,
           1'b0, place ? jumped || jump : fresh, {LANES - 32{1'b0}}, begin_frame}
        : {2'd0, due_cycle, due_row, due_index, due_bits};
    wire push = loss || place || tile_due;

    viform_fifo #(.DEPTH(DEPTH), .WIDTH(WIDTH), .INDEX_BITS(BITS)) entries (
        .clk(clk), .reset(reset), .put(push), .put_data(pushed), .out_valid(entry_valid),
        .out_ready(take), .out_data(entry), .level(level)
    );

    function [6:0] ones;
        input [LANES-1:0] bits;
        integer i;
        begin
            ones = 7'd0;
            for (i = 0; i < LANES; i = i + 1) ones = ones + {6'd0, bits[i]};
        end
    endfunction

    always @(posedge clk) begin
        tile_due <= tile_valid && taken && tile_bits != {LANES{1'b0}};
        due_cycle <= tile_frame[6:0] & LAST_CYCLE[6:0];
        due_row <= tile_row;
        due_index <= tile_index;
        due_bits <= tile_bits;
        if (first) begin
            taking <= room;
            seen <= 1'b1;
            last_frame <= tile_frame;
            last_row <= tile_row;
            lost <= !room;
            jumped <= !room && (jumped || jump);
            if (!room) lost_rows <= lost_rows + 32'd1;
        end
        if (place) group <= tile_frame[31:GROUP];
        if (tile_valid && !taken) lost_spikes <= lost_spikes + {25'd0, ones(tile_bits)};
        if (reset) begin
            lost <= 1'b1; // the stream begins as after a loss
            seen <= 1'b0;
            taking <= 1'b0;
            jumped <= 1'b0;
            tile_due <= 1'b0;
            lost_rows <= 32'd0;
            lost_spikes <= 32'd0;
        end
    end
endmodule
