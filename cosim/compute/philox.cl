// Philox4x32-10 (Salmon et al., SC11, "Parallel random numbers: as easy as 1, 2, 3"), sixteen
// counters at a time. Integers only: the same words on every device and for every tiling.
//
// Counters are kept in 64-bit lanes, of which only the low half counts: the 32 x 32 -> 64 bit
// product is then one instruction a vector on processors, where mul_hi on uint16 costs 5 times more.
#define PHILOX_LOW 0xFFFFFFFFul

WIDE inline void philox16(ulong16 *c0, ulong16 *c1, ulong16 *c2, ulong16 *c3, uint k0, uint k1)
{
    ulong16 a = *c0, b = *c1, c = *c2, d = *c3;
#pragma unroll
    for (int round = 0; round < 10; round++) {
        const ulong16 p0 = (a & PHILOX_LOW) * 0xD2511F53ul;
        const ulong16 p1 = (c & PHILOX_LOW) * 0xCD9E8D57ul;
        a = (p1 >> 32) ^ b ^ (ulong)k0;
        c = (p0 >> 32) ^ d ^ (ulong)k1;
        b = p1;
        d = p0;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    *c0 = a & PHILOX_LOW; *c1 = b & PHILOX_LOW; *c2 = c & PHILOX_LOW; *c3 = d & PHILOX_LOW;
}
