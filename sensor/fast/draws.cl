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

#if defined(__AVX512DQ__) && __has_builtin(__builtin_ia32_gathersiv16si)
inline int16 look(__global const int *table, const int16 index)
{
    const either16 at = {index}, none = {(int16)(0)};
    either16 found;
    found.p = __builtin_ia32_gathersiv16si(none.p, table, at.p, (short)-1, 4);
    return found.v;
}
#else
inline int16 look(__global const int *t, const int16 i)
{
    return (int16)(t[i.s0], t[i.s1], t[i.s2], t[i.s3], t[i.s4], t[i.s5], t[i.s6], t[i.s7],
                   t[i.s8], t[i.s9], t[i.sa], t[i.sb], t[i.sc], t[i.sd], t[i.se], t[i.sf]);
}
#endif

// Threshold of a random word.
inline int16 quantile(const uint16 word, __global const int *table)
{
    const int16 upper = as_int16(word) >> 31;
    const float16 y = convert_float16(as_int16(word) ^ upper);
    const uint16 bits = as_uint16(y < 0.5f ? (float16)(0.5f) : y);
    const int16 index = as_int16(bits >> 16) - SMALLEST + (upper & SIDE);
    const int16 low = look(table, index), step = look(table + 1, index) - low;
    const float16 part = convert_float16(as_int16(bits & 0xFFFF));
    return low + convert_int16(convert_float16(step) * part * 0x1p-16f);
}
