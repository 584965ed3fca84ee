// One tick of one pixel: Q is {level, FF}. The plain form of the arithmetic in viform_pixels, which
// is written for few levels of logic.
module viform_tick (
    input wire live,          // inside the window; others are held in reset
    input wire double,        // 20 kHz: a tick collects twice
    input wire [3:0] level,
    input wire [1:0] rule,
    input wire [11:0] held,
    input wire [7:0] electrons,
    output wire fired,
    output wire [11:0] rest
);
    wire [13:0] q = {2'b00, level, 8'hFF};
    wire [13:0] more = double ? {5'd0, electrons, 1'b0} : {6'd0, electrons};
    wire [13:0] total = {2'b00, held} + more;
    wire twice = total >= {q[12:0], 1'b0};
    assign fired = live && total >= q;

    // What is left: nothing, the total less one quantum, or less as many as it holds, up to two.
    wire [13:0] less = !fired ? 14'd0
        : rule == 2'd1 ? total
        : rule != 2'd2 && twice ? {q[12:0], 1'b0}
        : q;
    wire [13:0] left = total - less;
    assign rest = !live ? 12'd0 : left > 14'd4095 ? 12'hFFF : left[11:0];
endmodule
