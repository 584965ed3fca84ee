// Thresholds of spikes in 32 bits: the random words of the exact tier, and a polynomial for each octave
// of probability (units.py).

// The four words of a counter of each lane: for spikes 4 block to 4 block + 3.
inline void block_words(uint16 *words, const ulong16 block, const uint16 pixel, const uint seed)
{
    ulong16 c0 = convert_ulong16(pixel), c1 = block >> 32, c2 = block, c3 = 0;
    philox16(&c0, &c1, &c2, &c3, seed, STREAM);
    words[0] = convert_uint16(c0);
    words[1] = convert_uint16(c1);
    words[2] = convert_uint16(c2);
    words[3] = convert_uint16(c3);
}

// Word i, counted from the spike whose index modulo 4 is `slot`, whose counter comes first.
inline __attribute__((always_inline)) uint16 nth_word(const uint16 *words, const uint i, const uint16 slot)
{
    const int16 odd = (slot & 1) != 0, late = (slot & 2) != 0;
    return select(select(words[i], words[i + 1], odd), select(words[i + 2], words[i + 3], odd), late);
}

// Entry `octave`, 0 to 31, of one of the two halves of 64 numbers.
#if defined(__AVX512F__) && __has_builtin(__builtin_ia32_vpermi2vard512)
inline __attribute__((always_inline)) int16 entry(__global const int *numbers, const int16 octave, const int16 upper)
{
    const either16 at = {octave};
    const either16 a = {vload16(0, numbers)}, b = {vload16(1, numbers)};
    const either16 c = {vload16(2, numbers)}, d = {vload16(3, numbers)};
    either16 low, high;
    low.p = __builtin_ia32_vpermi2vard512(a.p, at.p, b.p);
    high.p = __builtin_ia32_vpermi2vard512(c.p, at.p, d.p);
    return upper ? high.v : low.v;
}
#else
inline __attribute__((always_inline)) int16 entry(__global const int *numbers, const int16 octave, const int16 upper)
{
    const int16 i = octave | (upper & 32);
    return (int16)(numbers[i.s0], numbers[i.s1], numbers[i.s2], numbers[i.s3], numbers[i.s4],
                   numbers[i.s5], numbers[i.s6], numbers[i.s7], numbers[i.s8], numbers[i.s9],
                   numbers[i.sa], numbers[i.sb], numbers[i.sc], numbers[i.sd], numbers[i.se],
                   numbers[i.sf]);
}
#endif
#define TERM(n) as_float16(entry(table + 64 * n, octave, upper))

// Threshold of a random word. The distance of the word from the nearer end of its range is converted
// to float: its exponent is the octave, and its mantissa the position in it.
inline __attribute__((always_inline)) int16 quantile(const uint16 word, __global const int *table)
{
    const int16 upper = as_int16(word) >> 31;
    float16 y = convert_float16(as_int16(word) ^ upper);
    y = y < 0.5f ? (float16)(0.5f) : y;
    y = y < 2147483520.0f ? y : (float16)(2147483520.0f);
    const int16 octave = (as_int16(y) >> 23) - 126;
    const float16 s = as_float16((as_int16(y) & 0x7FFFFF) | 0x3F800000) - 1.5f;
    float16 r = TERM(5) * s + TERM(4);
    r = r * s + TERM(3);
    r = r * s + TERM(2);
    r = r * s + TERM(1);
    const int16 threshold = entry(table, octave, upper) + convert_int16(r * s);
    return threshold > 1 ? threshold : (int16)(1);
}
