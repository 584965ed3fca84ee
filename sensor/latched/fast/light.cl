// Light of a group of sixteen neighbours in a row, in thresholds a cycle, and the output of its words.
// float32 with one rounding an operation, so every device gives the same numbers as numpy.
#pragma OPENCL FP_CONTRACT OFF

// Without this attribute the compiler splits sixteen lanes into two vectors of eight.
#if __has_attribute(min_vector_width)
#define WIDE __attribute__((min_vector_width(512)))
#else
#define WIDE
#endif

#define PLANES 16
#define ROW_OF(g) ((uint)(g) / groups)
#define X_OF(g) (16 * ((uint)(g) % groups))

#ifdef PATTERN
#define GAIN_PARAMETERS , __global const float *gains, __global const float *darks
#define GAINS(g) const float16 gain = vload16(g, gains), dark = vload16(g, darks);
// A leak may exceed the light.
#define LEVEL(plane) held(lit(seen(plane, row, x, width) * gain + dark), brightest)
#else
#define GAIN_PARAMETERS , const float gain
#define GAINS(g)
#define LEVEL(plane) held(seen(plane, row, x, width) * gain, brightest)
#endif

// Maps of the light of a cycle; a fragment defines `transfer`.
#ifdef TRANSFER
#define TRANSFERRED(rate) held(lit(transfer(rate)), brightest)
#define LINEAR 0
#else
#define TRANSFERRED(rate) (rate)
#define LINEAR 1
#endif

inline float16 lit(const float16 rate)
{
    return rate > 0.0f ? rate : (float16)(0.0f);
}

inline float16 held(const float16 rate, const float most)
{
    return rate < most ? rate : (float16)(most);
}

// Light on the group; 0 in lanes beyond the end of the row.
inline float16 seen(__global const float *plane, const uint row, const uint x, const uint width)
{
    __global const float *at = plane + (size_t)row * width + x;
    if (x + 16 <= width)
        return vload16(0, at);
    float lanes[16];
    for (uint i = 0; i < 16; i++)
        lanes[i] = x + i < width ? at[i] : 0.0f;
    return vload16(0, lanes);
}

inline uint16 load_word(__global const uint *words, const uint row, const uint x, const uint width)
{
    __global const uint *at = words + (size_t)row * width + x;
    if (x + 16 <= width)
        return vload16(0, at);
    uint lanes[16];
    for (uint i = 0; i < 16; i++)
        lanes[i] = x + i < width ? at[i] : 0;
    return vload16(0, lanes);
}

inline void store_word(const uint16 word, __global uint *words, const uint row, const uint x,
                       const uint width)
{
    __global uint *at = words + (size_t)row * width + x;
    if (x + 16 <= width) {
        vstore16(word, 0, at);
        return;
    }
    uint lanes[16];
    vstore16(word, 0, lanes);
    for (uint i = 0; x + i < width; i++)
        at[i] = lanes[i];
}

// Whether any lane is negative; any() tests the lanes one by one on PoCL.
#if defined(__AVX512DQ__) && __has_builtin(__builtin_ia32_cvtd2mask512)
typedef int plain16 __attribute__((vector_size(64)));
typedef union { int16 v; plain16 p; } either16; // builtins take the vector types of the compiler
inline int some(const int16 v)
{
    const either16 lanes = {v};
    return __builtin_ia32_cvtd2mask512(lanes.p) != 0;
}
#else
inline int some(const int16 v)
{
    const int8 a = v.lo | v.hi;
    const int4 b = a.lo | a.hi;
    return (b.x | b.y | b.z | b.w) < 0;
}
#endif

// A segment of the course of light (course.py): first cycle within the call, number of cycles, index
// of its first weight, base plane, number of other planes, these planes, index of its first anchor,
// and the change of the weight in a cycle (float).
#define SEGMENT (7 + PLANES)
#define PLANE_PARAMETERS                                                                          \
    __global const float *a0, __global const float *a1, __global const float *a2,                 \
        __global const float *a3, __global const float *a4, __global const float *a5,             \
        __global const float *a6, __global const float *a7, __global const float *a8,             \
        __global const float *a9, __global const float *a10, __global const float *a11,           \
        __global const float *a12, __global const float *a13, __global const float *a14,          \
        __global const float *a15

// Most that a plane of this step adds to the base. Weights are 0 to 1, and -1 to 1 with noise of the
// sampling instants.
#if FLAGS & TIMING_FLAG
#define UPWARDS(step) fabs(step)
#else
#define UPWARDS(step) (step > 0.0f ? step : (float16)(0.0f))
#endif

// Runs the segments. EASY is executed for a cycle whose light is below LIMIT thresholds and comes from
// at most two planes; `units` is its light times SCALE. ANY is executed for all other cycles; `rate` is
// the light in thresholds. Both add spikes to `bits` at `bit`.
#define WALK(EASY, ANY)                                                                           \
    uint c = segments[0];                                                                         \
    uint16 bits = 0;                                                                              \
    if (c & 31)                                                                                   \
        bits = load_word(words + (c >> 5) * stride, row, x, width);                               \
    for (uint s = 0; s < n_segments; s++) {                                                       \
        __global const int *segment = segments + s * SEGMENT;                                     \
        const uint end = segment[0] + segment[1], others = segment[4], jump = rows * others;      \
        const float16 base = levels[segment[3]];                                           \
        float16 step = 0.0f;                                                                      \
        if (others)                                                                               \
            step = levels[segment[5]] - base;                                              \
        __global const float *weight = weights + segment[2] + (rows > 1 ? row - y0 : 0) * others; \
        const float16 room = LIMIT - base - UPWARDS(step);                                        \
        const int easy = LINEAR && others <= 1 && !some(as_int16(room - LIMIT * 0x1p-20f));       \
        const float16 base_units = base * SCALE, step_units = step * SCALE;                       \
        while (c < end) {                                                                         \
            const uint stop = min(end, (c | 31) + 1);                                             \
            if (easy)                                                                             \
                for (; c < stop; c++, weight += jump) {                                           \
                    const uint bit = 1u << (c & 31);                                              \
                    const float16 units = base_units + weight[0] * step_units;                    \
                    EASY                                                                          \
                }                                                                                 \
            else                                                                                  \
                for (; c < stop; c++, weight += jump) {                                           \
                    const uint bit = 1u << (c & 31);                                              \
                    float16 rate = base;                                                          \
                    if (others)                                                                   \
                        rate = rate + weight[0] * step;                                           \
                    for (uint j = 1; j < others; j++)                                             \
                        rate = rate + weight[j] * (levels[segment[5 + j]] - base);         \
                    rate = rate < 0.0f ? (float16)(0.0f) : rate;                                  \
                    rate = TRANSFERRED(rate);                                                     \
                    ANY                                                                           \
                }                                                                                 \
            if (!(c & 31)) {                                                                      \
                store_word(bits, words + ((c >> 5) - 1) * stride, row, x, width);                 \
                bits = 0;                                                                         \
            }                                                                                     \
        }                                                                                         \
    }                                                                                             \
    if (c & 31)                                                                                   \
        store_word(bits, words + (c >> 5) * stride, row, x, width);

#define STEADY_PARAMETERS                                                                         \
    __global const float *plane, __global uint *words, const uint stride, const uint width,       \
        const uint groups, const float brightest, __global const uint *list, const uint y0,       \
        const uint y1, const uint g0, const uint g1, const uint cycles GAIN_PARAMETERS
// The group of this work-item. Returns if it lies in the changed box or is padding of the list.
#define STEADY_GROUP                                                                              \
    const uint g = list[get_global_id(0)], row = ROW_OF(g), x = X_OF(g);                          \
    if (g == 0xFFFFFFFF)                                                                          \
        return;                                                                                   \
    if (row >= y0 && row < y1 && x >= 16 * g0 && x < 16 * g1)                                     \
        return;                                                                                   \
    GAINS(g)

#define MOVING_PARAMETERS                                                                         \
    __global const uchar *flags, __global const int *segments, const uint n_segments,             \
        __global const float *weights, const uint rows, __global uint *words, const uint stride,  \
        const uint width, const uint groups, const float brightest, const uint y0,                \
        const uint g0, const uint g1, const uint n_planes GAIN_PARAMETERS
// The group of this work-item in the changed box. Returns if it has other flags.
#define MOVING_GROUP                                                                              \
    const uint row = y0 + get_global_id(1), x = 16 * (g0 + get_global_id(0));                     \
    const uint g = row * groups + x / 16;                                                         \
    if (x >= 16 * g1 || flags[g] != FLAGS)                                                        \
        return;                                                                                   \
    GAINS(g)                                                                                      \
    __global const float *planes[PLANES] = {a0, a1, a2,  a3,  a4,  a5,  a6,  a7,                  \
                                            a8, a9, a10, a11, a12, a13, a14, a15};                \
    float16 levels[PLANES]; /* loaded at once, to overlap memory latency */                       \
    for (uint p = 0; p < n_planes; p++)                                                           \
        levels[p] = LEVEL(planes[p]);
