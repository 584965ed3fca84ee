// Timing noise of pixels (sensor/latched/sampling.py): at the end of a cycle, the charge is compared
// that is early or late by a share of the cycle's light. It is taken before the cycle and given back
// after it, so the state stays the charge at the edge.
#if FLAGS & JITTER_FLAG
#define MOVE_PARAMETERS                                                                           \
    , const uint call, const uint timing, __global const uint *places,                            \
        __global const float *normal, __global const float *deviations

inline uint mixed(uint word)
{
    word = (word ^ (word >> SHIFT_1)) * FACTOR_1;
    word = (word ^ (word >> SHIFT_2)) * FACTOR_2;
    return word ^ (word >> 16);
}

inline uint16 mixed_lanes(uint16 word)
{
    word = (word ^ (word >> SHIFT_1)) * FACTOR_1;
    word = (word ^ (word >> SHIFT_2)) * FACTOR_2;
    return word ^ (word >> 16);
}

// The normal number of a draw of each pixel; own: hashes of the pixels.
inline float16 normal_of(const uint16 own, const uint draw, __global const float *normal)
{
    const uint16 at = mixed_lanes(own ^ mixed(draw * WEYL)) >> (32 - NORMAL_BITS);
    return (float16)(normal[at.s0], normal[at.s1], normal[at.s2], normal[at.s3], normal[at.s4],
                     normal[at.s5], normal[at.s6], normal[at.s7], normal[at.s8], normal[at.s9],
                     normal[at.sa], normal[at.sb], normal[at.sc], normal[at.sd], normal[at.se],
                     normal[at.sf]);
}

// Units by which the comparison at an edge is early. low, high: the slow part at the knots around it.
inline int16 early_of(const int16 add, const uint edge, const uint16 own, float16 *low,
                      float16 *high, __global const float *normal, __global const float *deviation)
{
    float16 moved = deviation[0] * normal_of(own, 2 * edge, normal);
    if (deviation[1] != 0.0f) {
        if (!(edge % KNOT)) {
            *low = *high;
            *high = normal_of(own, 2 * (edge / KNOT) + 3, normal);
        }
        moved = moved + deviation[1] * (*low + (*high - *low) * ((float)(edge % KNOT) / KNOT));
    }
    moved = moved > MOVE_LIMIT ? (float16)(MOVE_LIMIT) : moved;
    moved = moved < -MOVE_LIMIT ? (float16)(-MOVE_LIMIT) : moved;
    return rounded(convert_float16(add) * moved);
}

// Of group `g` in `row`, from cycle `c` of the call on.
#define MOVES_OF(own, low, high, g, c)                                                            \
    own = mixed_lanes(vload16(g, places) ^ timing);                                               \
    low = normal_of(own, 2 * ((call + (c)) / KNOT) + 1, normal);                                  \
    high = normal_of(own, 2 * ((call + (c)) / KNOT) + 3, normal);
#define EARLY_OF(add, own, low, high)                                                             \
    early_of(add, call + c + 1, own, &low, &high, normal, deviations + 2 * row)
// Most charge of a cycle, over its light, that is compared: of the move before and of its own.
#define MOVED_MOST (1 + 2 * MOVE_LIMIT)
#else
#define MOVE_PARAMETERS
#define MOVED_MOST 1.0f
#endif
