// First spikes of a pixel array as packets of the stream code `event`, on an AXI-Stream. The
// spikes of a tile are served one at a time, the lowest column first: the pixel's memory says when
// it fired last and after what width, and a spike whose width is the same is not sent. After a
// group of cycles all pixels are looked at once more, for closing spikes.
module viform_event_encoder #(
    parameter [31:0] ROWS = 32,    // 1 to 128
    parameter [31:0] COLUMNS = 32, // 1 to 128
    parameter [31:0] LANES = 32,   // 32 or 64
    parameter [31:0] CYCLES = 128, // of a packet: 32, 64 or 128
    parameter [31:0] DEPTH = 256,  // of the queue: a power of two, at least 4 (tiles of a row) + 8
    parameter [31:0] CODE = 4,
    parameter [31:0] TILE = 0      // number of this array in the packets
) (
    input wire clk,
    input wire reset,
    input wire tile_valid, // a row's tiles follow one another, then a clock or more without one
    input wire [31:0] tile_frame,
    input wire [15:0] tile_row,
    input wire [15:0] tile_index,
    input wire [LANES-1:0] tile_bits,
    output reg m_tvalid,
    input wire m_tready,
    output reg [15:0] m_tdata,
    output reg m_tlast,
    output wire [31:0] lost_rows,
    output wire [31:0] lost_spikes
);
    `include "viform_crc32c.vh"

    localparam [31:0] TILES = (COLUMNS + LANES - 1) / LANES;
    localparam [31:0] SHIFT = $clog2(LANES);
    localparam [31:0] WIDTH = 18 + LANES;
    localparam [31:0] ROW_BITS = ROWS > 1 ? $clog2(ROWS) : 1;
    localparam [31:0] COLUMN_BITS = $clog2(TILES * LANES);
    localparam [31:0] ADDRESS_BITS = ROW_BITS + COLUMN_BITS;
    localparam [31:0] GROUP = $clog2(CYCLES);
    localparam [31:0] LAST_CYCLE = CYCLES - 1;
    localparam [31:0] LAST_ROW = ROWS - 1;
    localparam [31:0] LAST_COLUMN = COLUMNS - 1;
    localparam [2:0] CLEAN = 3'd0, RUN = 3'd1, HEAD = 3'd2, SWEEP = 3'd3, TAIL = 3'd4;

    wire entry_valid, take;
    wire [WIDTH-1:0] entry;
    viform_event_queue #(
        .LANES(LANES), .TILES(TILES), .CYCLES(CYCLES), .DEPTH(DEPTH), .WIDTH(WIDTH)
    ) queue (
        .clk(clk), .reset(reset), .tile_valid(tile_valid), .tile_frame(tile_frame),
        .tile_row(tile_row[6:0]), .tile_index(tile_index[1:0]), .tile_bits(tile_bits),
        .entry_valid(entry_valid), .entry(entry), .take(take),
        .lost_rows(lost_rows), .lost_spikes(lost_spikes)
    );
    wire unused = &{1'b0, tile_row[15:7], tile_index[15:2], read_row, read_column, 1'b0};

    wire [1:0] kind = entry[LANES+17:LANES+16];
    wire [6:0] cycle = entry[LANES+15:LANES+9];
    wire [6:0] row = entry[LANES+8:LANES+2];
    wire [1:0] index = entry[LANES+1:LANES];
    wire is_tile = entry_valid && kind == 2'd0;
    wire is_gap = entry_valid && kind == 2'd1;
    wire is_place = entry_valid && kind == 2'd2;

    reg [2:0] state, step;
    reg open, placed;      // a packet is open; it was opened for this place
    reg in_gap, gap_said;
    reg [31-GROUP:0] group;
    reg [31:0] crc;

    // The pixel whose memory is read at this clock: of a tile, or of all of them in turn.
    reg [LANES-1:0] served;
    reg [6:0] sweep_row, sweep_column;
    reg swept;
    wire [LANES-1:0] left = entry[LANES-1:0] & ~served;
    wire [LANES-1:0] lowest = left & (~left + {{LANES - 1{1'b0}}, 1'b1});
    function [SHIFT-1:0] place_of;
        input [LANES-1:0] one;
        integer i;
        begin
            place_of = {SHIFT{1'b0}};
            for (i = 0; i < LANES; i = i + 1)
                if (one[i]) place_of = place_of | i[SHIFT-1:0];
        end
    endfunction
    wire sweeps = state == SWEEP || state == CLEAN;
    wire [6:0] tile_column = {5'd0, index} << SHIFT | {{7 - SHIFT{1'b0}}, place_of(lowest)};
    wire [6:0] read_row = sweeps ? sweep_row : row;
    wire [6:0] read_column = sweeps ? sweep_column : tile_column;
    wire [ADDRESS_BITS-1:0] read_address = {read_row[ROW_BITS-1:0], read_column[COLUMN_BITS-1:0]};

    // A clock later: the pixel's last first spike decides.
    reg due, due_sweep;
    reg [6:0] due_cycle, due_row, due_column;
    reg [ADDRESS_BITS-1:0] due_address;
    wire [14:0] held; // fired in this packet, cycle of the last spike, its width minus 1
    reg said, said_sweep;
    reg [6:0] said_cycle, said_row;

    wire [6:0] since = due_cycle - held[13:7];
    wire [6:0] width = !held[14] ? due_cycle : due_sweep ? since : since - 7'd1;
    wire send = state != CLEAN
        && (due_sweep ? held[14] && held[6:0] < width : !held[14] || held[6:0] != width);
    wire row_said = said && said_sweep == due_sweep && said_cycle == due_cycle
        && said_row == due_row;
    wire m_free = !m_tvalid || m_tready;
    wire decided = due && (!send || row_said && m_free);

    // A pixel is not read while it is written: the next tile waits until the last one is decided.
    wire serve = state == RUN && is_tile
        && (!due || decided && served != {LANES{1'b0}});
    wire look = sweeps && !swept && (!due || decided);
    wire read = serve || look;

    viform_ram #(.DEPTH(1 << ADDRESS_BITS), .WIDTH(15), .ADDRESS_BITS(ADDRESS_BITS)) pixels (
        .clk(clk), .write(decided), .write_address(due_address),
        .write_data(due_sweep ? 15'd0 : {1'b1, due_cycle, width}),
        .read(read), .read_address(read_address), .read_data(held)
    );

    // Gaps and places, once the tiles before are through.
    wire rest = state == RUN && !due;
    wire here = entry[31:GROUP] == group && !index[0] || placed;
    wire start = cycle == 7'd0 && row == 7'd0;
    wire close_packet = rest && is_place && open && !here;
    wire open_packet = rest && is_place && !open;
    wire resume = rest && is_place && open && here && in_gap && !(start && !gap_said);
    wire say_gap = rest && (is_gap && !index[0] || resume);
    wire [15:0] gap_word = resume && !gap_said ? 16'h4000 : {2'b01, cycle, row};
    wire done_gap = rest && is_gap && (index[0] || m_free);
    wire done_place = rest && is_place && open && here && (!resume || gap_said && m_free);
    assign take = serve && left == lowest || done_gap || done_place;

    wire [31:0] first_word = {{GROUP{1'b0}}, group} << (GROUP - 5);
    reg [15:0] head;
    always @* case (step)
        3'd0: head = CODE[15:0];
        3'd1: head = CYCLES[15:0];
        3'd2: head = TILE[15:0];
        3'd3: head = TILE[31:16];
        3'd4: head = first_word[15:0];
        default: head = first_word[31:16];
    endcase

    wire body = due && send || say_gap || state == HEAD;
    wire [15:0] word = state == TAIL ? step[0] ? ~crc[31:16] : ~crc[15:0]
        : state == HEAD ? head
        : say_gap ? gap_word
        : row_said ? {1'b1, due_sweep, width, due_column}
        : {2'b00, due_cycle, due_row};
    wire put = (body || state == TAIL) && m_free;

    always @(posedge clk) begin
        if (m_free) begin
            m_tvalid <= put;
            m_tlast <= state == TAIL && step[0];
            if (put) m_tdata <= word;
        end
        if (put && body) crc <= crc32c_half(crc, word);

        if (decided) due <= 1'b0;
        if (read) begin
            due <= 1'b1;
            due_sweep <= sweeps;
            due_cycle <= sweeps ? LAST_CYCLE[6:0] : cycle;
            due_row <= read_row;
            due_column <= read_column;
            due_address <= read_address;
        end
        if (due && send && !row_said && m_free) begin
            said <= 1'b1;
            said_sweep <= due_sweep;
            said_cycle <= due_cycle;
            said_row <= due_row;
        end
        if (serve) served <= left == lowest ? {LANES{1'b0}} : served | lowest;
        if (look) begin
            sweep_column <= sweep_column + 7'd1;
            if (sweep_column == LAST_COLUMN[6:0]) begin
                sweep_column <= 7'd0;
                sweep_row <= sweep_row + 7'd1;
                if (sweep_row == LAST_ROW[6:0]) begin
                    sweep_row <= 7'd0;
                    swept <= 1'b1;
                end
            end
        end

        case (state)
            CLEAN, SWEEP: if (swept && !due) begin
                state <= state == CLEAN ? RUN : TAIL;
                step <= 3'd0;
                swept <= 1'b0;
            end
            HEAD: if (m_free) begin
                step <= step + 3'd1;
                if (step == 3'd5) state <= RUN;
            end
            TAIL: if (m_free) begin
                step <= step + 3'd1;
                if (step[0]) begin
                    state <= RUN;
                    open <= 1'b0;
                end
            end
            default: begin
                if (close_packet) state <= SWEEP;
                if (open_packet) begin
                    state <= HEAD;
                    step <= 3'd0;
                    open <= 1'b1;
                    placed <= 1'b1;
                    gap_said <= 1'b0;
                    said <= 1'b0;
                    group <= entry[31:GROUP];
                    crc <= 32'hFFFFFFFF;
                end
                if (done_gap) in_gap <= 1'b1;
                if (say_gap && m_free) gap_said <= 1'b1;
                if (done_gap && index[0]) gap_said <= 1'b0;
                if (done_place) begin
                    placed <= 1'b0;
                    in_gap <= 1'b0;
                end
            end
        endcase
        if (reset) begin
            state <= CLEAN;
            step <= 3'd0;
            open <= 1'b0;
            placed <= 1'b0;
            in_gap <= 1'b1;
            gap_said <= 1'b0;
            served <= {LANES{1'b0}};
            sweep_row <= 7'd0;
            sweep_column <= 7'd0;
            swept <= 1'b0;
            due <= 1'b0;
            m_tvalid <= 1'b0;
            m_tlast <= 1'b0;
        end
    end
endmodule
