// Thresholds of spikes in 32 bits: the exact tier's words (shot_noise.py), and a table in the order
// of a float's bits (units.py).

// Words of spikes k .. k + 4 of each lane: of two counters, from word k mod 4 on.
inline void draw_words(uint16 *words, const ulong16 k, const uint16 pixel, const uint seed)
{
    for (uint i = 0; i < 2; i++) {
        const ulong16 block = (k >> 2) + i;
        ulong16 c0 = convert_ulong16(pixel), c1 = block >> 32, c2 = block, c3 = 0;
        philox16(&c0, &c1, &c2, &c3, seed, STREAM);
        words[4 * i] = convert_uint16(c0);
        words[4 * i + 1] = convert_uint16(c1);
        words[4 * i + 2] = convert_uint16(c2);
        words[4 * i + 3] = convert_uint16(c3);
    }
}

inline uint16 nth_word(const uint16 *words, const uint i, const uint16 slot)
{
    const int16 odd = (slot & 1) != 0, late = (slot & 2) != 0;
    return select(select(words[i], words[i + 1], odd), select(words[i + 2], words[i + 3], odd), late);
}

// Threshold of a random word. `table` holds pairs: value at a knot, step to the next.
inline int16 quantile(const uint16 word, __global const long *table)
{
    const int16 upper = as_int16(word) >> 31;
    const float16 y = convert_float16(as_int16(word) ^ upper);
    const uint16 bits = as_uint16(y < 0.5f ? (float16)(0.5f) : y);
    const int16 i = as_int16(bits >> 16) - SMALLEST + (upper & SIDE);
    const int16 a = as_int16((long8)(table[i.s0], table[i.s1], table[i.s2], table[i.s3],
                                     table[i.s4], table[i.s5], table[i.s6], table[i.s7]));
    const int16 b = as_int16((long8)(table[i.s8], table[i.s9], table[i.sa], table[i.sb],
                                     table[i.sc], table[i.sd], table[i.se], table[i.sf]));
    const float16 part = convert_float16(as_int16(bits & 0xFFFF));
    const float16 step = convert_float16((int16)(a.odd, b.odd));
    return (int16)(a.even, b.even) + convert_int16(step * part * 0x1p-16f);
}
