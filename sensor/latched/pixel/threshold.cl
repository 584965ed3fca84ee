// Thresholds of spikes: Gamma(Q) quantiles of random words (interval.py has the layout).
// `table` holds pairs: value at a knot, step to the next knot.

// Random words of spikes k .. k + BATCH - 1 of each lane. Four spikes share a counter: spike k takes
// word k mod 4 of counter k / 4. Lanes may differ in k, so a batch has one counter more, and word i of
// the batch is `words[i + k mod 4]`.
#define BATCH 8
inline void draw_batch(uint16 *words, const ulong16 k, const uint16 pixel, const uint seed)
{
    for (uint i = 0; i < BATCH / 4 + 1; i++) {
        const ulong16 block = (k >> 2) + i;
        ulong16 c0 = convert_ulong16(pixel), c1 = block >> 32, c2 = block, c3 = 0;
        philox16(&c0, &c1, &c2, &c3, seed, SHOT_NOISE_STREAM);
        words[4 * i] = convert_uint16(c0);
        words[4 * i + 1] = convert_uint16(c1);
        words[4 * i + 2] = convert_uint16(c2);
        words[4 * i + 3] = convert_uint16(c3);
    }
}

// Word i of a batch that starts at spike k, with slot = k mod 4.
inline uint16 batch_word(const uint16 *words, const uint i, const uint16 slot)
{
    const int16 odd = (slot & 1) != 0, late = (slot & 2) != 0;
    return select(select(words[i], words[i + 1], odd), select(words[i + 2], words[i + 3], odd), late);
}

// Position of the highest set bit, from the exponent of a float; -127 for 0. Clearing the bits eight
// below each set bit keeps the highest one and prevents a carry from rounding. (PoCL executes clz on a
// uint16 lane by lane.)
inline int16 highest_bit(const uint16 y)
{
    return as_int16(as_uint16(convert_float16(y & ~(y >> 8))) >> 23) - 127;
}

#define PAIR(i) const long2 p##i = vload2(index.s##i, table);
#define SIXTEEN(part)                                                                           \
    (long16)(p0.part, p1.part, p2.part, p3.part, p4.part, p5.part, p6.part, p7.part, p8.part,   \
             p9.part, pa.part, pb.part, pc.part, pd.part, pe.part, pf.part)

inline long16 threshold(const uint16 word, __global const long *table)
{
    const uint16 upper = word >> 31;
    const uint16 y = word ^ (0 - upper);
    const uint16 exponent = as_uint16(max(highest_bit(y) - MANTISSA_BITS, 0));
    const uint16 mantissa = y >> exponent;
    const uint16 index = upper * KNOTS + (exponent << MANTISSA_BITS) + mantissa;
    const uint16 fraction = ((y - (mantissa << exponent)) << ((32 - exponent) & 31)) >> 16;
    PAIR(0) PAIR(1) PAIR(2) PAIR(3) PAIR(4) PAIR(5) PAIR(6) PAIR(7)
    PAIR(8) PAIR(9) PAIR(a) PAIR(b) PAIR(c) PAIR(d) PAIR(e) PAIR(f)
    // The step times the fraction, over 2^16, in two parts: together they can exceed 63 bits.
    const long16 step = SIXTEEN(y), share = convert_long16(fraction);
    return SIXTEEN(x) + (step >> 16) * share + (((step & 0xffff) * share) >> 16);
}

// Threshold of spike k alone, for the rare second spike in a cycle.
inline long16 next_threshold(const ulong16 k, const uint16 pixel, __global const long *table,
                             const uint seed)
{
    uint16 words[BATCH + 4];
    draw_batch(words, k, pixel, seed);
    return threshold(batch_word(words, 0, convert_uint16(k) & 3), table);
}
