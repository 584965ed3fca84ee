// Timing noise of pixels (sensor/latched/sampling.py): at the end of a cycle, the charge is compared
// that is early or late by a share of the cycle's light. It is taken before the cycle and given back
// after it, so the state stays the charge at the edge.
#if FLAGS & JITTER_FLAG
#define MOVE_PARAMETERS                                                                           \
    , const uint call, const uint timing, __global const uint *places,                            \
        __global const float *moves

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

// Sum of the four bytes of each lane, less 510.
#if defined(__AVX512BW__) && __has_builtin(__builtin_ia32_pmaddubsw512) &&                         \
    __has_builtin(__builtin_ia32_pmaddwd512)
typedef char bytes64 __attribute__((vector_size(64)));
typedef short pairs32 __attribute__((vector_size(64)));
inline int16 byte_sums(const uint16 word)
{
    typedef union { uint16 v; bytes64 bytes; pairs32 pairs; plain16 sums; } parts;
    const parts ones = {(uint16)(0x01010101)}, units = {(uint16)(0x00010001)};
    parts sum = {word};
    sum.pairs = __builtin_ia32_pmaddubsw512(sum.bytes, ones.bytes);
    sum.sums = __builtin_ia32_pmaddwd512(sum.pairs, units.pairs);
    return as_int16(sum.v) - 510;
}
#else
inline int16 byte_sums(const uint16 word)
{
    const uint16 pairs = (word & 0xFF00FFu) + ((word >> 8) & 0xFF00FFu);
    return as_int16((pairs & 0xFFFFu) + (pairs >> 16)) - 510;
}
#endif

// The normal number of a draw of each pixel, by the factors of x and x^3; own: hashes of the pixels.
// A hash whose first step is left out: its words are two hashes already.
inline float16 normal_of(const uint16 own, const uint draw, __global const float *moves)
{
    uint16 word = (own ^ mixed(draw * WEYL)) * FACTOR_1;
    word = (word ^ (word >> SHIFT_2)) * FACTOR_2;
    const float16 x = convert_float16(byte_sums(word ^ (word >> 16)));
    return x * (moves[0] + moves[1] * (x * x));
}

// The slow part from the knot before an edge on: there, and its change in a cycle.
inline void slow_of(float16 *slow, float16 *slope, const uint edge, const uint16 own,
                    __global const float *moves)
{
    *slow = normal_of(own, 2 * (edge / KNOT) + 1, moves + 2);
    *slope = (normal_of(own, 2 * (edge / KNOT) + 3, moves + 2) - *slow) * (1.0f / KNOT);
}

// Units by which the comparison at an edge is early.
inline int16 early_of(const int16 add, const uint edge, const uint16 own, float16 *slow,
                      float16 *slope, __global const float *moves)
{
    if (!(edge % KNOT))
        slow_of(slow, slope, edge, own, moves);
    float16 moved = normal_of(own, 2 * edge, moves) + (*slow + *slope * (float)(edge % KNOT));
    moved = moved > MOVE_LIMIT ? (float16)(MOVE_LIMIT) : moved;
    moved = moved < -MOVE_LIMIT ? (float16)(-MOVE_LIMIT) : moved;
    return rounded(convert_float16(add) * moved);
}

// Of group `g` in `row`, from cycle `c` of the call on.
#define MOVES_OF_ROW (moves + 5 * (size_t)row)
#define MOVES_OF(own, slow, slope, g, c)                                                          \
    own = mixed_lanes(vload16(g, places) ^ timing);                                               \
    slow_of(&slow, &slope, call + (c), own, MOVES_OF_ROW);
#define EARLY_OF(add, own, slow, slope) early_of(add, call + c + 1, own, &slow, &slope, MOVES_OF_ROW)
// Most charge of a cycle, over its light, that is compared: of the move before and of its own.
#define MOVED_MOST (1 + 2 * MOVES_OF_ROW[4])
#else
#define MOVE_PARAMETERS
#define MOVED_MOST 1.0f
#endif
