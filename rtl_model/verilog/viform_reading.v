// A reading of the charges: a single-slope conversion in 2^n levels by the comparators of the
// pixels. It takes 2^n - 1 scans of the array in place of frames, its passes. In pass j each pixel
// is lent (2^n - j) Q / 2^n electrons, rounded down, and fires where its charge is at least
// j Q / 2^n. So the number of passes in which it fires is its level, floor(2^n charge / Q), at most
// 2^n - 1.
//
// The ramp counts in 1/128 of an electron, a unit in which every step is a whole number.
module viform_reading (
    input wire clk,
    input wire reset,
    input wire start,           // of a scan: a frame, or a pass
    input wire [2:0] request,   // n of the reading that is asked for, 0 for none
    input wire [3:0] threshold, // Q is {threshold, FF}
    output wire pass,           // the next scan, which may begin at this clock, is a pass
    output wire taken,          // the request, at this clock
    // Of the scan in progress.
    output reg reading,
    output reg [6:0] number,    // of the pass, from 1 on
    output reg [3:0] level,     // threshold that the reading began with
    output wire [11:0] lent     // electrons
);
    reg [6:0] left; // passes that have not begun
    reg [18:0] ramp, step;
    wire more = left != 7'd0;
    wire [18:0] quantum = {threshold, 8'hFF, 7'd0};
    wire [18:0] first = quantum >> request;

    assign pass = more || request != 3'd0;
    assign taken = start && !more && request != 3'd0;
    assign lent = ramp[18:7];

    always @(posedge clk) begin
        if (start) begin
            reading <= pass;
            if (more) begin
                left <= left - 7'd1;
                number <= number + 7'd1;
                ramp <= ramp - step;
            end else begin
                left <= taken ? (7'd1 << request) - 7'd2 : 7'd0;
                number <= 7'd1;
                step <= first;
                ramp <= quantum - first;
                level <= threshold;
            end
        end
        if (reset) begin
            left <= 7'd0;
            reading <= 1'b0;
        end
    end
endmodule
