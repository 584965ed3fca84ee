// Packets of the stream code `event` back to spikes. A packet becomes the data of the code `raw`:
// 32-bit words of the first 32 cycles of all pixels, then of the next. It comes out when its
// checksum has been seen: a damaged one is counted and gives nothing.
module viform_event_decoder #(
    parameter [31:0] ROWS = 32,    // 1 to 128
    parameter [31:0] COLUMNS = 32, // 1 to 128
    parameter [31:0] CYCLES = 128, // of a packet: 32, 64 or 128
    parameter [31:0] CODE = 4
) (
    input wire clk,
    input wire reset,
    input wire s_tvalid,
    output wire s_tready,
    input wire [15:0] s_tdata,
    input wire s_tlast,
    output reg m_tvalid,
    input wire m_tready,
    output reg [31:0] m_tdata,
    output reg m_tlast,
    output reg m_tuser,        // the packet has gaps
    output reg [31:0] m_first, // of the packet: its first cycle / 32, and its tile
    output reg [31:0] m_tile,
    output wire gap_valid,     // a place of a gap, before the packet comes out
    output wire [13:0] gap_place,
    output reg [31:0] packets,
    output reg [31:0] damaged
);
    `include "viform_crc32c.vh"

    localparam [31:0] ROW_BITS = ROWS > 1 ? $clog2(ROWS) : 1;
    localparam [31:0] COLUMN_BITS = COLUMNS > 1 ? $clog2(COLUMNS) : 1;
    localparam [31:0] PIXEL_BITS = ROW_BITS + COLUMN_BITS;
    localparam [31:0] WORD_BITS = CYCLES > 32 ? $clog2(CYCLES / 32) : 1;
    localparam [31:0] ADDRESS_BITS = WORD_BITS + PIXEL_BITS;
    localparam [31:0] LAST_CYCLE = CYCLES - 1;
    localparam [31:0] LAST_WORD = CYCLES / 32 - 1;
    localparam [31:0] LAST_ROW = ROWS - 1;
    localparam [31:0] LAST_COLUMN = COLUMNS - 1;
    localparam [2:0] TAKE = 3'd0, LOOK = 3'd1, FILL = 3'd2, LOAD = 3'd3, NEXT = 3'd4, FLUSH = 3'd5,
        EMIT = 3'd6;

    reg [2:0] state;

    // The last two words of a packet are its checksum, so a word is looked at when two have come
    // after it.
    reg [15:0] newest, newer, item;
    reg [1:0] held_words;
    reg item_valid, ended;
    reg [31:0] sum, crc;
    reg [2:0] head;  // words of the head so far
    reg bad, gaps, known_row, counted;
    reg [31:0] tile, first;
    assign s_tready = state == TAKE && !item_valid && !ended;
    wire accept = s_tvalid && s_tready;

    reg [6:0] cycle, row;
    wire is_body = state == TAKE && item_valid && head == 3'd6;
    wire is_event = is_body && item[15];
    wire place_fits = {1'b0, item[13:7]} < CYCLES[7:0] && {1'b0, item[6:0]} < ROWS[7:0];
    wire event_fits = known_row && {1'b0, item[6:0]} < COLUMNS[7:0];
    assign gap_valid = is_body && item[15:14] == 2'b01;
    assign gap_place = item[13:0];
    reg expected;
    always @* case (head)
        3'd0: expected = item == CODE[15:0];
        3'd1: expected = item == CYCLES[15:0];
        default: expected = 1'b1;
    endcase

    // The pixel whose last event is read: that of an event, or each in turn at the packet's end.
    reg finish;
    reg [1:0] word;
    reg [6:0] scan_row, scan_column;
    wire last_pixel = scan_row == LAST_ROW[6:0] && scan_column == LAST_COLUMN[6:0];
    wire [6:0] at_row = finish ? scan_row : row;
    wire [6:0] at_column = finish ? scan_column : item[6:0];
    wire [PIXEL_BITS-1:0] pixel = {at_row[ROW_BITS-1:0], at_column[COLUMN_BITS-1:0]};
    wire unused = &{1'b0, at_row, at_column, word, target[6], 1'b0};
    wire [15:0] last; // fired in this packet, closed, cycle of the last event, its width minus 1
    wire closing = item[14];
    wire [6:0] width = item[13:7];
    wire read_last = is_event && event_fits || state == NEXT;
    viform_ram #(.DEPTH(1 << PIXEL_BITS), .WIDTH(16), .ADDRESS_BITS(PIXEL_BITS)) pixels (
        .clk(clk), .write(state == LOOK), .write_address(pixel),
        .write_data(finish ? 16'd0 : {1'b1, closing, closing ? 7'd0 : cycle, width}),
        .read(read_last), .read_address(pixel), .read_data(last)
    );
    // Repetitions up to where the event's interval began, or up to the end.
    wire [7:0] begins = last[13:7] + {1'b0, last[6:0]} + 8'd1;
    wire [6:0] limit = finish ? LAST_CYCLE[6:0]
        : closing ? LAST_CYCLE[6:0] - width : cycle - width - 7'd1;
    wire repeats = last[15] && !last[14] && begins <= {1'b0, limit} && !bad;

    // The spikes of the pixel in 32 cycles, which are written back when others are asked for.
    reg [7:0] cursor, stop, stride;
    reg again, own; // repetitions are left; the event's own spike is left
    reg [31:0] bits;
    reg bits_valid;
    reg [ADDRESS_BITS-1:0] bits_address;
    wire [6:0] target = again ? cursor[6:0] : cycle;
    wire [WORD_BITS-1:0] target_word = target[5 + WORD_BITS - 1:5];
    wire [ADDRESS_BITS-1:0] target_address = {target_word, pixel};
    wire near = bits_valid && bits_address == target_address;
    wire [31:0] bit_of = 32'd1 << target[4:0];
    wire [7:0] next_cursor = cursor + stride;
    wire sets = state == FILL && near || state == LOAD;
    wire write_back = state == FILL && !near && bits_valid || state == FLUSH && bits_valid;

    reg pending, pending_last;
    reg [ADDRESS_BITS-1:0] pending_address;
    reg scanned;
    wire m_free = !m_tvalid || m_tready;
    wire sent = state == EMIT && pending && (m_free || bad);
    wire emit = state == EMIT && !scanned && (!pending || sent);
    wire [31:0] stored;
    viform_ram #(.DEPTH(1 << ADDRESS_BITS), .WIDTH(32), .ADDRESS_BITS(ADDRESS_BITS)) memory (
        .clk(clk), .write(write_back || sent),
        .write_address(sent ? pending_address : bits_address), .write_data(sent ? 32'd0 : bits),
        .read(state == FILL && !near || emit),
        .read_address(emit ? {word[WORD_BITS-1:0], pixel} : target_address), .read_data(stored)
    );

    // The event is done, or the pixel at the packet's end.
    wire ends = state == LOOK && !repeats && (finish || closing)
        || sets && (again ? next_cursor > stop && !own : 1'b1);
    wire step = ends && finish || emit;

    always @(posedge clk) begin
        if (accept) begin
            newest <= s_tdata;
            newer <= newest;
            item <= newer;
            item_valid <= held_words == 2'd2;
            if (held_words != 2'd2) held_words <= held_words + 2'd1;
            ended <= s_tlast;
            sum <= {s_tdata, newest};
        end
        if (sets) begin
            bits <= (state == LOAD ? stored : bits) | bit_of;
            bits_valid <= 1'b1;
            bits_address <= target_address;
            cursor <= next_cursor;
            if (again) again <= next_cursor <= stop;
            else own <= 1'b0;
        end
        if (step) begin
            scan_column <= scan_column + 7'd1;
            if (scan_column == LAST_COLUMN[6:0]) begin
                scan_column <= 7'd0;
                scan_row <= scan_row + 7'd1;
                if (last_pixel) scan_row <= 7'd0;
            end
        end
        if (emit) begin
            pending_address <= {word[WORD_BITS-1:0], pixel};
            pending_last <= last_pixel && word == LAST_WORD[1:0];
            if (last_pixel) begin
                word <= word + 2'd1;
                scanned <= word == LAST_WORD[1:0];
            end
        end
        if (emit || sent) pending <= emit;
        if (m_free) begin
            m_tvalid <= sent && !bad;
            if (sent) begin
                m_tdata <= stored;
                m_tlast <= pending_last;
                m_tuser <= gaps;
                m_first <= first;
                m_tile <= tile;
            end
        end

        case (state)
            TAKE: if (item_valid) begin
                item_valid <= 1'b0;
                crc <= crc32c_half(crc, item);
                if (head != 3'd6) begin
                    head <= head + 3'd1;
                    if (!expected) bad <= 1'b1;
                    if (head == 3'd2) tile[15:0] <= item;
                    if (head == 3'd3) tile[31:16] <= item;
                    if (head == 3'd4) first[15:0] <= item;
                    if (head == 3'd5) first[31:16] <= item;
                end else if (!item[15]) begin
                    known_row <= !item[14] && place_fits;
                    cycle <= item[13:7];
                    row <= item[6:0];
                    if (!place_fits) bad <= 1'b1;
                    if (item[14]) gaps <= 1'b1;
                end else if (event_fits) state <= LOOK;
                else bad <= 1'b1;
            end else if (ended) begin
                ended <= 1'b0;
                held_words <= 2'd0;
                if (head != 3'd6 || ~crc != sum) bad <= 1'b1;
                finish <= 1'b1;
                state <= NEXT;
            end
            LOOK: begin
                cursor <= begins;
                stride <= {1'b0, last[6:0]} + 8'd1;
                stop <= {1'b0, limit};
                again <= repeats;
                own <= !finish && !closing;
                if (!ends) state <= FILL;
            end
            FILL: if (!near) state <= LOAD;
            LOAD: state <= FILL;
            NEXT: state <= LOOK;
            FLUSH: begin
                bits_valid <= 1'b0;
                state <= EMIT;
            end
            default: if (scanned && (!pending || sent)) begin // EMIT
                state <= TAKE;
                if (bad) damaged <= damaged + {31'd0, counted};
                else packets <= packets + 32'd1;
                finish <= 1'b0;
                counted <= 1'b1;
                head <= 3'd0;
                crc <= 32'hFFFFFFFF;
                bad <= 1'b0;
                gaps <= 1'b0;
                known_row <= 1'b0;
                scanned <= 1'b0;
                word <= 2'd0;
            end
        endcase
        if (ends) state <= !finish ? TAKE : last_pixel ? FLUSH : NEXT;
        if (reset) begin
            state <= NEXT; // clears both memories
            finish <= 1'b1;
            bad <= 1'b1;
            counted <= 1'b0;
            held_words <= 2'd0;
            item_valid <= 1'b0;
            ended <= 1'b0;
            head <= 3'd0;
            bits_valid <= 1'b0;
            word <= 2'd0;
            scan_row <= 7'd0;
            scan_column <= 7'd0;
            scanned <= 1'b0;
            pending <= 1'b0;
            m_tvalid <= 1'b0;
            packets <= 32'd0;
            damaged <= 32'd0;
        end
    end
endmodule
