// Groups with noise or dead time. The state is the deficit, threshold - charge - 1, in int32, whose
// sign is the spike. Light is subtracted between spikes, so a pixel can skip from spike to spike.
//   NOISE      the threshold of each spike is drawn (draws.cl); otherwise it is `one`
//   DEAD_TIME  each spike loses a share of its cycle's light (charge.cl)
//   RESET_HARD, RESET_SUBTRACT   reset rules other than `residual`: at most one threshold a cycle
// `top` is the longest threshold. A cycle whose light reaches it fires at any deficit, and whole
// thresholds are then subtracted at their mean, all at once. The light of a cycle is clipped to CAP.

#define STATE                                                                                     \
    int16 d = vload16(g, charge);                                                                 \
    const uint16 pixel = vload16(g, numbers);                                                     \
    const ulong16 first_k = convert_ulong16(vload16(g, low)) |                                    \
                            (convert_ulong16(vload16(g, high)) << 32);                            \
    uint16 used = 0; /* spikes since first_k */
#define KEEP_STATE                                                                                \
    const ulong16 last_k = first_k + convert_ulong16(used);                                       \
    vstore16(d, g, charge);                                                                       \
    vstore16(convert_uint16(last_k & 0xFFFFFFFFul), g, low);                                      \
    vstore16(convert_uint16(last_k >> 32), g, high);
#define STATE_PARAMETERS                                                                          \
    __global int *charge, __global uint *low, __global uint *high, __global const uint *numbers,  \
        __global const int *table, const uint seed, const float dead,     \
        const int one, const int top                                                              \
        MOVE_PARAMETERS

#ifdef NOISE
// The next four thresholds of each lane, t0 first; EMPTY if used.
#define QUEUE int16 t0 = EMPTY, t1 = EMPTY, t2 = EMPTY, t3 = EMPTY;
#define REFILL                                                                                    \
    {                                                                                             \
        uint16 drawn[8];                                                                          \
        const ulong16 k = first_k + convert_ulong16(used) + 1;                                    \
        const uint16 slot = convert_uint16(k & 3);                                                \
        block_words(drawn, k >> 2, pixel, seed);                                                  \
        block_words(drawn + 4, (k >> 2) + 1, pixel, seed);                                        \
        t0 = quantile(nth_word(drawn, 0, slot), table);                                           \
        t1 = quantile(nth_word(drawn, 1, slot), table);                                           \
        t2 = quantile(nth_word(drawn, 2, slot), table);                                           \
        t3 = quantile(nth_word(drawn, 3, slot), table);                                           \
    }
#define SHIFT(f) t0 = f ? t1 : t0; t1 = f ? t2 : t1; t2 = f ? t3 : t2; t3 = f ? (int16)(EMPTY) : t3;
#else
#define QUEUE const int16 t0 = one;
#define REFILL {}
#define SHIFT(f)
#endif

#if defined(RESET_HARD)
#define START(r, f, threshold) select(r, (threshold) - 1, f)
#elif defined(RESET_SUBTRACT)
// Charge accumulates up to DEEPEST beyond a threshold.
#define START(r, f, threshold) max((r) + ((f) & (threshold)), (int16)(DEEPEST))
#endif

#ifdef START
// At most one spike a cycle, for any light.
#define ANY_CYCLE(add, lost)                                                                      \
    {                                                                                             \
        const int16 rest = d - (add), f = rest < 0;                                               \
        if (some(f & t0))                                                                         \
            REFILL                                                                                \
        d = START(rest, f, t0 + (lost));                                                          \
        SHIFT(f)                                                                                  \
        used -= as_uint16(f);                                                                     \
        bits |= as_uint16(f) & bit;                                                               \
    }
#define CYCLE(add, lost) ANY_CYCLE(add, lost)
#else
// A cycle in the general case: several thresholds, or light beyond the longest threshold.
#define ANY_CYCLE(add, lost)                                                                      \
    {                                                                                             \
        const int16 certain = ((add) >= top + (lost)) & BELOW(d, add);                            \
        int16 r = d - (add);                                                                      \
        bits |= as_uint16(certain | (r >> 31)) & bit;                                             \
        if (some(certain)) {                                                                      \
            r = select(r, run_over(d, (int16)(1), add, one + (lost), &used, certain), certain);   \
            RENEW(certain)                                                                        \
        }                                                                                         \
        while (some(r)) {                                                                         \
            if (some(r & t0))                                                                     \
                REFILL                                                                            \
            const int16 f = r < 0;                                                                \
            r += f & (t0 + (lost));                                                               \
            SHIFT(f)                                                                              \
            used -= as_uint16(f);                                                                 \
        }                                                                                         \
        d = r;                                                                                    \
    }
#ifdef NOISE
#define RENEW(lanes) t0 = lanes ? (int16)(EMPTY) : t0;
#else
#define RENEW(lanes)
#endif

// A cycle. The common case has at most one spike, and the next threshold is in the queue.
#define CYCLE(add, lost)                                                                          \
    {                                                                                             \
        const int16 rest = d - (add), f = rest < 0, next = rest + (f & (t0 + (lost)));            \
        if (some(next | (top - 1 + (lost) - (add))))                                              \
            ANY_CYCLE(add, lost)                                                                  \
        else {                                                                                    \
            d = next;                                                                             \
            SHIFT(f)                                                                              \
            used -= as_uint16(f);                                                                 \
            bits |= as_uint16(f) & bit;                                                           \
        }                                                                                         \
    }
#endif

// The group of this work-item in the changed box. Returns if it has other flags.
#define MOVING_GROUP                                                                              \
    const uint row = y0 + get_global_id(1), x = 16 * (g0 + get_global_id(0));                     \
    const uint g = row * groups + x / 16;                                                         \
    if (x >= 16 * g1 || flags[g] != FLAGS)                                                        \
        return;                                                                                   \
    GAINS_OF(g)                                                                                   \
    CHECK                                                                                         \
    PLANES_AND_FACTORS                                                                            \
    float16 levels[PLANES]; /* loaded at once, to overlap memory latency */                       \
    for (uint p = 0; p < n_planes; p++)                                                           \
        levels[p] = LIGHT_OF(planes[p], factor[p], row, x);                                       \
    REPORT

// Most that a plane of this step adds to the base. Weights are 0 to 1, and -1 to 1 with noise of the
// sampling instants.
#if FLAGS & TIMING_FLAG
#define UPWARDS(step) fabs(step)
#else
#define UPWARDS(step) (step > 0.0f ? step : (float16)(0.0f))
#endif

#if FLAGS & JITTER_FLAG
#define MOVES                                                                                     \
    uint16 own;                                                                                   \
    float16 knot, next_knot;                                                                      \
    MOVES_OF(own, knot, next_knot, g, c)
#define EARLY(add)                                                                                \
    const int16 early = EARLY_OF(add, own, knot, next_knot);                                      \
    d -= early;
#define LATE d += early;
#else
#define MOVES
#define EARLY(add)
#define LATE
#endif

__kernel WIDE void moving(STATE_PARAMETERS, MOVING_PARAMETERS, PLANE_PARAMETERS)
{
    MOVING_GROUP
    STATE
    QUEUE
    uint c = segments[0];
    MOVES
    uint16 bits = 0;
    if (c & 31)
        bits = load_word(words + (c >> 5) * stride, row, x, width);
    for (uint s = 0; s < n_segments; s++) {
        __global const int *segment = segments + s * SEGMENT;
        const uint end = segment[0] + segment[1], others = segment[4];
        const uint jump = rows * (others + TIMED);
        const float16 base = levels[segment[3]];
        float16 step = 0.0f;
        if (others)
            step = levels[segment[5]] - base;
        __global const float *weight = weights + segment[2] + (rows > 1 ? row - y0 : 0) * (others + TIMED);
        // Light below LIMIT, from at most two planes.
        const float16 room = LIMIT - base - UPWARDS(step);
        const int simple = LINEAR && others <= 1 && !some(as_int16(room - LIMIT * 0x1p-20f));
        const float16 base_units = base * SCALE, step_units = step * SCALE;
        while (c < end) {
            const uint stop = min(end, (c | 31) + 1);
            if (simple)
                for (; c < stop; c++, weight += jump) {
                    const uint bit = 1u << (c & 31);
                    const int16 add = convert_int16(base_units + weight[0] * step_units + 0.5f);
                    const int16 lost = LOST_NOW(add, weight, others);
                    EARLY(add)
                    CYCLE(add, lost)
                    LATE
                }
            else
                for (; c < stop; c++, weight += jump) {
                    const uint bit = 1u << (c & 31);
                    float16 rate = base;
                    for (uint j = 0; j < others; j++)
                        rate = rate + weight[j] * (levels[segment[5 + j]] - base);
                    const int16 add = units_of(TRANSFERRED(lit(rate)), one);
                    const int16 lost = LOST_NOW(add, weight, others);
                    EARLY(add)
                    ANY_CYCLE(add, lost)
                    LATE
                }
            if (!(c & 31)) {
                store_word(bits, words + ((c >> 5) - 1) * stride, row, x, width);
                bits = 0;
            }
        }
    }
    if (c & 31)
        store_word(bits, words + (c >> 5) * stride, row, x, width);
    KEEP_STATE
}

#ifdef NOISE
// The threshold of interval k of each lane. Lanes that fire together use the words of a counter
// together, so each further counter serves four spikes. `fresh` restarts at lanes out of step.
inline __attribute__((always_inline)) int16 next_threshold(uint16 *drawn, uint *i, int *fresh, uint16 *slot, ulong16 *block,
                            const ulong16 k, const uint16 pixel, __global const int *table,
                            const uint seed)
{
    if (*fresh) {
        *slot = convert_uint16(k & 3);
        *block = k >> 2;
        block_words(drawn, *block, pixel, seed);
        block_words(drawn + 4, *block + 1, pixel, seed);
        *block += 2;
        *i = *fresh = 0;
    } else if (*i == 5) {
        for (uint j = 0; j < 4; j++)
            drawn[j] = drawn[4 + j];
        block_words(drawn + 4, *block, pixel, seed);
        *block += 1;
        *i = 1;
    }
    return quantile(nth_word(drawn, (*i)++, *slot), table);
}
#define DRAWN                                                                                     \
    uint16 drawn[8], slot = 0;                                                                    \
    ulong16 block = 0;                                                                            \
    uint i = 0;
#define DRAW                                                                                      \
    next_threshold(drawn, &i, &fresh, &slot, &block, first_k + convert_ulong16(used), pixel,      \
                   table, seed)
#else
#define DRAWN
#define DRAW (int16)(one)
#endif

#if !(FLAGS & JITTER_FLAG) // whose light is a course
// Constant light: from spike to spike, all lanes in step. The number of cycles to the next spike is
// estimated in float and corrected in integers, so the result has no rounding error. A lane that did
// not fire has reached the end of its window and draws no more.
__kernel WIDE void steady(STATE_PARAMETERS, STEADY_PARAMETERS)
{
    STEADY_GROUP
    STATE
    const float16 rate = TRANSFERRED(LIGHT_OF(plane, factor, row, x));
    REPORT
    const int16 add = units_of(rate, one), lost = LOST(add);
#ifdef START
    const int16 sure = 0;
#else
    const int16 sure = add >= top + lost;
#endif
    const int any_sure = some(sure);
    const float16 light = convert_float16(add), reciprocal = 1.0f / (light + 0.5f);
    // No spike at all, with a margin for rounding.
    if (!some(as_int16(convert_float16(d) - light * ((float)cycles * 1.0001f)))) {
        d -= add * (int)cycles;
        for (uint w = 0; w < (cycles + 31) / 32; w++)
            store_word((uint16)(0), words + w * stride, row, x, width);
        vstore16(d, g, charge);
        return;
    }
    DRAWN
    for (uint begin = 0; begin < cycles; begin += 64) {
        const int stop = min(64u, cycles - begin);
        int16 at = 0;
        uint16 early = 0, late = 0;
        int fresh = 1;
        for (;;) {
            const int16 left = stop - at;
            const float16 most = convert_float16(left), root = convert_float16(d) * reciprocal;
            int16 n = convert_int16(root < most ? root : most);
#ifdef RESET_SUBTRACT
            n = max(n, 0); // charge may have accumulated
#endif
            int16 rest = d - n * add;
            const int16 over = (rest >> 31) & (n > 0);
            n += over;
            rest += over & add;
            const int16 go = (rest >= add) & (n < left);
            n -= go;
            rest -= go & add;
            int16 fired = n < left;
            if (any_sure) {
                const int16 run = sure & fired & BELOW(d, add);
                if (some(run)) {
                    rest = run_over(d, left, add, one + lost, &used, run) & run | rest & ~run;
                    const uint16 from = as_uint16(at);
                    early |= as_uint16(run) & 
                        (at < 32 ? (uint16)(0xFFFFFFFFu) << (from & 31) : (uint16)(0)) &
                        (stop < 32 ? (1u << stop) - 1 : 0xFFFFFFFFu);
                    if (stop > 32)
                        late |= as_uint16(run) & 
                            (at > 31 ? (uint16)(0xFFFFFFFFu) << (from & 31) : (uint16)(0xFFFFFFFFu)) &
                            (0xFFFFFFFFu >> (64 - stop));
                    n = select(n, left, run);
                    fired &= ~run;
                }
            }
            d = rest - (fired & add);
            if (!some(fired))
                break;
            at += n;
            const uint16 bit = as_uint16(fired) & ((uint16)(1) << as_uint16(at & 31));
            early |= as_uint16(at < 32) & bit;
            late |= as_uint16(at > 31) & bit;
            at -= fired;
            used -= as_uint16(fired);
#ifdef START
            d = START(d, fired, lost + DRAW);
#else
            d += fired & (lost + DRAW);
            while (some(d)) {
                const int16 again = d < 0;
                used -= as_uint16(again);
                fresh = 1;
                d += again & (lost + DRAW);
                fresh = 1;
            }
#endif
        }
        __global uint *word = words + (begin >> 5) * stride;
        store_word(early, word, row, x, width);
        if (stop > 32)
            store_word(late, word + stride, row, x, width);
    }
    KEEP_STATE
}
#endif
