// Tiles from a file into the encoder, its packets into the decoder. Prints the words between them
// (e) and those that come out (d); `done` says that the end was reached.
`timescale 1ns / 1ns
module bench;
    parameter TILES = 1;
    parameter CLOCKS = 1;
    reg [127:0] tiles[0:TILES-1]; // clock, frame, row and index, bits
    reg clk = 0, reset = 1, ready = 0;
    wire [31:0] lost_rows, lost_spikes, tdata, first, tile, packets, damaged;
    wire [15:0] half;
    wire [13:0] gap_place;
    wire half_valid, half_ready, half_last, tvalid, tlast, tuser, gap_valid;
    integer clock = 0, next = 0;
    wire due = !reset && next < TILES && tiles[next < TILES ? next : 0][127:96] == clock;
    wire [127:0] now = tiles[next < TILES ? next : 0];

    viform_event_encoder #(
        .ROWS(4), .COLUMNS(40), .LANES(32), .CYCLES(32), .DEPTH(64), .TILE(9)
    ) encoder (
        .clk(clk), .reset(reset), .tile_valid(due), .tile_frame(now[95:64]),
        .tile_row(now[63:48]), .tile_index(now[47:32]), .tile_bits(now[31:0]),
        .m_tvalid(half_valid), .m_tready(half_ready), .m_tdata(half), .m_tlast(half_last),
        .lost_rows(lost_rows), .lost_spikes(lost_spikes)
    );
    viform_event_decoder #(.ROWS(4), .COLUMNS(40), .CYCLES(32)) decoder (
        .clk(clk), .reset(reset), .s_tvalid(half_valid), .s_tready(half_ready), .s_tdata(half),
        .s_tlast(half_last), .m_tvalid(tvalid), .m_tready(ready), .m_tdata(tdata),
        .m_tlast(tlast), .m_tuser(tuser), .m_first(first), .m_tile(tile),
        .gap_valid(gap_valid), .gap_place(gap_place), .packets(packets), .damaged(damaged)
    );

    always #5 clk = !clk;
    always @(posedge clk) if (!reset) begin
        if (half_valid && half_ready) $display("e %04x %b", half, half_last);
        if (tvalid && ready) $display("d %08x %b %b %0d %0d", tdata, tlast, tuser, first, tile);
        if (gap_valid) $display("g %0d", gap_place);
        if (due) next <= next + 1;
        clock <= clock + 1;
        ready <= $random;
        if (clock == CLOCKS) begin
            $display("done %0d %0d %0d %0d", packets, damaged, lost_rows, lost_spikes);
            $finish;
        end
    end
    initial begin
        $readmemh("tiles.hex", tiles);
        #42 reset = 0;
    end
endmodule
