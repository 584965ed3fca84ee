// One data lane of a sensor: word alignment. The lane sends the training word E9 between rows, and
// every row begins with the marker 02. Rotations of the training word differ from each other and
// from the marker in four bits or more, so a wrong bit in the pause is neither alignment nor row.
//
// While the lane searches, a word that is not the training word slips the boundary by a bit, which
// takes effect a clock later; four training words in a row are the alignment. Four wrong words in a
// row, with no row in between, are its loss.
module viform_lane #(
    parameter [31:0] ROW_WORDS = 6 // of a row, after its marker
) (
    input wire clk,
    input wire reset,
    input wire [7:0] bits,   // eight at a clock, the earliest in bit 0, with any boundary
    output reg [7:0] word,
    output reg aligned,
    output wire marker,      // `word` opens a row
    output reg lost          // for a clock
);
    localparam [7:0] TRAINING = 8'hE9, MARKER = 8'h02;

    reg [7:0] earlier;
    reg [2:0] slip;
    reg settles;
    reg [1:0] agreed;  // training words, or wrong words when aligned
    reg [15:0] left;   // words of the row
    wire [15:0] window = {bits, earlier};
    wire trains = word == TRAINING;
    wire pause = left == 16'd0;
    assign marker = aligned && pause && word == MARKER;

    always @(posedge clk) begin
        earlier <= bits;
        word <= window[{1'b0, slip} +: 8];
        settles <= 1'b0;
        lost <= 1'b0;
        if (!aligned) begin
            if (!settles) begin
                agreed <= trains ? agreed + 2'd1 : 2'd0;
                if (!trains) begin
                    slip <= slip + 3'd1;
                    settles <= 1'b1;
                end else if (agreed == 2'd3) begin
                    aligned <= 1'b1;
                    left <= 16'd0;
                end
            end
        end else if (!pause) left <= left - 16'd1;
        else if (marker) begin
            left <= ROW_WORDS[15:0];
            agreed <= 2'd0;
        end else begin
            agreed <= trains ? 2'd0 : agreed + 2'd1;
            if (!trains && agreed == 2'd3) begin
                aligned <= 1'b0;
                lost <= 1'b1;
            end
        end
        if (reset) begin
            slip <= 3'd0;
            settles <= 1'b0;
            agreed <= 2'd0;
            aligned <= 1'b0;
            lost <= 1'b0;
        end
    end
endmodule
