// CRC-32C (Castagnoli), as iSCSI has it, over 16 bits whose least significant byte comes first.
// `crc` is the register itself: all ones at the start, and the CRC is its complement.
function [31:0] crc32c_half;
    input [31:0] crc;
    input [15:0] half;
    integer bit_index;
    begin
        crc32c_half = crc ^ {16'd0, half};
        for (bit_index = 0; bit_index < 16; bit_index = bit_index + 1)
            crc32c_half = {1'b0, crc32c_half[31:1]} ^ (crc32c_half[0] ? 32'h82F63B78 : 32'h0);
    end
endfunction
