// The display sink: a queue of words that the bus fills, and planes of pixels that are shown with
// the timing of the sensor's tiles, whatever its window is.
`include "viform_registers.vh"
module viform_sink #(
    parameter [31:0] LANES = 32,
    parameter [31:0] SINK_WORDS = 1024
) (
    input wire clk,
    input wire reset,
    input wire write,
    input wire read,
    input wire [5:0] offset,
    input wire [31:0] wdata,
    output reg [31:0] rdata,
    input wire start,
    input wire scanning,
    input wire scan_read,
    input wire compute,
    input wire tile_last,
    output reg valid,
    output reg [LANES-1:0] bits
);
    `include "viform_crc32.vh"

    localparam [31:0] BANKS = LANES / 32; // so many words are taken in a clock
    localparam [31:0] INDEX_BITS = $clog2(SINK_WORDS);
    localparam [31:0] BANK_BITS = INDEX_BITS + 1 - BANKS;
    localparam [INDEX_BITS:0] SIZE = SINK_WORDS[INDEX_BITS:0];
    localparam [INDEX_BITS:0] ONE = {{INDEX_BITS{1'b0}}, 1'b1};

    reg [31:0] planes, rows, crc, underruns, lost;
    reg showing, underrun, overflow, taken;
    reg [INDEX_BITS:0] level;
    reg [INDEX_BITS-1:0] put, get;
    reg [1:0] have;

    wire show = start ? planes != 32'd0 : showing && scanning;
    wire take = scan_read && show;
    wire clear = reset || write && offset == `VIFORM_SINK_CLEAR && wdata[0];
    wire push = write && offset == `VIFORM_SINK_DATA;
    wire room = level != SIZE;
    wire [1:0] due = BANKS[1:0];
    wire [1:0] found = level >= {{INDEX_BITS - 1{1'b0}}, due} ? due : level[1:0];
    wire [LANES-1:0] words; // those that are due, first at the bottom

    generate
        if (BANKS == 1) begin : one_bank
            viform_ram #(.DEPTH(SINK_WORDS), .WIDTH(32), .ADDRESS_BITS(BANK_BITS)) memory (
                .clk(clk), .write(push && room), .write_address(put), .write_data(wdata),
                .read(take), .read_address(get), .read_data(words)
            );
        end else begin : two_banks
            // Words 2 i and 2 i + 1; `get` may be odd after an underrun.
            wire [31:0] even_word, odd_word;
            reg swap;
            wire [BANK_BITS-1:0] even_address =
                get[INDEX_BITS-1:1] + {{BANK_BITS - 1{1'b0}}, get[0]};
            viform_ram #(.DEPTH(SINK_WORDS / 2), .WIDTH(32), .ADDRESS_BITS(BANK_BITS)) even (
                .clk(clk), .write(push && room && !put[0]), .write_address(put[INDEX_BITS-1:1]),
                .write_data(wdata), .read(take), .read_address(even_address),
                .read_data(even_word)
            );
            viform_ram #(.DEPTH(SINK_WORDS / 2), .WIDTH(32), .ADDRESS_BITS(BANK_BITS)) odd (
                .clk(clk), .write(push && room && put[0]), .write_address(put[INDEX_BITS-1:1]),
                .write_data(wdata), .read(take), .read_address(get[INDEX_BITS-1:1]),
                .read_data(odd_word)
            );
            always @(posedge clk) if (take) swap <= get[0];
            assign words = swap ? {even_word, odd_word} : {odd_word, even_word};
        end
    endgenerate

    // Words that had not come are dark.
    wire [LANES-1:0] shown;
    assign shown[31:0] = have != 2'd0 ? words[31:0] : 32'd0;
    generate
        if (BANKS == 2) begin : second_word
            assign shown[LANES-1:32] = have == 2'd2 ? words[LANES-1:32] : {LANES - 32{1'b0}};
        end
    endgenerate

    always @(posedge clk) begin
        if (start) begin
            showing <= planes != 32'd0;
            if (planes != 32'd0) planes <= planes - 32'd1;
        end else if (!scanning) showing <= 1'b0;
        if (write && offset == `VIFORM_SINK_RUN) planes <= wdata;

        if (push && room) put <= put + ONE[INDEX_BITS-1:0];
        if (push && !room) begin
            lost <= lost + 32'd1;
            overflow <= 1'b1;
        end
        if (take) begin
            get <= get + {{INDEX_BITS - 2{1'b0}}, found};
            have <= found;
        end
        level <= level + (push && room ? ONE : {INDEX_BITS + 1{1'b0}})
            - (take ? {{INDEX_BITS - 1{1'b0}}, found} : {INDEX_BITS + 1{1'b0}});

        taken <= take;
        valid <= taken && compute;
        if (taken) begin
            bits <= shown;
            crc <= BANKS == 1 ? crc32_word(crc, shown[31:0])
                : crc32_word(crc32_word(crc, shown[31:0]), shown[LANES-1:LANES-32]);
            if (have != due) begin
                underruns <= underruns + {30'd0, due - have};
                underrun <= 1'b1;
            end
        end
        if (valid && tile_last) rows <= rows + 32'd1;
        if (clear) begin
            put <= {INDEX_BITS{1'b0}};
            get <= {INDEX_BITS{1'b0}};
            level <= {INDEX_BITS + 1{1'b0}};
            have <= 2'd0;
            rows <= 32'd0;
            crc <= 32'hFFFFFFFF;
            underruns <= 32'd0;
            lost <= 32'd0;
            underrun <= 1'b0;
            overflow <= 1'b0;
        end
        if (reset) begin
            planes <= 32'd0;
            showing <= 1'b0;
            taken <= 1'b0;
            valid <= 1'b0;
        end
    end

    always @(posedge clk) if (read) case (offset)
        `VIFORM_SINK_STATE: rdata <= {29'd0, overflow, underrun, planes != 32'd0 || showing};
        `VIFORM_SINK_LEVEL: rdata <= {{31 - INDEX_BITS{1'b0}}, level};
        `VIFORM_SINK_ROWS: rdata <= rows;
        `VIFORM_SINK_CRC: rdata <= ~crc;
        `VIFORM_SINK_UNDERRUNS: rdata <= underruns;
        `VIFORM_SINK_LOST: rdata <= lost;
        `VIFORM_SINK_SIZE: rdata <= SINK_WORDS;
        default: rdata <= 32'd0;
    endcase
endmodule
