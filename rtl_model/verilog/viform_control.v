// Registers of the board itself: identity, reset, bus errors, counters of the serial line, and the
// identifier's text.
`include "viform_registers.vh"
module viform_control #(
    parameter [31:0] ROWS = 32,
    parameter [31:0] COLUMNS = 32,
    parameter [31:0] LANES = 32,
    parameter [31:0] CLOCK_HZ = 48000000,
    parameter [31:0] BIT_CLOCKS = 417,
    parameter [31:0] BUILD = 0
) (
    input wire clk,
    input wire power_on,
    input wire reset,
    input wire bus_error,
    input wire control_write,
    input wire control_read,
    input wire uart_write,
    input wire uart_read,
    input wire identifier_read,
    input wire [5:0] offset,
    input wire [31:0] wdata,
    output reg [31:0] rdata,
    output reg [31:0] uptime,
    output wire soft_reset,
    output wire uart_clear,
    output wire [5:0] identifier_words,
    input wire ev_rx_byte,
    input wire ev_tx_byte,
    input wire ev_framing,
    input wire ev_watchdog,
    input wire ev_unknown,
    input wire ev_write,
    input wire [31:0] ev_write_data,
    input wire [31:0] shortest_low
);
    `include "viform_crc32.vh"

    // "Viform spike board ROWSxCOLUMNS", the last character in the lowest byte.
    function [255:0] text;
        input integer rows;
        input integer columns;
        begin
            text = "Viform spike board ";
            text = with_number(text, rows);
            text = {text[247:0], "x"};
            text = with_number(text, columns);
        end
    endfunction
    function [255:0] with_number;
        input [255:0] prefix;
        input integer number;
        integer place;
        integer digit;
        begin
            with_number = prefix;
            for (place = 1000; place > 0; place = place / 10) begin
                digit = number / place % 10;
                if (number >= place)
                    with_number = {with_number[247:0], 8'd48} + {224'd0, digit};
            end
        end
    endfunction
    function integer digits;
        input integer number;
        digits = number < 10 ? 1 : number < 100 ? 2 : number < 1000 ? 3 : 4;
    endfunction

    localparam [255:0] TEXT = text(ROWS, COLUMNS);
    localparam [31:0] CHARACTERS = 20 + digits(ROWS) + digits(COLUMNS);
    localparam [31:0] WORDS = CHARACTERS + 1;
    assign identifier_words = WORDS[5:0];
    wire [5:0] place = CHARACTERS[5:0] - 6'd1 - offset;
    wire [255:0] characters = TEXT;
    wire [7:0] character = place[5] ? 8'd0 : characters[{place[4:0], 3'd0} +: 8];

    reg [31:0] scratch, bus_errors;
    reg [31:0] rx_bytes, tx_bytes, framing_errors, watchdog_aborts, unknown_commands;
    reg [31:0] writes, writes_crc;

    assign soft_reset = control_write && offset == `VIFORM_CTRL_RESET && wdata[0];
    assign uart_clear = uart_write && offset == `VIFORM_UART_CLEAR && wdata[0];

    always @(posedge clk) begin
        uptime <= power_on ? 32'd0 : uptime + 32'd1;
        if (bus_error) bus_errors <= bus_errors + 32'd1;
        if (control_write && offset == `VIFORM_CTRL_SCRATCH) scratch <= wdata;
        if (reset) begin
            scratch <= `VIFORM_CTRL_SCRATCH_RESET;
            bus_errors <= 32'd0;
        end
    end

    always @(posedge clk)
        if (power_on || uart_clear) begin
            rx_bytes <= 32'd0;
            tx_bytes <= 32'd0;
            framing_errors <= 32'd0;
            watchdog_aborts <= 32'd0;
            unknown_commands <= 32'd0;
            writes <= 32'd0;
            writes_crc <= 32'hFFFFFFFF;
        end else begin
            if (ev_rx_byte) rx_bytes <= rx_bytes + 32'd1;
            if (ev_tx_byte) tx_bytes <= tx_bytes + 32'd1;
            if (ev_framing) framing_errors <= framing_errors + 32'd1;
            if (ev_watchdog) watchdog_aborts <= watchdog_aborts + 32'd1;
            if (ev_unknown) unknown_commands <= unknown_commands + 32'd1;
            if (ev_write) begin
                writes <= writes + 32'd1;
                writes_crc <= crc32_word(writes_crc, ev_write_data);
            end
        end

    always @(posedge clk)
        if (control_read) case (offset)
            `VIFORM_CTRL_MAGIC: rdata <= `VIFORM_CTRL_MAGIC_RESET;
            `VIFORM_CTRL_SCRATCH: rdata <= scratch;
            `VIFORM_CTRL_VERSION: rdata <= `VIFORM_CTRL_VERSION_RESET;
            `VIFORM_CTRL_GEOMETRY: rdata <= {ROWS[15:0], COLUMNS[15:0]};
            `VIFORM_CTRL_LANES: rdata <= LANES;
            `VIFORM_CTRL_CLOCK_HZ: rdata <= CLOCK_HZ;
            `VIFORM_CTRL_BUILD: rdata <= BUILD;
            `VIFORM_CTRL_BUS_ERRORS: rdata <= bus_errors;
            `VIFORM_CTRL_UPTIME: rdata <= uptime;
            default: rdata <= 32'd0;
        endcase else if (uart_read) case (offset)
            `VIFORM_UART_RX_BYTES: rdata <= rx_bytes;
            `VIFORM_UART_TX_BYTES: rdata <= tx_bytes;
            `VIFORM_UART_FRAMING_ERRORS: rdata <= framing_errors;
            `VIFORM_UART_WATCHDOG_ABORTS: rdata <= watchdog_aborts;
            `VIFORM_UART_UNKNOWN_COMMANDS: rdata <= unknown_commands;
            `VIFORM_UART_WRITES: rdata <= writes;
            `VIFORM_UART_WRITES_CRC: rdata <= ~writes_crc;
            `VIFORM_UART_BIT_CLOCKS: rdata <= BIT_CLOCKS;
            `VIFORM_UART_SHORTEST_LOW: rdata <= shortest_low;
            default: rdata <= 32'd0;
        endcase else if (identifier_read) rdata <= {24'd0, character};
endmodule
