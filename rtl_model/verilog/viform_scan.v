// The row scan: begins frames, and names the tile that is read from the memories at this clock
// (`read`) and the one that is computed (`compute`, a clock later). Settings that hold for a whole
// frame are sampled at its start.
module viform_scan #(
    parameter [31:0] ROWS = 32,
    parameter [31:0] COLUMNS = 32,
    parameter [31:0] LANES = 32,
    parameter [31:0] TILES = 1,
    parameter [31:0] ROW_CLOCKS = 5,
    parameter [31:0] TICK_MINIMUM = 164,
    parameter [31:0] ADDRESS_BITS = 5
) (
    input wire clk,
    input wire reset,
    input wire run,
    input wire pass,       // of a reading; it scans without `run` as well
    input wire clear,
    input wire clock_select,
    input wire [31:0] tick_clocks,
    input wire [31:0] rows,
    input wire [31:0] columns,
    input wire [31:0] frames,
    // At this clock.
    output wire start,
    output wire read,
    output reg [ADDRESS_BITS-1:0] read_address,
    output reg scanning,
    // A clock after `read`.
    output reg compute,
    output reg [ADDRESS_BITS-1:0] address,
    output reg [15:0] row,
    output reg [15:0] tile,
    output wire last_tile,
    output reg row_live,
    output reg [LANES-1:0] live,
    output reg [7:0] ramp, // row + column of lane 0 + frame
    output reg parity,     // of row and frame: the checker's phase
    // Of the frame.
    output reg [31:0] frame,
    output wire fresh, // at `read`
    output reg double
);
    localparam SHIFT = $clog2(LANES);
    localparam [31:0] LAST_ROW = ROWS - 1;
    localparam [31:0] LAST_TILE = TILES - 1;
    localparam [31:0] LAST_PHASE = ROW_CLOCKS - 1;
    localparam [31:0] LAST_LANE = LANES - 1;
    localparam [31:0] PADS = TILES * LANES - COLUMNS; // lanes right of the last column

    reg [15:0] phase;
    reg [15:0] read_row;
    reg [31:0] row_window, column_window;
    reg [32:0] left;
    reg due; // left == 0

    wire [31:0] tick = tick_clocks < TICK_MINIMUM ? TICK_MINIMUM : tick_clocks;
    wire [32:0] period = clock_select ? {tick, 1'b0} : {1'b0, tick};

    assign start = (run || pass) && due && !reset;
    assign read = (start || scanning) && phase < TILES[15:0];

    // What is sampled at a frame's start holds at once, for its first tile is read there.
    reg cleared;
    wire [31:0] frame_now = start ? clear ? 32'd0 : frames : frame;
    wire [31:0] rows_now = start ? rows : row_window;
    wire [31:0] columns_now = start ? columns : column_window;
    assign fresh = start ? clear : cleared;

    wire [15:0] base = phase << SHIFT;
    wire row_inside = read_row >= rows_now[15:0] && read_row <= rows_now[31:16];

    // The window, as a mask over the lanes of the tile whose first column is `first`.
    function [LANES-1:0] window;
        input [15:0] first;
        input [15:0] column_first;
        input [15:0] column_last;
        reg [15:0] from, to;
        reg [LANES-1:0] all, not_before, not_after;
        begin
            all = {LANES{1'b1}};
            from = column_first - first;
            to = column_last - first;
            not_before = column_first <= first ? all :
                from > LAST_LANE[15:0] ? {LANES{1'b0}} : all << from[SHIFT-1:0];
            not_after = column_last < first ? {LANES{1'b0}} :
                to >= LAST_LANE[15:0] ? all : ~((all << 1) << to[SHIFT-1:0]);
            window = not_before & not_after;
        end
    endfunction

    always @(posedge clk) begin
        if (start) begin
            due <= 1'b0; // a tick is longer than a clock
            left <= period - 33'd1;
            frame <= frame_now;
            cleared <= clear;
            double <= clock_select;
            row_window <= rows;
            column_window <= columns;
        end else if (!due) begin
            left <= left - 33'd1;
            due <= left == 33'd1;
        end

        if (start || scanning) begin
            scanning <= 1'b1;
            phase <= phase + 16'd1;
            if (phase == LAST_PHASE[15:0]) begin
                phase <= 16'd0;
                read_row <= read_row + 16'd1;
                if (read_row == LAST_ROW[15:0]) begin
                    scanning <= 1'b0;
                    read_row <= 16'd0;
                    read_address <= {ADDRESS_BITS{1'b0}};
                end
            end
        end
        compute <= read;
        if (read) begin
            read_address <= read_address + {{ADDRESS_BITS - 1{1'b0}}, 1'b1};
            address <= read_address;
            row <= read_row;
            tile <= phase;
            ramp <= read_row[7:0] + base[7:0] + frame_now[7:0];
            parity <= read_row[0] ^ frame_now[0];
            row_live <= row_inside;
            live <= !row_inside ? {LANES{1'b0}}
                : window(base, columns_now[15:0], columns_now[31:16])
                & (phase == LAST_TILE[15:0] ? {LANES{1'b1}} >> PADS : {LANES{1'b1}});
        end
        if (reset) begin
            due <= 1'b1;
            scanning <= 1'b0;
            compute <= 1'b0;
            phase <= 16'd0;
            read_row <= 16'd0;
            read_address <= {ADDRESS_BITS{1'b0}};
        end
    end

    assign last_tile = tile == LAST_TILE[15:0];
endmodule
