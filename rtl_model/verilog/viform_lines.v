// A sensor's data lanes to tiles: the place of a chip where the emulated pixels stand. Lane n
// carries columns 8 n to 8 n + 7 of each tile, the first in its earliest bit.
//
// A row on each lane: marker, row modulo 256, {plane modulo 16, row / 256}, plane / 16, a word for
// each tile, and the CRC-8 (x^8 + x^2 + x + 1, from FF) of the words between marker and CRC. Lanes
// may differ by up to three clocks; the markers tell by how many. A row waits in a buffer until its
// CRCs are right; rows with an error, and rows that lack a lane, are dropped and counted.
module viform_lines #(
    parameter [31:0] ROWS = 32,
    parameter [31:0] LANES = 32, // pixels of a tile
    parameter [31:0] TILES = 1
) (
    input wire clk,
    input wire reset,
    input wire [LANES-1:0] bits, // lane n in bits 8 n + 7 to 8 n
    output wire [LANES/8-1:0] aligned,
    output reg [31:0] losses,    // of alignment, over all lanes
    output reg [31:0] bad_rows,
    output reg [31:0] missed_rows,
    output reg tile_valid,
    output reg [31:0] tile_frame,
    output reg [15:0] tile_row,
    output reg [15:0] tile_index,
    output wire [LANES-1:0] tile_bits
);
    localparam [31:0] WIRES = LANES / 8;
    localparam [31:0] ROW_WORDS = TILES + 4; // after the marker
    localparam [31:0] LAST_WORD = TILES + 3;
    localparam [31:0] LAST_TILE = TILES - 1;
    localparam [31:0] TILE_BITS = TILES > 1 ? $clog2(TILES) : 1;

    function [7:0] crc8;
        input [7:0] crc;
        input [7:0] word;
        integer i;
        begin
            crc8 = crc ^ word;
            for (i = 0; i < 8; i = i + 1)
                crc8 = {crc8[6:0], 1'b0} ^ (crc8[7] ? 8'h07 : 8'h00);
        end
    endfunction

    function [3:0] ones;
        input [WIRES-1:0] flags;
        integer i;
        begin
            ones = 4'd0;
            for (i = 0; i < WIRES; i = i + 1) ones = ones + {3'd0, flags[i]};
        end
    endfunction

    // `now` is the word of each lane, delayed until it meets those of the latest lane.
    reg in_row;
    reg [15:0] count; // words of the row after its marker
    wire checks = in_row && count == LAST_WORD[15:0];
    wire [WIRES-1:0] here, overdue, wrong, lost;
    wire begins = !in_row && &here;
    wire expired = !in_row && |overdue;
    wire [8*WIRES-1:0] now;

    genvar n;
    generate
        for (n = 0; n < WIRES; n = n + 1) begin : lanes
            wire [7:0] word;
            wire marker;
            reg [23:0] earlier; // the word before in the lowest eight bits
            reg [2:0] age;      // clocks since the marker; 0: none waits
            reg [1:0] delay;
            reg [7:0] crc;
            viform_lane #(.ROW_WORDS(ROW_WORDS)) lane (
                .clk(clk), .reset(reset), .bits(bits[8*n +: 8]), .word(word),
                .aligned(aligned[n]), .marker(marker), .lost(lost[n])
            );
            assign here[n] = marker || age != 3'd0 && age != 3'd4;
            assign overdue[n] = age == 3'd4;
            wire [31:0] latest = {earlier, word};
            assign now[8*n +: 8] = latest[{delay, 3'd0} +: 8];
            assign wrong[n] = checks ? now[8*n +: 8] != crc : now[8*n +: 8] != now[7:0];
            always @(posedge clk) begin
                earlier <= {earlier[15:0], word};
                age <= marker ? 3'd1 : age == 3'd0 || age == 3'd4 ? 3'd0 : age + 3'd1;
                if (begins) begin
                    delay <= marker ? 2'd0 : age[1:0];
                    age <= 3'd0;
                    crc <= 8'hFF;
                end else if (in_row) crc <= crc8(crc, now[8*n +: 8]);
                if (expired && !marker || reset) age <= 3'd0;
            end
        end
    endgenerate

    // The row that arrives stands in one half of the buffer, the row that leaves in the other.
    reg bad, half;
    reg [15:0] row;
    reg [11:0] plane;
    wire [7:0] first = now[7:0];
    wire in_head = count < 16'd3;
    wire fails = bad || |wrong || row >= ROWS[15:0];
    wire keep = in_row && !in_head && !checks;
    reg [TILE_BITS-1:0] place;
    reg leaving;
    reg [15:0] out;
    viform_ram #(
        .DEPTH(2 << TILE_BITS), .WIDTH(LANES), .ADDRESS_BITS(TILE_BITS + 1)
    ) rows_buffer (
        .clk(clk), .write(keep), .write_address({half, place}), .write_data(now),
        .read(leaving), .read_address({!half, out[TILE_BITS-1:0]}), .read_data(tile_bits)
    );

    wire [11:0] passed = plane - tile_frame[11:0];
    always @(posedge clk) begin
        losses <= losses + {28'd0, ones(lost)};
        if (expired) missed_rows <= missed_rows + 32'd1;
        if (begins) begin
            in_row <= 1'b1;
            count <= 16'd0;
            bad <= 1'b0;
            place <= {TILE_BITS{1'b0}};
        end else if (in_row) begin
            count <= count + 16'd1;
            if (in_head && |wrong) bad <= 1'b1; // lanes of one row have one head
            if (count == 16'd0) row[7:0] <= first;
            if (count == 16'd1) {plane[3:0], row[15:8]} <= {first[7:4], 4'd0, first[3:0]};
            if (count == 16'd2) plane[11:4] <= first;
            if (keep) place <= place + 1'b1;
            if (checks) in_row <= 1'b0;
        end

        if (checks) begin
            if (fails) bad_rows <= bad_rows + 32'd1;
            else begin
                leaving <= 1'b1;
                out <= 16'd0;
                half <= !half;
                tile_frame <= tile_frame + {20'd0, passed};
                tile_row <= row;
            end
        end
        if (leaving) begin
            out <= out + 16'd1;
            if (out == LAST_TILE[15:0]) leaving <= 1'b0;
        end
        tile_valid <= leaving;
        tile_index <= out;

        if (reset) begin
            in_row <= 1'b0;
            losses <= 32'd0;
            bad_rows <= 32'd0;
            missed_rows <= 32'd0;
            leaving <= 1'b0;
            half <= 1'b0;
            tile_valid <= 1'b0;
            tile_frame <= 32'd0;
        end
    end
endmodule
