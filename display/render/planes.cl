// Light of planes of a spike-continuous panel, and what its observers accumulate, on a processor.
//
// A work-item takes whole rows. For each window of spans it steps through the planes of a row, keeps
// the light of the spans of that row, which fits into the cache, and adds it to the images, to
// several still ones at once. Kernel `show` does all of this; with WHOLE it keeps the light of all
// rows, and kernel `look` adds it to images that shift across rows.
//
// LEVEL and REMEMBER are the expressions of the drive (display/drives/drive.py), written for GLSL:
// a vec4 is here a vector of sixteen pixels. A step takes several groups of sixteen, because each
// waits for its own arithmetic.
//   SINGLE     a span is one plane
//   COUNTED    spans of packets without an emitter: spikes are counted, not stepped through
//   INTERVALS, MEMORY, EMITS, PULSED, DARK   as in drive.frag
#pragma OPENCL FP_CONTRACT OFF

#define EACH _Pragma("unroll") for (uint i = 0; i < GROUPS; i++)
#define STEP (16 * GROUPS)
// Pixels of a row whose spans stay in the first-level cache; a multiple of STEP.
#define CHUNK 128
// Rounding errors of a sum of this many planes are those of a float32.
#define PART 8
#define SOFT inline __attribute__((overloadable))

inline uint least_of(const uint a, const uint b) { return a < b ? a : b; }
inline int least_int(const int a, const int b) { return a < b ? a : b; }

// b where `choose`, else a.
inline float16 pick(const float16 a, const float16 b, const int16 choose)
{
    return choose ? b : a;
}

inline uint16 pick_words(const uint16 a, const uint16 b, const int16 choose)
{
    return choose ? b : a;
}

// The library's min and clamp treat NaN, which costs further instructions.
SOFT float16 least(const float16 a, const float16 b) { return b < a ? b : a; }
SOFT float16 least(const float16 a, const float b) { return least(a, (float16)(b)); }
SOFT float16 most(const float16 a, const float16 b) { return a < b ? b : a; }
SOFT float16 most(const float16 a, const float b) { return most(a, (float16)(b)); }
#define min(a, b) least(a, b)
#define max(a, b) most(a, b)
#define clamp(x, low, high) least(most(x, low), high)
#define vec4(x) ((float16)(x))

// The words of a group, 0 beyond the end of the row.
inline uint16 word_of(__global const uint *row, const uint x, const uint width)
{
    if (x + 16 <= width)
        return vload16(0, row + x);
    uint lanes[16];
    for (uint k = 0; k < 16; k++)
        lanes[k] = x + k < width ? row[x + k] : 0;
    return vload16(0, lanes);
}

// Set bits of each lane.
inline float16 ones(uint16 w)
{
    w -= (w >> 1) & 0x55555555u;
    w = (w & 0x33333333u) + ((w >> 2) & 0x33333333u);
    return convert_float16((((w + (w >> 4)) & 0x0F0F0F0Fu) * 0x01010101u) >> 24);
}

#ifdef EMITS
// To the nearest integer; PoCL maps only truncation to an instruction.
inline int16 nearest(const float16 x)
{
    const int16 cut = convert_int16_rtz(x + 0.5f);
    return cut + (convert_float16(cut) > x + 0.5f);
}
// The part of a plane under constant drive; up, down: `relaxation` (display/panels/panel.py).
#define RELAX(drive, up, down)                                                                     \
    {                                                                                              \
        const float16 to = drive, from = convert_float16(level[i]) * unit;                         \
        const int16 more = to > from;                                                              \
        part[i] += to * pick((float16)(down.x), (float16)(up.x), more) +                           \
                   from * pick((float16)(down.y), (float16)(up.y), more);                          \
        const float16 gone = (to - from) * pick((float16)(down.z), (float16)(up.z), more);         \
        /* `from` is rounded: the change may exceed the level by one unit */                       \
        const int16 left = level[i] + nearest(gone / unit);                                        \
        level[i] = left & ~(left >> 31);                                                           \
    }
#ifdef PULSED
#define EMIT(x) RELAX((x * peak), rise, fall) RELAX((float16)(0.0f), rest, rest)
#else
#define EMIT(x) RELAX(x, rise, fall)
#endif
#else
#define EMIT(x) part[i] += x;
#endif

#ifdef MEMORY
#define UPDATE memory = pick(memory, REMEMBER, spike);
#define ADD_EMITTED emitted = pick(emitted, (float16)(0.0f), spike) + x;
#else
#define UPDATE
#define ADD_EMITTED
#endif
#define AGE pick(run, (float16)(0.0f), spike)
#ifdef DARK
#define SHORT(planes) *clamp((float16)(DARK) - planes, 0.0f, 1.0f)
#else
#define SHORT(planes)
#endif
// A plane, bit `bit` of the word. run: planes since the last spike, infinite before the first.
// held: 1 / tau.
#ifdef INTERVALS
#define PLANE(bit)                                                                                 \
    {                                                                                              \
        float16 run = runs[i], held = helds[i], memory = memories[i], emitted = emits[i];          \
        const float16 inverse = 1.0f / run SHORT(run);                                                    \
        const int16 spike = (w[i] & (1u << (bit))) != 0;                                           \
        const float16 fired = pick((float16)(0.0f), (float16)(1.0f), spike);                       \
        UPDATE                                                                                     \
        held = pick(held, inverse, spike);                                                         \
        const float16 x = LEVEL SHORT(AGE);                                                        \
        ADD_EMITTED                                                                                \
        runs[i] = pick(run + 1.0f, (float16)(1.0f), spike);                                        \
        helds[i] = held, memories[i] = memory, emits[i] = emitted;                                 \
        EMIT(x)                                                                                    \
    }
#else
#define PLANE(bit)                                                                                 \
    {                                                                                              \
        const int16 spike = (w[i] & (1u << (bit))) != 0;                                           \
        const float16 fired = pick((float16)(0.0f), (float16)(1.0f), spike);                       \
        const float16 x = LEVEL;                                                                   \
        EMIT(x)                                                                                    \
    }
#endif

// Where the light of a span in a row is kept, `line` values a row.
#ifdef WHOLE
#define SPAN_AT(s) (spans + ((size_t)((s) - first) * height + row) * line)
#else
#define SPAN_AT(s) (spans + ((size_t)item * window + (s) - begin) * line)
#endif

// A tap of an image: light[x + at] low + light[x + at + 1] high.
typedef struct {
    __global const float *light;
    float low, high;
    int at;
} Tap;

// Numbers of a view, for each image and span: weight, slope, fraction of dy, its slope, fraction of
// dx, its slope; and the integers of dy and dx.
#define VIEW 8
// Taps of an image in a row for the spans `begin` to `end`; returns their number.
#define TAPS(LINES, LIGHT)                                                                         \
    const float place = (float)row / (float)height;                                                \
    uint n = 0;                                                                                    \
    for (uint s = begin; s < end; s++) {                                                           \
        __global const float *v = view + s * VIEW;                                                 \
        const float weight = v[0] + v[1] * place;                                                  \
        if (weight == 0.0f)                                                                        \
            continue;                                                                              \
        const float sx = v[4] + v[5] * place, fx = sx - floor(sx);                                 \
        const float sy = v[2] + v[3] * place, fy = sy - floor(sy);                                 \
        const int at = as_int(v[7]) + (int)floor(sx), down = as_int(v[6]) + (int)floor(sy);        \
        for (int below = 0; below < LINES; below++) {                                              \
            const float share = LINES == 1 ? weight : weight * (below ? fy : 1.0f - fy);           \
            const int from = (int)row + down + below;                                              \
            if (share == 0.0f || from < 0 || from >= (int)height)                                  \
                continue;                                                                          \
            taps[n].light = LIGHT;                                                                 \
            taps[n].low = share * (1.0f - fx), taps[n].high = share * fx, taps[n].at = at;         \
            n++;                                                                                   \
        }                                                                                          \
    }                                                                                              \
    return n;

// Light of sixteen pixels, 0 outside the row.
inline float16 seen(__global const float *light, const int x, const int line)
{
    if (x >= 0 && x + 16 <= line)
        return vload16(0, light + x);
    if (x <= -16 || x >= line)
        return 0.0f;
    float lanes[16];
    for (int k = 0; k < 16; k++)
        lanes[k] = x + k >= 0 && x + k < line ? light[x + k] : 0.0f;
    return vload16(0, lanes);
}

// Adds a sum to sixteen pixels of an image, or sets them.
inline void put(const float16 sum, const int fresh, __global double *image)
{
    const double16 before = fresh ? (double16)(0.0) : vload16(0, image);
    vstore16(before + convert_double16(sum), 0, image);
}

// Adds the taps to sixteen pixels from x on, near the ends of a row.
inline void add_group(const Tap *taps, const uint n, const int x, const int line, const int fresh,
                      __global double *image)
{
    float16 sum = 0.0f;
    for (uint t = 0; t < n; t++) {
        sum = fma(taps[t].low, seen(taps[t].light, x + taps[t].at, line), sum);
        sum = fma(taps[t].high, seen(taps[t].light, x + taps[t].at + 1, line), sum);
    }
    put(sum, fresh, image + x);
}

// Adds the taps to four groups inside the row.
inline void add_groups(const Tap *taps, const uint n, const int x, const int moves, const int fresh,
                       __global double *image)
{
    float16 a = 0.0f, b = 0.0f, c = 0.0f, d = 0.0f;
    for (uint t = 0; t < n; t++) {
        __global const float *from = taps[t].light + x + taps[t].at;
        const float16 low = taps[t].low, high = taps[t].high;
        a = fma(low, vload16(0, from), a), b = fma(low, vload16(1, from), b);
        c = fma(low, vload16(2, from), c), d = fma(low, vload16(3, from), d);
        if (moves) {
            from++;
            a = fma(high, vload16(0, from), a), b = fma(high, vload16(1, from), b);
            c = fma(high, vload16(2, from), c), d = fma(high, vload16(3, from), d);
        }
    }
    put(a, fresh, image + x), put(b, fresh, image + x + 16);
    put(c, fresh, image + x + 32), put(d, fresh, image + x + 48);
}

// Adds the spans `begin` to `end` of a row to all images, some images at a time, so that the light
// of a few pixels stays in the first-level cache. which: for each image, its number, and the span at
// which it is set, if it is fresh.
#define IMAGE_PARAMETERS                                                                           \
    __global const float *views, const uint n_spans, __global const uint *which,                   \
        const uint n_still, const uint n_images, __global double *images
#ifdef WHOLE
#define MOVING 0
#else
#define MOVING n_still
// Adds the spans of the pixels `left` to `right` to COUNT images without shifts, which share the
// reads of the light.
#define ADD_STILL(COUNT)                                                                           \
    for (; image + COUNT <= n_still; image += COUNT) {                                             \
        float weight[COUNT][WINDOW];                                                               \
        for (uint m = 0; m < COUNT; m++)                                                           \
            for (uint s = begin; s < end; s++) {                                                   \
                __global const float *v = views + ((size_t)(image + m) * n_spans + s) * VIEW;      \
                weight[m][s - begin] = v[0] + v[1] * ((float)row / (float)height);                 \
            }                                                                                      \
        for (uint x = left; x < right; x += 32) {                                                  \
            float16 sum[COUNT][2];                                                                 \
            _Pragma("unroll") for (uint m = 0; m < COUNT; m++) sum[m][0] = sum[m][1] = 0.0f;       \
            for (uint s = begin; s < end; s++) {                                                   \
                __global const float *from = SPAN_AT(s) + x;                                       \
                const float16 a = vload16(0, from), b = vload16(1, from);                          \
                _Pragma("unroll") for (uint m = 0; m < COUNT; m++)                                 \
                {                                                                                  \
                    sum[m][0] = fma((float16)(weight[m][s - begin]), a, sum[m][0]);                \
                    sum[m][1] = fma((float16)(weight[m][s - begin]), b, sum[m][1]);                \
                }                                                                                  \
            }                                                                                      \
            _Pragma("unroll") for (uint m = 0; m < COUNT; m++)                                     \
            {                                                                                      \
                const int fresh = which[2 * (image + m) + 1] == begin;                             \
                __global double *out =                                                             \
                    images + ((size_t)which[2 * (image + m)] * height + row) * line + x;           \
                put(sum[m][0], fresh, out), put(sum[m][1], fresh, out + 16);                       \
            }                                                                                      \
        }                                                                                          \
    }
#endif
#define ADD_TO_IMAGES                                                                              \
    for (uint image = MOVING; image < n_images; image += TOGETHER) {                               \
        const uint some = least_of(n_images - image, TOGETHER);                                    \
        int left[TOGETHER], right[TOGETHER], moves[TOGETHER], set[TOGETHER];                       \
        uint count[TOGETHER];                                                                      \
        __global double *out[TOGETHER];                                                            \
        for (uint m = 0; m < some; m++) {                                                          \
            Tap *own = taps + m * TAPS_OF_ONE;                                                     \
            count[m] = taps_of(views + (size_t)(image + m) * n_spans * VIEW, spans, item, window,  \
                               first, begin, end, height, row, line, own);                         \
            set[m] = which[2 * (image + m) + 1] == begin;                                          \
            out[m] = images + ((size_t)which[2 * (image + m)] * height + row) * line;              \
            left[m] = right[m] = moves[m] = 0; /* how far the taps reach */                        \
            for (uint t = 0; t < count[m]; t++) {                                                  \
                left[m] = least_int(left[m], own[t].at);                                           \
                right[m] = -least_int(-right[m], -own[t].at - 1);                                  \
                moves[m] |= own[t].high != 0.0f;                                                   \
            }                                                                                      \
        }                                                                                          \
        for (int x = 0; x < (int)line; x += 64)                                                    \
            for (uint m = 0; m < some; m++) {                                                      \
                const Tap *own = taps + m * TAPS_OF_ONE;                                           \
                if (!count[m] && !set[m])                                                          \
                    continue;                                                                      \
                if (x + left[m] >= 0 && x + right[m] + 64 <= (int)line)                            \
                    add_groups(own, count[m], x, moves[m], set[m], out[m]);                        \
                else                                                                               \
                    for (int g = x; g < least_int(x + 64, line); g += 16)                          \
                        add_group(own, count[m], g, line, set[m], out[m]);                         \
            }                                                                                      \
    }
#ifdef WHOLE
#define TAPS_OF_ONE (2 * WINDOW)
#else
#define TAPS_OF_ONE WINDOW
#endif
inline uint taps_of(__global const float *view, __global const float *spans, const uint item,
                    const uint window, const uint first, const uint begin, const uint end,
                    const uint height, const uint row, const uint line, Tap *taps)
{
#ifdef WHOLE
    TAPS(2, spans + ((size_t)(s - first) * height + from) * line)
#else
    TAPS(1, SPAN_AT(s))
#endif
}

#ifdef WHOLE
// Adds the kept light of the spans `first` to `last` to the images.
__kernel WIDE void look(__global const float *spans, const uint first, const uint last,
                        const uint window, const uint height, const uint line, const uint rows,
                        IMAGE_PARAMETERS)
{
    const uint item = get_global_id(0), stop = least_of((item + 1) * rows, height);
    Tap taps[TOGETHER * TAPS_OF_ONE];
    for (uint row = item * rows; row < stop; row++)
        for (uint begin = first; begin < last; begin += window) {
            const uint end = least_of(begin + window, last);
            ADD_TO_IMAGES
        }
}
#endif

#define FOREVER 0xFFFFFFFFu
#define NEVER as_float(0x7F800000u)
// Component n of the state of a group (display/render/shader.py, `states`).
#define STATE(from, n) vload16(i, from + (n) * height * (size_t)line + at)
#define FLOATS(from, n) as_float16(STATE(from, n))
#define KEEP(value, n) vstore16(value, i, after + (n) * height * (size_t)line + at);

// A plane that is a span of its own.
#define ALONE(k)                                                                                   \
    {                                                                                              \
        EACH part[i] = 0.0f;                                                                       \
        EACH PLANE(k)                                                                              \
        __global float *kept = SPAN_AT(s + k) + x;                                                 \
        EACH vstore16(part[i], i, kept);                                                           \
    }

// Shows the spans `first` to `last` of a block of `cycles` planes, and adds them to the images.
// before, after: the state before and after them.
__kernel WIDE void show(__global const uint *words, const uint cycles, const uint batch,
                        __global const uint *before, __global uint *after, __global float *spans,
                        const uint first, const uint last, const uint window, const uint height,
                        const uint width, const uint line, const uint rows, const float unit,
                        const float peak, const float4 rise, const float4 fall, const float4 rest,
                        IMAGE_PARAMETERS)
{
    const uint item = get_global_id(0), stop_row = least_of((item + 1) * rows, height);
    const size_t plane = (size_t)height * width;
    Tap taps[TOGETHER * TAPS_OF_ONE];
    for (uint row = item * rows; row < stop_row; row++)
        for (uint begin = first; begin < last; begin += window) {
            const uint end = least_of(begin + window, last);
            __global const uint *state = begin == first ? before : after;
            for (uint left = 0; left < line; left += CHUNK) {
                const uint right = least_of(left + CHUNK, line);
                for (uint x = left; x < right; x += STEP) {
                    const size_t at = (size_t)row * line + x;
#ifndef SINGLE
                    float16 light[GROUPS];
#endif
#ifndef COUNTED
                    float16 part[GROUPS];
                    uint16 w[GROUPS];
#endif
#ifdef INTERVALS
                    float16 runs[GROUPS], helds[GROUPS], memories[GROUPS], emits[GROUPS];
                    uint16 any_spike[GROUPS];
                    EACH
                    {
                        const uint16 tau = STATE(state, 0), age = STATE(state, 1);
                        helds[i] = pick(1.0f / convert_float16(tau), (float16)(0.0f), tau == 0);
                        runs[i] = pick(convert_float16(age), (float16)(NEVER), age == 0);
                        memories[i] = emits[i] = 0.0f;
                        any_spike[i] = 0;
#ifdef MEMORY
                        memories[i] = FLOATS(state, 2);
                        emits[i] = FLOATS(state, 3);
#endif
                    }
#endif
#ifdef EMITS
                    int16 level[GROUPS];
                    EACH level[i] = as_int16(STATE(state, LEVEL_AT));
#endif
#ifdef SINGLE
                    for (uint s = begin, some; s < end; s += some) {
                        const uint bit = s & 31;
                        __global const uint *from = words + (s >> 5) * plane + (size_t)row * width;
                        some = least_of(end - s, PART - (s & (PART - 1)));
                        const uint mask = 0xFFFFFFFFu >> (32 - some);
                        EACH
                        {
                            w[i] = (word_of(from, x + 16 * i, width) >> bit) & mask;
#ifdef INTERVALS
                            any_spike[i] |= w[i];
#endif
                        }
                        if (some == PART) {
                            _Pragma("unroll") for (uint k = 0; k < PART; k++) ALONE(k)
                        } else
                            for (uint k = 0; k < some; k++)
                                ALONE(k)
                    }
#else
                    for (uint s = begin; s < end; s++) {
                        const uint stop = least_of((s + 1) * batch, cycles);
                        EACH light[i] = 0.0f;
                        for (uint n = s * batch, some; n < stop; n += some) {
                            const uint bit = n & 31;
                            __global const uint *from =
                                words + (n >> 5) * plane + (size_t)row * width;
#ifdef COUNTED
                            some = least_of(stop - n, 32 - bit);
                            const uint mask = 0xFFFFFFFFu >> (32 - some);
                            EACH light[i] += ones((word_of(from, x + 16 * i, width) >> bit) & mask);
#else
                            some = least_of(stop - n, PART - (n & (PART - 1)));
                            const uint mask = 0xFFFFFFFFu >> (32 - some);
                            EACH
                            {
                                w[i] = (word_of(from, x + 16 * i, width) >> bit) & mask;
                                part[i] = 0.0f;
#ifdef INTERVALS
                                any_spike[i] |= w[i];
#endif
                            }
                            if (some == PART) {
                                _Pragma("unroll") for (uint k = 0; k < PART; k++) EACH PLANE(k)
                            } else
                                for (uint k = 0; k < some; k++)
                                    EACH PLANE(k)
                            EACH light[i] += part[i];
#endif
                        }
                        __global float *kept = SPAN_AT(s) + x;
                        EACH vstore16(light[i], i, kept);
                    }
#endif
#ifdef INTERVALS
                    // Without a spike, the age increases up to FOREVER; with one, it is in `runs`.
                    const uint planes = least_of(end * batch, cycles) - begin * batch;
                    EACH
                    {
                        const int16 spike = any_spike[i] != 0;
                        const uint16 tau = STATE(state, 0), age = STATE(state, 1);
                        const uint16 grown = pick_words(age + planes, FOREVER, age + planes < age);
                        const uint16 older = pick_words(grown, 0, age == 0);
                        KEEP(pick_words(older, convert_uint16_rtz(runs[i]), spike), 1)
                        const float16 interval = least(1.0f / helds[i] + 0.5f, 4294967040.0f);
                        const uint16 whole = convert_uint16_rtz(interval);
                        KEEP(pick_words(tau, pick_words(whole, 0, helds[i] == 0.0f), spike), 0)
#ifdef MEMORY
                        KEEP(as_uint16(memories[i]), 2)
                        KEEP(as_uint16(emits[i]), 3)
#endif
                    }
#endif
#ifdef EMITS
                    EACH KEEP(as_uint16(level[i]), LEVEL_AT)
#endif
                }
#ifndef WHOLE
                uint image = 0;
                ADD_STILL(4)
                ADD_STILL(1)
#endif
            }
#ifndef WHOLE
            ADD_TO_IMAGES
#endif
        }
}
