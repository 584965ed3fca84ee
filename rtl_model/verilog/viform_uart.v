// Pins to bytes and back: 8N1, least significant bit first, `BIT_CLOCKS` clocks a bit. A bit is
// read in its middle, and from the middle of the stop bit on a new start bit may come: so a sender
// may be faster or slower by nearly half a bit in nine and a half.
module viform_uart #(
    parameter [31:0] BIT_CLOCKS = 417
) (
    input wire clk,
    input wire rst,
    input wire serial_rx,
    output wire serial_tx,
    output reg [7:0] rx_data,
    output reg rx_valid,
    output reg ev_framing,
    input wire [7:0] tx_data,
    input wire tx_valid,
    output wire tx_ready,
    input wire clear,
    output reg [31:0] shortest_low
);
    localparam [31:0] WHOLE = BIT_CLOCKS - 1;
    localparam [31:0] HALF = BIT_CLOCKS > 3 ? BIT_CLOCKS / 2 - 1 : 0;

    // The line passes two registers before it is looked at; it is high when idle.
    reg [2:0] line;
    wire low = !line[1];
    wire falls = low && line[2];

    reg receiving;
    reg [3:0] rx_bit;
    reg [31:0] rx_wait;
    reg [31:0] low_clocks;
    always @(posedge clk) begin
        line <= {line[1:0], serial_rx};
        rx_valid <= 1'b0;
        ev_framing <= 1'b0;
        if (!receiving) begin
            if (falls) begin
                receiving <= 1'b1;
                rx_bit <= 4'd0;
                rx_wait <= HALF;
            end
        end else if (rx_wait != 32'd0) rx_wait <= rx_wait - 32'd1;
        else begin
            rx_wait <= WHOLE;
            rx_bit <= rx_bit + 4'd1;
            if (rx_bit == 4'd0) receiving <= low; // a start bit, not a spike on the line
            else if (rx_bit == 4'd9) begin
                receiving <= 1'b0;
                rx_valid <= !low;
                ev_framing <= low;
            end else rx_data <= {!low, rx_data[7:1]};
        end

        if (low) low_clocks <= low_clocks == 32'hFFFFFFFF ? low_clocks : low_clocks + 32'd1;
        else begin
            low_clocks <= 32'd0;
            if (line[2:1] == 2'b01 && low_clocks < shortest_low) shortest_low <= low_clocks;
        end
        if (clear) shortest_low <= 32'hFFFFFFFF;
        if (rst) begin
            line <= 3'b111;
            receiving <= 1'b0;
            rx_valid <= 1'b0;
            ev_framing <= 1'b0;
            low_clocks <= 32'd0;
            shortest_low <= 32'hFFFFFFFF;
        end
    end

    // The byte and its stop bit move out; what follows is idle.
    reg [8:0] tx_bits;
    reg [3:0] tx_left;
    reg [31:0] tx_wait;
    reg tx_line;
    assign serial_tx = tx_line;
    assign tx_ready = tx_left == 4'd0 && tx_wait == 32'd0;
    always @(posedge clk) begin
        if (tx_ready) begin
            if (tx_valid) begin
                tx_line <= 1'b0;
                tx_bits <= {1'b1, tx_data};
                tx_left <= 4'd9;
                tx_wait <= WHOLE;
            end
        end else if (tx_wait != 32'd0) tx_wait <= tx_wait - 32'd1;
        else begin
            tx_line <= tx_bits[0];
            tx_bits <= {1'b1, tx_bits[8:1]};
            tx_left <= tx_left - 4'd1;
            tx_wait <= WHOLE;
        end
        if (rst) begin
            tx_line <= 1'b1;
            tx_left <= 4'd0;
            tx_wait <= 32'd0;
        end
    end
endmodule
