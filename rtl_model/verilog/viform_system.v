// The board without its serial line: the bus, and everything that hangs on it.
`include "viform_registers.vh"
module viform_system #(
    parameter [31:0] ROWS = 32,
    parameter [31:0] COLUMNS = 32,
    parameter [31:0] LANES = 32,
    parameter [31:0] CLOCK_HZ = 48000000,
    parameter [31:0] BIT_CLOCKS = 417,
    parameter [31:0] CAPTURE_WORDS = 4096,
    parameter [31:0] SINK_WORDS = 1024,
    parameter [31:0] BUILD = 0
) (
    input wire clk,
    input wire rst,
    input wire [29:0] bus_adr,
    input wire bus_we,
    input wire bus_re,
    input wire [31:0] bus_wdata,
    output reg [31:0] bus_rdata,
    output reg bus_rvalid,
    output wire tile_valid,
    output wire [31:0] tile_clock,
    output wire [31:0] tile_frame,
    output wire [15:0] tile_row,
    output wire [15:0] tile_index,
    output wire [LANES-1:0] tile_bits,
    output wire sink_valid,
    output wire [15:0] sink_row,
    output wire [15:0] sink_tile,
    output wire [LANES-1:0] sink_bits,
    input wire ev_rx_byte,
    input wire ev_tx_byte,
    input wire ev_framing,
    input wire ev_watchdog,
    input wire ev_unknown,
    input wire ev_write,
    input wire [31:0] ev_write_data,
    input wire [31:0] shortest_low,
    output wire uart_clear,
    output wire soft_reset
);
    localparam [31:0] TILES = (COLUMNS + LANES - 1) / LANES;
    localparam [31:0] ROW_WORDS = TILES * LANES / 32;
    localparam [31:0] ROW_CLOCKS = ROW_WORDS + 4;
    localparam [31:0] TICK_MINIMUM = ROWS * ROW_CLOCKS + 4;
    localparam [31:0] TICK_NOMINAL = CLOCK_HZ / 40000;
    localparam [31:0] TICK_CLOCKS = TICK_NOMINAL > TICK_MINIMUM ? TICK_NOMINAL : TICK_MINIMUM;
    localparam [31:0] CAPTURE_BITS = $clog2(CAPTURE_WORDS);
    localparam [31:0] PATTERN_WORDS = ROWS * TILES * LANES / 4;
    localparam [31:0] ADDRESS_BITS = ROWS * TILES > 1 ? $clog2(ROWS * TILES) : 1;
    localparam [29:0] WRITE_ADDRESS = `VIFORM_WRITE_MEM;
    localparam [21:0] WRITE_PLACE = WRITE_ADDRESS[29:8];
    localparam [31:0] WORD_BITS = ADDRESS_BITS + $clog2(LANES / 4);

    // A parameter that is not supported ends the elaboration: the module of this name is absent.
    generate
        if (LANES != 32 && LANES != 64) begin : refuse_lanes
            LANES_must_be_32_or_64 refused ();
        end
        if (ROWS == 0 || ROWS > 4095) begin : refuse_rows
            ROWS_must_be_1_to_4095 refused ();
        end
        if (COLUMNS == 0 || COLUMNS > 4096) begin : refuse_columns
            COLUMNS_must_be_1_to_4096 refused ();
        end
        if (BIT_CLOCKS < 4) begin : refuse_bit_clocks
            BIT_CLOCKS_must_be_at_least_4 refused ();
        end
        if (CAPTURE_WORDS < 2 || (CAPTURE_WORDS & (CAPTURE_WORDS - 1)) != 0) begin : refuse_capture
            CAPTURE_WORDS_must_be_a_power_of_two refused ();
        end
        if (SINK_WORDS < 4 || (SINK_WORDS & (SINK_WORDS - 1)) != 0) begin : refuse_sinks
            SINK_WORDS_must_be_a_power_of_two refused ();
        end
    endgenerate

    wire reset = rst || soft_reset;
    // A numbered write becomes a write to the address in its head, in the same clock.
    wire at_numbered = bus_adr[29:8] == WRITE_PLACE;
    wire pass;
    wire [29:0] pass_adr;
    wire [31:0] numbered_rdata;
    wire we = bus_we && (!at_numbered || pass);
    wire [29:0] adr = bus_we && at_numbered ? pass_adr : bus_adr;
    viform_numbered numbered (
        .clk(clk), .power_on(rst), .write(bus_we && at_numbered), .read(bus_re && at_numbered),
        .index(bus_adr[7:0]), .wdata(bus_wdata), .pass(pass), .pass_adr(pass_adr),
        .rdata(numbered_rdata)
    );

    wire [23:0] group = adr[29:6];
    wire [5:0] offset = adr[5:0];
    wire [29:0] pattern_index = adr - `VIFORM_PATTERN_MEM;
    wire [29:0] identifier_index = adr - `VIFORM_IDENTIFIER_MEM;
    wire [29:0] captured_index = adr - `VIFORM_CAPTURE_MEM;
    wire [5:0] identifier_words;

    wire at_control = group == `VIFORM_GROUP_CTRL && offset < `VIFORM_COUNT_CTRL;
    wire at_uart = group == `VIFORM_GROUP_UART && offset < `VIFORM_COUNT_UART;
    wire at_prbs = group == `VIFORM_GROUP_PRBS && offset < `VIFORM_COUNT_PRBS;
    wire at_sensor = group == `VIFORM_GROUP_SENSOR && offset < `VIFORM_COUNT_SENSOR;
    wire at_capture = group == `VIFORM_GROUP_CAPTURE && offset < `VIFORM_COUNT_CAPTURE;
    wire at_sink = group == `VIFORM_GROUP_SINK && offset < `VIFORM_COUNT_SINK;
    wire at_identifier = identifier_index < {24'd0, identifier_words};
    wire at_pattern = pattern_index < PATTERN_WORDS[29:0];
    wire at_captured = captured_index < CAPTURE_WORDS[29:0];
    wire known = at_control || at_uart || at_prbs || at_sensor || at_capture || at_sink
        || at_identifier || at_pattern || at_captured || (at_numbered && bus_re);

    // A read: the block that is meant registers its word, which is passed on a clock later.
    reg [6:0] answering;
    reg reading;
    wire [31:0] control_rdata, prbs_rdata, sensor_rdata, pattern_rdata, capture_rdata, sink_rdata;
    always @(posedge clk) begin
        reading <= bus_re && !rst;
        bus_rvalid <= reading && !rst;
        if (bus_re) answering <= {
            at_numbered, at_control || at_uart || at_identifier, at_prbs, at_sensor, at_pattern,
            at_capture || at_captured, at_sink
        };
        if (reading) case (1'b1)
            answering[6]: bus_rdata <= numbered_rdata;
            answering[5]: bus_rdata <= control_rdata;
            answering[4]: bus_rdata <= prbs_rdata;
            answering[3]: bus_rdata <= sensor_rdata;
            answering[2]: bus_rdata <= pattern_rdata;
            answering[1]: bus_rdata <= capture_rdata;
            answering[0]: bus_rdata <= sink_rdata;
            default: bus_rdata <= 32'd0;
        endcase
    end

    wire [31:0] uptime;
    viform_control #(
        .ROWS(ROWS), .COLUMNS(COLUMNS), .LANES(LANES), .CLOCK_HZ(CLOCK_HZ),
        .BIT_CLOCKS(BIT_CLOCKS), .BUILD(BUILD)
    ) control (
        .clk(clk), .power_on(rst), .reset(reset), .bus_error((we || bus_re) && !known),
        .control_write(we && at_control), .control_read(bus_re && at_control),
        .uart_write(we && at_uart), .uart_read(bus_re && at_uart),
        .identifier_read(bus_re && at_identifier), .offset(offset), .wdata(bus_wdata),
        .rdata(control_rdata), .uptime(uptime), .soft_reset(soft_reset), .uart_clear(uart_clear),
        .identifier_words(identifier_words), .ev_rx_byte(ev_rx_byte), .ev_tx_byte(ev_tx_byte),
        .ev_framing(ev_framing), .ev_watchdog(ev_watchdog), .ev_unknown(ev_unknown),
        .ev_write(ev_write), .ev_write_data(ev_write_data), .shortest_low(shortest_low)
    );

    viform_prbs prbs (
        .clk(clk), .reset(reset), .write(we && at_prbs), .read(bus_re && at_prbs),
        .offset(offset), .wdata(bus_wdata), .rdata(prbs_rdata)
    );

    wire start, scanning, scan_read, compute, tile_last;
    viform_sensor #(
        .ROWS(ROWS), .COLUMNS(COLUMNS), .LANES(LANES), .TILES(TILES), .ROW_CLOCKS(ROW_CLOCKS),
        .TICK_MINIMUM(TICK_MINIMUM), .TICK_CLOCKS(TICK_CLOCKS), .ADDRESS_BITS(ADDRESS_BITS),
        .WORD_BITS(WORD_BITS)
    ) sensor (
        .clk(clk), .reset(reset), .uptime(uptime), .write(we && at_sensor),
        .read(bus_re && at_sensor), .offset(offset), .wdata(bus_wdata), .rdata(sensor_rdata),
        .pattern_write(we && at_pattern), .pattern_read(bus_re && at_pattern),
        .pattern_word(pattern_index[WORD_BITS-1:0]), .pattern_rdata(pattern_rdata), .start(start),
        .scanning(scanning), .scan_read(scan_read), .compute(compute), .tile_last(tile_last),
        .tile_valid(tile_valid), .tile_clock(tile_clock), .tile_frame(tile_frame),
        .tile_row(tile_row), .tile_index(tile_index), .tile_bits(tile_bits)
    );

    viform_sink #(.LANES(LANES), .SINK_WORDS(SINK_WORDS)) sink (
        .clk(clk), .reset(reset), .write(we && at_sink), .read(bus_re && at_sink),
        .offset(offset), .wdata(bus_wdata), .rdata(sink_rdata), .start(start),
        .scanning(scanning), .scan_read(scan_read), .compute(compute), .tile_last(tile_last),
        .valid(sink_valid), .bits(sink_bits)
    );
    assign sink_row = tile_row;
    assign sink_tile = tile_index;

    viform_capture #(
        .LANES(LANES), .TILES(TILES), .ROW_WORDS(ROW_WORDS), .CAPTURE_WORDS(CAPTURE_WORDS)
    ) capture (
        .clk(clk), .reset(reset), .write(we && at_capture), .read(bus_re && at_capture),
        .memory_read(bus_re && at_captured), .memory_index(captured_index[CAPTURE_BITS-1:0]),
        .offset(offset), .wdata(bus_wdata), .rdata(capture_rdata), .start(start),
        .scanning(scanning), .frame(tile_frame[19:0]), .row(tile_row[11:0]), .tile(tile_index),
        .tile_valid(tile_valid), .tile_bits(tile_bits), .sink_valid(sink_valid),
        .sink_bits(sink_bits)
    );
endmodule
