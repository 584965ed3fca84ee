// Pixel-major words (32 cycles of a pixel) to the chip's raw blocks (500 pixels of a cycle and a
// marker). A work-item makes one block of 32 cycles: a 32 x 32 transposition of bits for each of the
// block's 16 words at once, in registers, lane k being word k. Whole cache lines are written.
//
// words: (n, 1000, 1000). places, markers: of each block, in the order of the scan. open: bits of a
// block that may be set, by half. raw: (cycles, blocks) of 64 bytes.

#define SWAP(a, b, by, mask)                                                                       \
    {                                                                                              \
        const uint16 t = ((v[a] >> (uint)(by)) ^ v[b]) & (uint)(mask);                             \
        v[b] ^= t;                                                                                 \
        v[a] ^= t << (uint)(by);                                                                   \
    }

#define STAGE(by, mask)                                                                            \
    _Pragma("unroll") for (uint n = 0; n < 32; n++) if (!(n & (by))) SWAP(n, n + (by), by, mask)

__kernel __attribute__((reqd_work_group_size(LOCAL, 1, 1))) void scan(
    __global const uint *restrict words, __global const uint *restrict places,
    __global const ushort *restrict markers, __global const uint16 *restrict open,
    __global uint *restrict raw, const uint blocks, const uint cycles)
{
    const uint block = get_global_id(0), word = get_global_id(1);
    if (block >= blocks)
        return;
    const uint place = places[block];
    __global const uint *s = words + (size_t)word * 1000000 + place * 500;
    uint16 v[32];
#pragma unroll
    for (uint i = 0; i < 32; i++)
        v[i] = (uint16)(s[i], s[i + 32], s[i + 64], s[i + 96], s[i + 128], s[i + 160], s[i + 192],
                        s[i + 224], s[i + 256], s[i + 288], s[i + 320], s[i + 352], s[i + 384],
                        s[i + 416], s[i + 448], i < 20 ? s[i + 480] : 0);
    STAGE(16, 0x0000ffff)
    STAGE(8, 0x00ff00ff)
    STAGE(4, 0x0f0f0f0f)
    STAGE(2, 0x33333333)
    STAGE(1, 0x55555555)
    const uint16 mask = open[place & 1];
    uint16 marker = 0;
    marker.sf = (uint)markers[block] << 16;
    const uint first = word * 32, count = min(32u, cycles - first);
    __global uint *line = raw + ((size_t)first * blocks + block) * 16;
    if (count == 32) {
#pragma unroll
        for (uint n = 0; n < 32; n++)
            vstore16((v[n] & mask) | marker, (size_t)n * blocks, line);
    } else {
#pragma unroll
        for (uint n = 0; n < 32; n++)
            if (n < count)
                vstore16((v[n] & mask) | marker, (size_t)n * blocks, line);
    }
}
