// A generated top at its own clock and baud, in real time: a host that has nothing but the serial
// line reads `WORDS words from address 0. Prints the bytes, and what the LED did meanwhile.
`timescale 1ps / 1ps
module line;
    reg clk_in = 0, serial_rx = 1;
    wire serial_tx, led;
    viform_top top (.clk_in(clk_in), .serial_rx(serial_rx), .serial_tx(serial_tx), .led(led));
    always #(`HALF_PS) clk_in = !clk_in;

    task send;
        input [7:0] value;
        integer i;
        begin
            serial_rx = 0;
            #(`BIT_PS);
            for (i = 0; i < 8; i = i + 1) begin
                serial_rx = value[i];
                #(`BIT_PS);
            end
            serial_rx = 1;
            #(`BIT_PS);
        end
    endtask

    reg [7:0] seen;
    integer k, bytes;
    initial bytes = 0;
    always begin
        @(negedge serial_tx);
        #(`BIT_PS / 2);
        for (k = 0; k < 8; k = k + 1) begin
            #(`BIT_PS);
            seen[k] = serial_tx;
        end
        #(`BIT_PS);
        if (!serial_tx) $display("framing");
        $display("byte %h", seen);
        bytes = bytes + 1;
    end

    initial begin
        #(`HALF_PS * 2 * 1200); // no reset from outside: the top's own must have ended
        if (serial_tx !== 1'b1) $display("line not idle");
        if (top.rst !== 1'b0) $display("still in reset");
        send(8'd2);
        send(`WORDS);
        send(8'd0);
        send(8'd0);
        send(8'd0);
        send(8'd0);
        #(`BIT_PS * 10 * (4 * `WORDS + 3));
        if (top.held == 0) $display("the LED heard nothing");
        $display("done %0d", bytes);
        $finish;
    end
endmodule
