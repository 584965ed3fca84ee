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
    output wire row_live,
    output wire [LANES-1:0] live,
    // Of the frame.
    output reg [31:0] frame,
    output reg fresh,
    output reg double
);
    localparam SHIFT = $clog2(LANES);
    localparam [31:0] LAST_ROW = ROWS - 1;
    localparam [31:0] LAST_COLUMN = COLUMNS - 1;
    localparam [31:0] LAST_TILE = TILES - 1;
    localparam [31:0] LAST_PHASE = ROW_CLOCKS - 1;
    localparam [31:0] LAST_LANE = LANES - 1;

    reg [15:0] phase;
    reg [15:0] read_row;
    reg [15:0] row_first, row_last, column_first, column_last;
    reg [32:0] left;

    wire [31:0] tick = tick_clocks < TICK_MINIMUM ? TICK_MINIMUM : tick_clocks;
    wire [32:0] period = clock_select ? {tick, 1'b0} : {1'b0, tick};

    assign start = run && left == 33'd0 && !reset;
    assign read = (start || scanning) && phase < TILES[15:0];

    always @(posedge clk) begin
        if (start) begin
            left <= period - 33'd1;
            frame <= clear ? 32'd0 : frames;
            fresh <= clear;
            double <= clock_select;
            row_first <= rows[15:0];
            row_last <= rows[31:16];
            column_first <= columns[15:0];
            column_last <= columns[31:16] > LAST_COLUMN[15:0] ? LAST_COLUMN[15:0] : columns[31:16];
        end else if (left != 33'd0) left <= left - 33'd1;

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
        end
        if (reset) begin
            left <= 33'd0;
            scanning <= 1'b0;
            compute <= 1'b0;
            phase <= 16'd0;
            read_row <= 16'd0;
            read_address <= {ADDRESS_BITS{1'b0}};
        end
    end

    // The window, as a mask over the tile's lanes. Pads right of the last column are outside.
    wire [15:0] base = tile << SHIFT;
    wire [15:0] from = column_first - base;
    wire [15:0] to = column_last - base;
    wire [LANES-1:0] all = {LANES{1'b1}};
    wire [LANES-1:0] not_before = column_first <= base ? all :
        from > LAST_LANE[15:0] ? {LANES{1'b0}} : all << from[SHIFT-1:0];
    wire [LANES-1:0] not_after = column_last < base ? {LANES{1'b0}} :
        to >= LAST_LANE[15:0] ? all : ~((all << 1) << to[SHIFT-1:0]);

    assign last_tile = tile == LAST_TILE[15:0];
    assign row_live = row >= row_first && row <= row_last;
    assign live = row_live ? not_before & not_after : {LANES{1'b0}};
endmodule
