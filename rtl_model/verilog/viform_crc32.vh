// CRC-32 as zlib has it, over a 32-bit word whose most significant byte comes first. `crc` is the
// register itself: all ones at the start, and the CRC is its complement.
function [31:0] crc32_word;
    input [31:0] crc;
    input [31:0] word;
    integer bit_index;
    begin
        crc32_word = crc ^ {word[7:0], word[15:8], word[23:16], word[31:24]};
        for (bit_index = 0; bit_index < 32; bit_index = bit_index + 1)
            crc32_word = {1'b0, crc32_word[31:1]} ^ (crc32_word[0] ? 32'hEDB88320 : 32'h0);
    end
endfunction
