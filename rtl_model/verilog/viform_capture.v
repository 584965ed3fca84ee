// Burst capture and its drain: rows of the armed frames become records in a memory, which the bus
// reads as a queue whose reading end may be set back.
`include "viform_registers.vh"
module viform_capture #(
    parameter [31:0] LANES = 32,
    parameter [31:0] TILES = 1,
    parameter [31:0] ROW_WORDS = 1,
    parameter [31:0] CAPTURE_WORDS = 4096
) (
    input wire clk,
    input wire reset,
    input wire write,
    input wire read,
    input wire memory_read,  // of a word by its index
    input wire [$clog2(CAPTURE_WORDS)-1:0] memory_index,
    input wire [5:0] offset,
    input wire [31:0] wdata,
    output wire [31:0] rdata,
    input wire start,
    input wire scanning,
    input wire [19:0] frame,
    input wire [11:0] row,
    input wire [15:0] tile,
    input wire tile_valid,
    input wire [LANES-1:0] tile_bits,
    input wire sink_valid,
    input wire [LANES-1:0] sink_bits
);
    `include "viform_crc32.vh"

    localparam [31:0] BANKS = LANES / 32;
    localparam [31:0] INDEX_BITS = $clog2(CAPTURE_WORDS);
    localparam [31:0] TILE_BITS = TILES > 1 ? $clog2(TILES) : 1;
    localparam [31:0] LAST_PLACE = ROW_WORDS + 2;
    localparam [31:0] LAST_START = CAPTURE_WORDS - (ROW_WORDS + 3); // where a record still fits
    localparam FITS = CAPTURE_WORDS >= ROW_WORDS + 3;
    localparam [INDEX_BITS:0] ONE = {{INDEX_BITS{1'b0}}, 1'b1};
    localparam [INDEX_BITS:0] NONE = {INDEX_BITS + 1{1'b0}};

    reg source, chosen, armed, busy, done, overflow;
    reg [31:0] frames, rows, lost, number;
    reg [INDEX_BITS:0] pointer, stop;

    // The row that is due: its bits stand in a buffer until the record's head is written.
    reg storing;
    reg [15:0] place;
    reg [31:0] crc;
    wire valid = busy && (chosen ? sink_valid : tile_valid);
    wire [LANES-1:0] buffered;
    reg [TILE_BITS-1:0] next_tile;
    viform_ram #(.DEPTH(TILES), .WIDTH(LANES), .ADDRESS_BITS(TILE_BITS)) row_buffer (
        .clk(clk), .write(valid), .write_address(tile[TILE_BITS-1:0]),
        .write_data(chosen ? sink_bits : tile_bits), .read(storing),
        .read_address(next_tile), .read_data(buffered)
    );
    wire [31:0] row_word;
    generate
        if (BANKS == 1) begin : one_word
            assign row_word = buffered;
        end else begin : two_words
            // Word j is looked up at place j + 1 and stored at place j + 2.
            assign row_word = place[0] ? buffered[LANES-1:32] : buffered[31:0];
        end
    endgenerate
    wire [31:0] word = place == 16'd0 ? number : place == 16'd1 ? {frame, row}
        : place == LAST_PLACE[15:0] ? ~crc : row_word;

    wire arm = write && offset == `VIFORM_CAPTURE_ARM;
    wire take = read && offset == `VIFORM_CAPTURE_DATA;
    wire room = FITS && stop <= LAST_START[INDEX_BITS:0];
    wire more = pointer != stop;

    reg from_memory;
    reg [31:0] register;
    wire [31:0] stored;
    viform_ram #(.DEPTH(CAPTURE_WORDS), .WIDTH(32), .ADDRESS_BITS(INDEX_BITS)) memory (
        .clk(clk), .write(storing), .write_address(stop[INDEX_BITS-1:0]), .write_data(word),
        .read(take || memory_read),
        .read_address(memory_read ? memory_index : pointer[INDEX_BITS-1:0]), .read_data(stored)
    );
    assign rdata = from_memory ? stored : register;

    always @(posedge clk) begin
        if (storing) begin
            stop <= stop + ONE;
            place <= place + 16'd1;
            if (place != 16'd0 && (BANKS == 1 || !place[0])) next_tile <= next_tile + 1'b1;
            crc <= crc32_word(crc, word);
            if (place == LAST_PLACE[15:0]) begin
                storing <= 1'b0;
                rows <= rows + 32'd1;
                number <= number + 32'd1;
            end
        end
        if (valid && tile == 16'd0) begin
            if (room) begin
                storing <= 1'b1;
                place <= 16'd0;
                next_tile <= {TILE_BITS{1'b0}};
                crc <= 32'hFFFFFFFF;
            end else begin
                lost <= lost + 32'd1;
                number <= number + 32'd1;
                overflow <= 1'b1;
            end
        end
        if (start && armed) begin
            armed <= 1'b0;
            busy <= 1'b1;
            chosen <= source;
        end
        if (start && (armed || busy)) frames <= frames - 32'd1;
        else if (busy && frames == 32'd0 && !scanning && !storing) begin
            busy <= 1'b0;
            done <= 1'b1;
        end
        if (take && more) pointer <= pointer + ONE;
        if (write && offset == `VIFORM_CAPTURE_POINTER)
            pointer <= wdata > {{31 - INDEX_BITS{1'b0}}, stop} ? stop : wdata[INDEX_BITS:0];
        if (write && offset == `VIFORM_CAPTURE_SOURCE) source <= wdata[0];
        if (arm) frames <= wdata;
        if (arm || reset) begin
            armed <= !reset && wdata != 32'd0;
            busy <= 1'b0;
            done <= !reset && wdata == 32'd0;
            overflow <= 1'b0;
            storing <= 1'b0;
            pointer <= NONE;
            stop <= NONE;
            rows <= 32'd0;
            lost <= 32'd0;
            number <= 32'd0;
        end
        if (reset) source <= `VIFORM_CAPTURE_SOURCE_RESET;
    end

    wire [INDEX_BITS:0] level = stop - pointer;
    always @(posedge clk) if (memory_read) begin
        from_memory <= {1'b0, memory_index} < stop;
        register <= 32'd0;
    end else if (read) begin
        from_memory <= take && more;
        case (offset)
            `VIFORM_CAPTURE_SOURCE: register <= {31'd0, source};
            `VIFORM_CAPTURE_STATE: register <= {28'd0, overflow, done, busy, armed};
            `VIFORM_CAPTURE_LEVEL: register <= {{31 - INDEX_BITS{1'b0}}, level};
            `VIFORM_CAPTURE_POINTER: register <= {{31 - INDEX_BITS{1'b0}}, pointer};
            `VIFORM_CAPTURE_ROWS: register <= rows;
            `VIFORM_CAPTURE_LOST: register <= lost;
            `VIFORM_CAPTURE_SIZE: register <= CAPTURE_WORDS;
            default: register <= 32'd0;
        endcase
    end
endmodule
