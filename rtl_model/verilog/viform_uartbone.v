// LiteX uartbone: bytes to bus. A byte may come in every clock, but those that come while an answer
// is due are lost, as they are on other gateware.
//
//   command (01 write, 02 read, 03 write and 04 read at one address), length in words (0: 256),
//   word address (4 bytes), data; most significant byte first. No acknowledgement, no CRC.
//
// The watchdog counts from the command's byte and cuts a transaction after 100 ms. An unknown
// command swallows length and address.
module viform_uartbone #(
    parameter [31:0] CLOCK_HZ = 48000000
) (
    input wire clk,
    input wire rst,
    input wire [7:0] rx_data,
    input wire rx_valid,
    output wire [7:0] tx_data,
    output wire tx_valid,
    input wire tx_ready,
    output reg [29:0] bus_adr,
    output reg bus_we,
    output reg bus_re,
    output reg [31:0] bus_wdata,
    input wire [31:0] bus_rdata,
    input wire bus_rvalid,
    output reg ev_watchdog,
    output reg ev_unknown
);
    localparam [31:0] PATIENCE = CLOCK_HZ / 10;

    localparam [2:0] COMMAND = 3'd0, LENGTH = 3'd1, ADDRESS = 3'd2, DATA = 3'd3;
    localparam [2:0] FETCH = 3'd4, WAIT = 3'd5, ANSWER = 3'd6;

    reg [2:0] state;
    reg [7:0] command;
    reg [7:0] left;      // words after this one
    reg [1:0] place;     // byte of a word
    reg [29:0] address;
    reg [31:0] word;
    reg [31:0] elapsed;

    wire writes = command == 8'd1 || command == 8'd3;
    wire reads = command == 8'd2 || command == 8'd4;
    wire fixed = command[7:1] != 7'd0 && command != 8'd2;
    wire last_byte = place == 2'd3;
    wire late = state != COMMAND && elapsed == PATIENCE - 32'd1;

    assign tx_valid = state == ANSWER;
    assign tx_data = word[31:24];

    always @(posedge clk) begin
        bus_we <= 1'b0;
        bus_re <= 1'b0;
        ev_watchdog <= 1'b0;
        ev_unknown <= 1'b0;
        elapsed <= state == COMMAND ? 32'd0 : elapsed + 32'd1;
        case (state)
            COMMAND: if (rx_valid) begin
                command <= rx_data;
                state <= LENGTH;
            end
            LENGTH: if (rx_valid) begin
                left <= rx_data - 8'd1;
                place <= 2'd0;
                state <= ADDRESS;
            end
            ADDRESS: if (rx_valid) begin
                address <= {address[21:0], rx_data};
                place <= place + 2'd1;
                if (last_byte) begin
                    state <= writes ? DATA : reads ? FETCH : COMMAND;
                    ev_unknown <= !writes && !reads;
                end
            end
            DATA: if (rx_valid) begin
                bus_wdata <= {bus_wdata[23:0], rx_data};
                place <= place + 2'd1;
                if (last_byte) begin
                    bus_we <= 1'b1;
                    bus_adr <= address;
                    if (!fixed) address <= address + 30'd1;
                    left <= left - 8'd1;
                    if (left == 8'd0) state <= COMMAND;
                end
            end
            FETCH: begin
                bus_re <= 1'b1;
                bus_adr <= address;
                if (!fixed) address <= address + 30'd1;
                state <= WAIT;
            end
            WAIT: if (bus_rvalid) begin
                word <= bus_rdata;
                state <= ANSWER;
            end
            ANSWER: if (tx_ready) begin
                word <= {word[23:0], 8'd0};
                place <= place + 2'd1;
                if (last_byte) begin
                    left <= left - 8'd1;
                    state <= left == 8'd0 ? COMMAND : FETCH;
                end
            end
            default: state <= COMMAND;
        endcase
        if (late) begin
            state <= COMMAND;
            ev_watchdog <= 1'b1;
            bus_we <= 1'b0;
            bus_re <= 1'b0;
            ev_unknown <= 1'b0;
        end
        if (rst) begin
            state <= COMMAND;
            bus_we <= 1'b0;
            bus_re <= 1'b0;
        end
    end
endmodule
