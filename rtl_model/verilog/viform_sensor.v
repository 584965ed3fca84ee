// The pixel array emulator behind its registers: pattern memory, scan, pixels, counters.
`include "viform_registers.vh"
module viform_sensor #(
    parameter [31:0] ROWS = 32,
    parameter [31:0] COLUMNS = 32,
    parameter [31:0] LANES = 32,
    parameter [31:0] TILES = 1,
    parameter [31:0] ROW_CLOCKS = 5,
    parameter [31:0] TICK_MINIMUM = 164,
    parameter [31:0] TICK_CLOCKS = 1200,
    parameter [31:0] ADDRESS_BITS = 5,
    parameter [31:0] WORD_BITS = 8
) (
    input wire clk,
    input wire reset,
    input wire [31:0] uptime,
    input wire write,
    input wire read,
    input wire [5:0] offset,
    input wire [31:0] wdata,
    output reg [31:0] rdata,
    input wire pattern_write,
    input wire pattern_read,
    input wire [WORD_BITS-1:0] pattern_word,
    output wire [31:0] pattern_rdata,
    output wire start,
    output wire scanning,
    output wire scan_read,
    output wire compute,
    output reg tile_last,
    output reg tile_valid,
    output reg [31:0] tile_clock,
    output reg [31:0] tile_frame,
    output reg [15:0] tile_row,
    output reg [15:0] tile_index,
    output wire [LANES-1:0] tile_bits
);
    localparam [31:0] DEPTH = ROWS * TILES > 1 ? ROWS * TILES : 2;
    localparam [31:0] GROUPS = LANES / 4;
    localparam [31:0] GROUP_BITS = $clog2(GROUPS);
    localparam [31:0] ALL_ROWS = (ROWS - 1) << 16;
    localparam [31:0] ALL_COLUMNS = (COLUMNS - 1) << 16;

    reg run, clock_select, clear;
    reg [3:0] threshold;
    reg [1:0] rule;
    reg [1:0] pattern;
    reg [2:0] request;
    reg [7:0] level;
    reg [31:0] rows, columns, tick_clocks;
    reg [31:0] frames, frame_clock, rows_read, spikes;

    wire [ADDRESS_BITS-1:0] read_address, address;
    wire [15:0] row, tile;
    wire row_live, last_tile, fresh, double, parity;
    wire [7:0] ramp;
    wire [LANES-1:0] live;
    wire [31:0] frame;
    wire pass, taken, reading;
    wire [6:0] pass_number;
    wire [3:0] read_level;
    wire [11:0] lent;

    viform_scan #(
        .ROWS(ROWS), .COLUMNS(COLUMNS), .LANES(LANES), .TILES(TILES), .ROW_CLOCKS(ROW_CLOCKS),
        .TICK_MINIMUM(TICK_MINIMUM), .ADDRESS_BITS(ADDRESS_BITS)
    ) scan (
        .clk(clk), .reset(reset), .run(run), .pass(pass), .clear(clear),
        .clock_select(clock_select), .tick_clocks(tick_clocks), .rows(rows), .columns(columns),
        .frames(frames), .start(start), .read(scan_read), .read_address(read_address),
        .scanning(scanning), .compute(compute), .address(address), .row(row), .tile(tile),
        .last_tile(last_tile), .row_live(row_live), .live(live), .ramp(ramp), .parity(parity),
        .frame(frame), .fresh(fresh), .double(double)
    );

    viform_reading charges_read (
        .clk(clk), .reset(reset), .start(start), .request(request), .threshold(threshold),
        .pass(pass), .taken(taken), .reading(reading), .number(pass_number),
        .level(read_level), .lent(lent)
    );

    // Electrons of the patterns that are none of the memory, in even lanes and in odd ones; in a
    // reading those that it lends.
    wire stored = !reading && pattern == 2'd0;
    wire rising = !reading && pattern == 2'd2;
    wire [7:0] first = level + ramp;
    wire lit = pattern == 2'd1; // in all lanes
    wire [7:0] even = reading ? lent[7:0]
        : rising ? first : lit || pattern[0] && parity ? level : 8'd0;
    wire [7:0] odd = reading ? lent[7:0]
        : rising ? first : lit || pattern[0] && !parity ? level : 8'd0;

    genvar group;
    generate
        for (group = 0; group < GROUPS; group = group + 1) begin : groups
            localparam [31:0] INDEX = group;
            viform_pixels #(
                .DEPTH(DEPTH), .ADDRESS_BITS(ADDRESS_BITS), .FIRST_LANE(4 * group)
            ) pixels (
                .clk(clk),
                .pattern_write(
                    pattern_write && pattern_word[GROUP_BITS-1:0] == INDEX[GROUP_BITS-1:0]
                ),
                .pattern_address(pattern_word[GROUP_BITS +: ADDRESS_BITS]),
                .pattern_data(wdata),
                .read(scan_read), .read_address(read_address),
                .compute(compute), .address(address), .live(live[4*group +: 4]),
                .fresh(fresh), .double(double && !reading),
                .level(reading ? read_level : threshold), .rule(rule),
                .stored(stored), .rising(rising), .even(even), .odd(odd),
                .upper(reading ? lent[11:8] : 4'd0), .hold(reading),
                .bits(tile_bits[4*group +: 4])
            );
        end
    endgenerate

    // What the bus reads back: a copy of the pattern memory, 32 bits wide. The other one is read
    // by the scan, has no second read port, and may not wait.
    viform_ram #(.DEPTH(DEPTH * GROUPS), .WIDTH(32), .ADDRESS_BITS(WORD_BITS)) pattern_copy (
        .clk(clk), .write(pattern_write), .write_address(pattern_word),
        .write_data(wdata), .read(pattern_read), .read_address(pattern_word),
        .read_data(pattern_rdata)
    );

    function [6:0] ones;
        input [LANES-1:0] bits;
        integer i;
        begin
            ones = 7'd0;
            for (i = 0; i < LANES; i = i + 1) ones = ones + {6'd0, bits[i]};
        end
    endfunction

    always @(posedge clk) begin
        tile_valid <= compute && row_live;
        if (compute) begin
            tile_clock <= uptime;
            tile_frame <= reading ? {25'd0, pass_number} : frame;
            tile_row <= row;
            tile_index <= tile;
            tile_last <= last_tile;
        end
        if (start) begin
            frame_clock <= uptime;
            if (!pass) begin
                frames <= clear ? 32'd1 : frames + 32'd1;
                clear <= 1'b0;
                if (clear) begin
                    rows_read <= 32'd0;
                    spikes <= 32'd0;
                end
            end
        end else if (tile_valid && !reading) begin
            spikes <= spikes + {25'd0, ones(tile_bits)};
            if (tile_last) rows_read <= rows_read + 32'd1;
        end
        if (taken) request <= 3'd0;
        if (write) case (offset)
            `VIFORM_SENSOR_RUN: run <= wdata[0];
            `VIFORM_SENSOR_THRESHOLD: threshold <= wdata[3:0];
            `VIFORM_SENSOR_CLOCK_SELECT: clock_select <= wdata[0];
            `VIFORM_SENSOR_RESET_RULE: rule <= wdata[1:0];
            `VIFORM_SENSOR_ROWS: rows <= wdata;
            `VIFORM_SENSOR_COLUMNS: columns <= wdata;
            `VIFORM_SENSOR_TICK_CLOCKS: tick_clocks <= wdata;
            `VIFORM_SENSOR_PATTERN: pattern <= wdata[1:0];
            `VIFORM_SENSOR_LEVEL: level <= wdata[7:0];
            `VIFORM_SENSOR_READING: request <= wdata[2:0];
            `VIFORM_SENSOR_CLEAR: if (wdata[0]) clear <= 1'b1;
            default: ;
        endcase
        if (reset) begin
            run <= `VIFORM_SENSOR_RUN_RESET;
            threshold <= `VIFORM_SENSOR_THRESHOLD_RESET;
            clock_select <= `VIFORM_SENSOR_CLOCK_SELECT_RESET;
            rule <= `VIFORM_SENSOR_RESET_RULE_RESET;
            rows <= ALL_ROWS;
            columns <= ALL_COLUMNS;
            tick_clocks <= TICK_CLOCKS;
            pattern <= `VIFORM_SENSOR_PATTERN_RESET;
            level <= `VIFORM_SENSOR_LEVEL_RESET;
            clear <= 1'b1; // the charges still stand in their memory
            request <= 3'd0;
            frames <= 32'd0;
            frame_clock <= 32'd0;
            rows_read <= 32'd0;
            spikes <= 32'd0;
            tile_valid <= 1'b0;
        end
    end

    always @(posedge clk) if (read) case (offset)
        `VIFORM_SENSOR_RUN: rdata <= {31'd0, run};
        `VIFORM_SENSOR_THRESHOLD: rdata <= {28'd0, threshold};
        `VIFORM_SENSOR_CLOCK_SELECT: rdata <= {31'd0, clock_select};
        `VIFORM_SENSOR_RESET_RULE: rdata <= {30'd0, rule};
        `VIFORM_SENSOR_ROWS: rdata <= rows;
        `VIFORM_SENSOR_COLUMNS: rdata <= columns;
        `VIFORM_SENSOR_TICK_CLOCKS: rdata <= tick_clocks;
        `VIFORM_SENSOR_TICK_MINIMUM: rdata <= TICK_MINIMUM;
        `VIFORM_SENSOR_PATTERN: rdata <= {30'd0, pattern};
        `VIFORM_SENSOR_LEVEL: rdata <= {24'd0, level};
        `VIFORM_SENSOR_FRAMES: rdata <= frames;
        `VIFORM_SENSOR_FRAME_CLOCK: rdata <= frame_clock;
        `VIFORM_SENSOR_ROWS_READ: rdata <= rows_read;
        `VIFORM_SENSOR_SPIKES: rdata <= spikes;
        default: rdata <= 32'd0;
    endcase
endmodule
