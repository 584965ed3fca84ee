// The board over its pins: magic and scratch, then a row of pixels. Prints what came, and what the
// test holds it against; `done` says that the end was reached.
`timescale 1ns / 1ns
module testbench;
    localparam BIT_CLOCKS = 8;
    reg clk = 0, rst = 1, serial_rx = 1;
    wire serial_tx, sink_valid, tile_valid, soft_reset;
    wire [15:0] sink_row, sink_tile, tile_row, tile_index;
    wire [31:0] sink_bits, tile_clock, tile_frame, tile_bits;

    viform_board #(
        .ROWS(4), .COLUMNS(40), .LANES(32), .CLOCK_HZ(1000000), .BIT_CLOCKS(BIT_CLOCKS),
        .CAPTURE_WORDS(64), .SINK_WORDS(16)
    ) board (
        .clk(clk), .rst(rst), .serial_rx(serial_rx), .serial_tx(serial_tx),
        .sink_valid(sink_valid), .sink_row(sink_row), .sink_tile(sink_tile),
        .sink_bits(sink_bits), .tile_valid(tile_valid), .tile_clock(tile_clock),
        .tile_frame(tile_frame), .tile_row(tile_row), .tile_index(tile_index),
        .tile_bits(tile_bits), .soft_reset(soft_reset)
    );
    always #5 clk = !clk;

    task clocks;
        input integer count;
        integer i;
        for (i = 0; i < count; i = i + 1) @(negedge clk);
    endtask
    task send;
        input [7:0] value;
        integer i;
        begin
            serial_rx = 0;
            clocks(BIT_CLOCKS);
            for (i = 0; i < 8; i = i + 1) begin
                serial_rx = value[i];
                clocks(BIT_CLOCKS);
            end
            serial_rx = 1;
            clocks(BIT_CLOCKS);
        end
    endtask
    task head;
        input [7:0] command;
        input [7:0] words;
        input [31:0] address; // in bytes
        begin
            send(command);
            send(words);
            send(address[31:26]);
            send(address[25:18]);
            send(address[17:10]);
            send(address[9:2]);
        end
    endtask
    task write_word;
        input [31:0] address;
        input [31:0] value;
        begin
            head(8'd1, 8'd1, address);
            send(value[31:24]);
            send(value[23:16]);
            send(value[15:8]);
            send(value[7:0]);
        end
    endtask

    // Every byte that the board sends.
    reg [7:0] byte_seen;
    integer k;
    always begin
        @(negedge serial_tx);
        repeat (BIT_CLOCKS / 2) @(negedge clk);
        for (k = 0; k < 8; k = k + 1) begin
            repeat (BIT_CLOCKS) @(negedge clk);
            byte_seen[k] = serial_tx;
        end
        repeat (BIT_CLOCKS) @(negedge clk);
        if (!serial_tx) $display("framing");
        $display("byte %h", byte_seen);
    end
    always @(negedge clk) if (tile_valid)
        $display("tile %0d %0d %0d %0d %h", tile_clock, tile_frame, tile_row, tile_index, tile_bits);

    integer i;
    reg [7:0] base;
    initial begin
        clocks(3);
        rst = 0;
        clocks(20);
        head(8'd2, 8'd2, 32'h000);
        clocks(8 * 10 * BIT_CLOCKS + 100);
        write_word(32'h304, 32'd0);           // threshold of 255
        write_word(32'h318, 32'd100);         // clocks of a tick
        write_word(32'h310, 32'h0001_0001);   // row 1
        base = 8'd0;
        for (i = 0; i < 16; i = i + 1) begin  // row 1: 8 c electrons at column c, modulo 256
            write_word(32'h0010_0040 + 4 * i, {base + 8'd24, base + 8'd16, base + 8'd8, base});
            base = base + 8'd32;
        end
        write_word(32'h300, 32'd1);
        clocks(330);
        write_word(32'h300, 32'd0);
        clocks(200);
        $display("done");
        $finish;
    end
endmodule
