// Light of a group of sixteen neighbours in a row, in thresholds a cycle, and the output of its words.
// float32 with one rounding an operation, so every device gives the same numbers as numpy.
#pragma OPENCL FP_CONTRACT OFF

#define PLANES 16
#define ROW_OF(g) ((uint)(g) / groups)
#define X_OF(g) (16 * ((uint)(g) % groups))

#ifdef PATTERN
#define GAIN_PARAMETERS , __global const float *gains, __global const float *darks
#define GAINS_OF(g) const float16 gain = vload16(g, gains), dark = vload16(g, darks);
// Light of a plane times a factor, in thresholds a cycle. A leak may exceed it.
#define LIGHT_OF(plane, factor, row, x)                                                           \
    held(lit(seen(plane, row, x, width, &wrong) * (factor) * gain + dark), brightest)
#else
#define GAIN_PARAMETERS , const float gain
#define GAINS_OF(g)
#define LIGHT_OF(plane, factor, row, x)                                                           \
    held(seen(plane, row, x, width, &wrong) * (factor) * gain, brightest)
#endif

// Lanes of light that is negative or not a number are collected in `wrong`.
#define CHECK int16 wrong = 0;
#define REPORT                                                                                    \
    if (some(wrong))                                                                              \
        *fault = 1;
#if FLAGS & TIMING_FLAG // in the course of noisy instants, a plane may gather nothing
#define RIGHT(light) ((light) >= 0.0f | (light) == NOTHING)
#else
#define RIGHT(light) ((light) >= 0.0f)
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
inline float16 seen(__global const float *plane, const uint row, const uint x, const uint width,
                    int16 *wrong)
{
    __global const float *at = plane + (size_t)row * width + x;
    float16 light;
    if (x + 16 <= width)
        light = vload16(0, at);
    else {
        float lanes[16];
        for (uint i = 0; i < 16; i++)
            lanes[i] = x + i < width ? at[i] : 0.0f;
        light = vload16(0, lanes);
    }
    *wrong |= ~RIGHT(light);
    return light;
}

// Sixteen lanes that are aligned to one of them. PoCL splits vstore16 into three stores.
#ifdef __AVX512F__
typedef uint16 __attribute__((aligned(4))) loose16;
#define STORE16(lanes, at) *(__global loose16 *)(at) = (lanes)
#else
#define STORE16(lanes, at) vstore16(lanes, 0, at)
#endif

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
        STORE16(word, at);
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

// Zeros above the highest bit that is set; PoCL splits clz into four parts.
#if defined(__AVX512CD__) && __has_builtin(__builtin_ia32_vplzcntd_512)
inline uint16 leading_zeros(const uint16 bits)
{
    either16 lanes = {as_int16(bits)};
    lanes.p = (plain16)__builtin_ia32_vplzcntd_512(lanes.p);
    return as_uint16(lanes.v);
}
#else
#define leading_zeros(bits) clz(bits)
#endif

// To the nearest integer, of two the even one. PoCL maps only truncation to an instruction.
#if defined(__AVX512F__) && __has_builtin(__builtin_ia32_cvtps2dq512_mask)
typedef float plain_floats __attribute__((vector_size(64)));
inline int16 rounded(const float16 x)
{
    const union { float16 v; plain_floats p; } in = {x};
    either16 out = {(int16)(0)};
    out.p = (plain16)__builtin_ia32_cvtps2dq512_mask(in.p, out.p, -1, 4);
    return out.v;
}
#else
#define rounded(x) convert_int16_rte(x)
#endif

// A segment of the course of light (course.py): first cycle within the call, number of cycles, index
// of its first weight, base plane, number of other planes, these planes, index of its first anchor
// or 0, and the change of the weight in a cycle, or with noise of the instants the longest cycle over
// one without noise (float).
#define SEGMENT (7 + PLANES)
#define PLANE_PARAMETERS                                                                          \
    __global const float *a0, __global const float *a1, __global const float *a2,                 \
        __global const float *a3, __global const float *a4, __global const float *a5,             \
        __global const float *a6, __global const float *a7, __global const float *a8,             \
        __global const float *a9, __global const float *a10, __global const float *a11,           \
        __global const float *a12, __global const float *a13, __global const float *a14,          \
        __global const float *a15, const float16 factors
#define PLANES_AND_FACTORS                                                                        \
    __global const float *planes[PLANES] = {a0, a1, a2,  a3,  a4,  a5,  a6,  a7,                  \
                                            a8, a9, a10, a11, a12, a13, a14, a15};                \
    float factor[PLANES];                                                                         \
    vstore16(factors, 0, factor);

#define STEADY_PARAMETERS                                                                         \
    __global const float *plane, const float factor, __global uint *words, const uint stride,     \
        const uint width, const uint groups, const float brightest, __global const uint *list,    \
        const uint y0, const uint y1, const uint g0, const uint g1, const uint cycles,            \
        __global int *fault                                                                       \
        GAIN_PARAMETERS
// The group of this work-item. Returns if it lies in the changed box or is padding of the list.
#define STEADY_GROUP                                                                              \
    const uint g = list[get_global_id(0)], row = ROW_OF(g), x = X_OF(g);                          \
    if (g == 0xFFFFFFFF)                                                                          \
        return;                                                                                   \
    if (row >= y0 && row < y1 && x >= 16 * g0 && x < 16 * g1)                                     \
        return;                                                                                   \
    GAINS_OF(g)                                                                                   \
    CHECK

#define MOVING_PARAMETERS                                                                         \
    __global const uchar *flags, __global const int *segments, const uint n_segments,             \
        __global const float *weights, const uint rows, __global uint *words, const uint stride,  \
        const uint width, const uint groups, const float brightest, const uint y0,                \
        const uint g0, const uint g1, const uint n_planes, __global int *fault GAIN_PARAMETERS
#define EACH _Pragma("unroll") for (uint i = 0; i < GROUPS; i++)
// Neighbouring groups of a work-item in the changed box, which it steps together to hide the latency
// of each. Those that are not `mine` lie beyond the box or have other flags, and are not stored.
#define MOVING_GROUPS                                                                             \
    const uint row = y0 + get_global_id(1), left = 16 * (g0 + GROUPS * get_global_id(0));         \
    uint g[GROUPS], x[GROUPS];                                                                    \
    int mine[GROUPS], any = 0;                                                                    \
    EACH                                                                                          \
    {                                                                                             \
        x[i] = min(left + 16 * i, 16 * (g1 - 1));                                                 \
        g[i] = row * groups + x[i] / 16;                                                          \
        mine[i] = left + 16 * i < 16 * g1 && flags[g[i]] == FLAGS;                                \
        any |= mine[i];                                                                           \
    }                                                                                             \
    if (!any)                                                                                     \
        return;                                                                                   \
    PLANES_AND_FACTORS
