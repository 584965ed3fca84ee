// A pixel array whose state stands in an external memory, computed PIXELS pixels at a time. The
// pixels are those of viform_pixels, and the tiles those of viform_sensor. Settings are sampled at
// a frame's start. A frame that is due while another one is computed begins late.
//
// Pixel j of a memory word has its charge in bits 20 j + 11 to 20 j, and its electrons a tick, for
// pattern 0, in the eight bits above. Words lie row by row, in whole tiles.
//
// The memory carries out commands in order, one at each clock at which `mem_valid` and `mem_ready`
// are high. A command waits unchanged. Words that are read come with `mem_rvalid`, in order, after
// any number of clocks; none is held back. A reset of the array must find no read under way.
module viform_external #(
    parameter [31:0] ROWS = 128,
    parameter [31:0] COLUMNS = 128,
    parameter [31:0] LANES = 32,
    parameter [31:0] TILES = 4,
    parameter [31:0] PIXELS = 4,      // of a memory word: 1, 2, 4 or 8
    parameter [31:0] IN_FLIGHT = 16,  // most words between read and write, a power of two
    parameter [31:0] ADDRESS_BITS = 12
) (
    input wire clk,
    input wire reset,
    input wire run,
    input wire clear, // the next frame is number 0 and starts without charge
    input wire [3:0] threshold,
    input wire clock_select,
    input wire [1:0] reset_rule,
    input wire [31:0] rows,
    input wire [31:0] columns,
    input wire [31:0] tick_clocks,
    input wire [1:0] pattern,
    input wire [7:0] level,
    output reg [31:0] frames,
    output reg [31:0] late, // frames that began after they were due, since reset
    output reg mem_valid,
    input wire mem_ready,
    output reg mem_write,
    output reg [ADDRESS_BITS-1:0] mem_address,
    output reg [20*PIXELS-1:0] mem_wdata,
    input wire mem_rvalid,
    input wire [20*PIXELS-1:0] mem_rdata,
    output reg tile_valid,
    output reg [31:0] tile_frame,
    output reg [15:0] tile_row,
    output reg [15:0] tile_index,
    output reg [LANES-1:0] tile_bits
);
    localparam [31:0] WIDTH = 20 * PIXELS;
    localparam [31:0] WORDS = ROWS * TILES * LANES / PIXELS;
    localparam [31:0] FLIGHT_BITS = $clog2(IN_FLIGHT);
    localparam [31:0] LAST_WORD = WORDS - 1;
    localparam [31:0] LAST_ROW = ROWS - 1;
    localparam [31:0] LAST_COLUMN = COLUMNS - 1;
    localparam [31:0] LAST_START = TILES * LANES - PIXELS; // column of a row's last word
    localparam [31:0] LAST_PLACE = LANES - PIXELS;
    localparam SHIFT = $clog2(LANES);

    generate
        if (PIXELS != 1 && PIXELS != 2 && PIXELS != 4 && PIXELS != 8) begin : refuse_pixels
            PIXELS_must_be_1_2_4_or_8 refused ();
        end
        if (IN_FLIGHT < 2 || (IN_FLIGHT & (IN_FLIGHT - 1)) != 0) begin : refuse_flight
            IN_FLIGHT_must_be_a_power_of_two refused ();
        end
    endgenerate

    // The frame and its settings.
    reg busy, due, overdue, cleared, fresh, double;
    reg [32:0] left;
    reg [3:0] level_of_q;
    reg [1:0] rule, source;
    reg [7:0] light;
    reg [31:0] frame, row_window, column_window;
    wire start = run && due && !busy;
    wire [31:0] tick = tick_clocks == 32'd0 ? 32'd1 : tick_clocks;
    wire [32:0] period = clock_select ? {tick, 1'b0} : {1'b0, tick};

    // Commands: writes go first, so that what is in flight can be written at once.
    reg [ADDRESS_BITS-1:0] asked, written; // words
    reg asking;
    reg [FLIGHT_BITS:0] flight;
    wire queued;
    wire [WIDTH-1:0] queued_data;
    wire free = !mem_valid || mem_ready;
    wire issue_write = free && queued;
    wire issue_read = free && !queued && asking && flight != IN_FLIGHT[FLIGHT_BITS:0];
    localparam [FLIGHT_BITS:0] ONE = {{FLIGHT_BITS{1'b0}}, 1'b1};

    // The word that arrives: its place in the array, and a tick of each of its pixels.
    reg [15:0] row, column;
    wire row_live = row >= row_window[15:0] && row <= row_window[31:16];
    wire [WIDTH-1:0] computed;
    wire [PIXELS-1:0] fired;
    genvar j;
    generate
        for (j = 0; j < PIXELS; j = j + 1) begin : pixels
            localparam [31:0] NUMBER = j;
            wire [15:0] place = column + NUMBER[15:0];
            wire live = row_live && place >= column_window[15:0] && place <= column_window[31:16]
                && place <= LAST_COLUMN[15:0];
            viform_tick tick_of_pixel (
                .live(live), .double(double), .level(level_of_q), .rule(rule),
                .held(fresh ? 12'd0 : mem_rdata[20*j +: 12]),
                .electrons(
                    source == 2'd0 ? mem_rdata[20*j+12 +: 8]
                    : source == 2'd1 ? light
                    : source == 2'd2 ? light + row[7:0] + place[7:0] + frame[7:0]
                    : row[0] ^ place[0] ^ frame[0] ? light : 8'd0
                ),
                .fired(fired[j]), .rest(computed[20*j +: 12])
            );
            assign computed[20*j+12 +: 8] = mem_rdata[20*j+12 +: 8];
        end
    endgenerate

    // `flight` bounds what waits here, so the level need not be known.
    reg put;
    reg [WIDTH-1:0] put_data;
    wire [FLIGHT_BITS:0] waiting;
    wire unused = &{1'b0, waiting};
    viform_fifo #(
        .DEPTH(IN_FLIGHT), .WIDTH(WIDTH), .INDEX_BITS(FLIGHT_BITS)
    ) results (
        .clk(clk), .reset(reset), .put(put), .put_data(put_data), .out_valid(queued),
        .out_ready(free), .out_data(queued_data), .level(waiting)
    );

    always @(posedge clk) begin
        if (clear) cleared <= 1'b1;
        if (start) begin
            busy <= 1'b1;
            asking <= 1'b1;
            due <= 1'b0;
            left <= period - 33'd1;
            overdue <= 1'b0;
            if (overdue) late <= late + 32'd1;
            fresh <= cleared;
            cleared <= clear;
            frame <= cleared ? 32'd0 : frames;
            frames <= cleared ? 32'd1 : frames + 32'd1;
            level_of_q <= threshold;
            double <= clock_select;
            rule <= reset_rule;
            source <= pattern;
            light <= level;
            row_window <= rows;
            column_window <= columns;
        end else begin
            if (!due) begin
                left <= left - 33'd1;
                due <= left <= 33'd1;
            end else if (busy) overdue <= 1'b1;
        end

        if (free) begin
            mem_valid <= issue_write || issue_read;
            mem_write <= issue_write;
            mem_address <= issue_write ? written : asked;
            mem_wdata <= queued_data;
        end
        if (issue_read) begin
            asked <= asked + 1'b1;
            if (asked == LAST_WORD[ADDRESS_BITS-1:0]) begin
                asking <= 1'b0;
                asked <= {ADDRESS_BITS{1'b0}};
            end
        end
        if (issue_write) begin
            written <= written + 1'b1;
            if (written == LAST_WORD[ADDRESS_BITS-1:0]) begin
                busy <= 1'b0;
                written <= {ADDRESS_BITS{1'b0}};
            end
        end
        flight <= flight + (issue_read ? ONE : {FLIGHT_BITS + 1{1'b0}})
            - (issue_write ? ONE : {FLIGHT_BITS + 1{1'b0}});

        put <= mem_rvalid;
        put_data <= computed;
        tile_valid <= 1'b0;
        if (mem_rvalid) begin
            tile_bits <= {fired, tile_bits[LANES-1:PIXELS]};
            tile_frame <= frame;
            tile_row <= row;
            tile_index <= column >> SHIFT;
            tile_valid <= row_live && column[SHIFT-1:0] == LAST_PLACE[SHIFT-1:0];
            column <= column + PIXELS[15:0];
            if (column == LAST_START[15:0]) begin
                column <= 16'd0;
                row <= row == LAST_ROW[15:0] ? 16'd0 : row + 16'd1;
            end
        end

        if (reset) begin
            busy <= 1'b0;
            asking <= 1'b0;
            due <= 1'b1;
            overdue <= 1'b0;
            cleared <= 1'b1;
            frames <= 32'd0;
            late <= 32'd0;
            asked <= {ADDRESS_BITS{1'b0}};
            written <= {ADDRESS_BITS{1'b0}};
            flight <= {FLIGHT_BITS + 1{1'b0}};
            mem_valid <= 1'b0;
            put <= 1'b0;
            row <= 16'd0;
            column <= 16'd0;
            tile_valid <= 1'b0;
        end
    end
endmodule
