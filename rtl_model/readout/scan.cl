// Converts pixel-major words (32 cycles of a pixel) to the chip's raw blocks (500 pixels of a cycle
// and a marker). A work-item computes one block for 32 cycles. It transposes the 32 x 32 bits of all
// 16 words of the block at once in registers; lane k is word k. Memory is accessed in units of 64
// bytes, and its speed is the limit. To gather the words lane by lane took twice the time.
//
// words: (n, 1000, 1000). places, markers: of each block, in the order of the scan. open: bits of a
// block that may be set, for each half. raw: (cycles, blocks) of 64 bytes.

#define SWAP(a, b, by, mask)                                                                       \
    {                                                                                              \
        const uint16 t = ((v[a] >> (uint)(by)) ^ v[b]) & (uint)(mask);                             \
        v[b] ^= t;                                                                                 \
        v[a] ^= t << (uint)(by);                                                                   \
    }

#define STAGE(by, mask)                                                                            \
    _Pragma("unroll") for (uint n = 0; n < 32; n++) if (!(n & (by))) SWAP(n, n + (by), by, mask)

// Transposes two squares of 16 x 16 words by four rounds. A round moves the first bit of a word's row
// index to the end of its column index, and that of its column index to the end of its row index.
#define ZIP(from, to)                                                                              \
    _Pragma("unroll") for (uint n = 0; n < 16; n++)                                                \
    {                                                                                              \
        const uint16 a = from[n + (n & 8)], b = from[n + (n & 8) + 8];                             \
        to[2 * n] = (uint16)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3, a.s4, b.s4, a.s5,     \
                             b.s5, a.s6, b.s6, a.s7, b.s7);                                        \
        to[2 * n + 1] = (uint16)(a.s8, b.s8, a.s9, b.s9, a.sa, b.sa, a.sb, b.sb, a.sc, b.sc, a.sd, \
                                 b.sd, a.se, b.se, a.sf, b.sf);                                    \
    }

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
    const uint4 none = 0;
    uint16 v[32], w[32];
#pragma unroll
    for (uint k = 0; k < 16; k++) {
        v[k] = vload16(0, s + 32 * k);
        v[16 + k] = k < 15 ? vload16(0, s + 32 * k + 16) : (uint16)(vload4(0, s + 496), none, none, none);
    }
    ZIP(v, w)
    ZIP(w, v)
    ZIP(v, w)
    ZIP(w, v)
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
