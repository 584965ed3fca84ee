// PRBS source and checker: Fibonacci registers of order 7, 15, 23 or 31 that start as all ones and
// take the xor of two taps in at bit 0. 32 bits make a word, the first in bit 31; since a word is
// longer than any of the registers, the low bits of the last word are the register.
`include "viform_registers.vh"
module viform_prbs (
    input wire clk,
    input wire reset,
    input wire write,
    input wire read,
    input wire [5:0] offset,
    input wire [31:0] wdata,
    output reg [31:0] rdata
);
    reg [4:0] order;
    reg [30:0] source_state, check_state;
    reg [31:0] checked, errors;

    // The word after the one whose low bits are `state`; an unknown order is taken as 31.
    function [31:0] following;
        input [4:0] degree;
        input [30:0] state;
        reg [62:0] bits; // oldest at the top
        integer i;
        begin
            bits = {state, 32'd0};
            for (i = 31; i >= 0; i = i - 1)
                case (degree)
                    5'd7: bits[i] = bits[i+6] ^ bits[i+7];
                    5'd15: bits[i] = bits[i+14] ^ bits[i+15];
                    5'd23: bits[i] = bits[i+18] ^ bits[i+23];
                    default: bits[i] = bits[i+28] ^ bits[i+31];
                endcase
            following = bits[31:0];
        end
    endfunction

    function [5:0] ones;
        input [31:0] bits;
        integer i;
        begin
            ones = 6'd0;
            for (i = 0; i < 32; i = i + 1) ones = ones + {5'd0, bits[i]};
        end
    endfunction

    wire restart = write && offset == `VIFORM_PRBS_ORDER;
    always @(posedge clk) begin
        if (write && offset == `VIFORM_PRBS_CHECK) begin : hold_against
            reg [31:0] expected;
            expected = following(order, check_state);
            check_state <= expected[30:0];
            checked <= checked + 32'd1;
            errors <= errors + {26'd0, ones(expected ^ wdata)};
        end
        if (read) case (offset)
            `VIFORM_PRBS_ORDER: rdata <= {27'd0, order};
            `VIFORM_PRBS_SOURCE: begin : take
                reg [31:0] word;
                word = following(order, source_state);
                source_state <= word[30:0];
                rdata <= word;
            end
            `VIFORM_PRBS_CHECKED: rdata <= checked;
            `VIFORM_PRBS_ERRORS: rdata <= errors;
            default: rdata <= 32'd0;
        endcase
        if (restart || reset) begin
            order <= reset ? `VIFORM_PRBS_ORDER_RESET : wdata[4:0];
            source_state <= 31'h7FFFFFFF;
            check_state <= 31'h7FFFFFFF;
            checked <= 32'd0;
            errors <= 32'd0;
        end
    end
endmodule
