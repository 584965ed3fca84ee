// The exact pixel: charge in Q24.40, sixteen pixels a work-item, one word a pixel for 32 cycles.
//
// The state is the deficit, threshold - charge - 1, whose sign bit is the spike (charge >= threshold:
// a tie fires). The program consists of the fragments of the effects and this text. Hooks:
//   SHOT_NOISE   a fragment defines draw_batch, batch_word, threshold, next_threshold
//   RAMP         increments change by `slope` a cycle
//   RESET_HARD, RESET_SUBTRACT   reset rules other than `residual`
//   TRANSFER     a fragment defines transfer, a map of the charge of a cycle
//   DEAD_TIME    each spike loses `dead` / 2^16 of a cycle's light
// There are two kernels: `expose` for light that is linear over many cycles, and `walk` for light whose
// course changes every few cycles.
// JUMP and DEEPEST come from the host (model.py). Words are laid out (word, pixel). A launch covers
// cycles first .. first + n - 1 of its words.

#ifdef TRANSFER
#define TRANSFERRED(add) transfer(add)
#else
#define TRANSFERRED(add) (add)
#endif

#ifdef SHOT_NOISE
#define NOISE_PARAMETERS , const uint16 pixel, __global const long *table, const uint seed
#define NOISE_ARGUMENTS , pixel, table, seed
#else
#define NOISE_PARAMETERS
#define NOISE_ARGUMENTS
#endif

// Charge that is lost in the dead time of a spike; `add` is the light of its cycle.
#ifdef DEAD_TIME
#define LOST(add) (((add) >> 16) * dead)
#define DEAD_PARAMETER , const long16 add, const long dead
#define DEAD_ARGUMENTS(add) , add, dead
#else
#define LOST(add) ((long16)(0))
#define DEAD_PARAMETER
#define DEAD_ARGUMENTS(add)
#endif

// Starts the next interval in lanes with `fired`; `d` is the deficit after the light of the cycle.
#ifdef RESET_HARD
#define START(d, fired, threshold, add) select(d, (threshold) - 1 + LOST(add), fired)
#else
#define START(d, fired, threshold, add) ((d) + ((fired) & ((threshold) + LOST(add))))
#endif

#if !defined(RAMP) && !defined(DEAD_TIME) && !defined(RESET_HARD) && !defined(RESET_SUBTRACT)
#define WHOLE_FIRST
#endif

// Whether any lane is negative; any() tests the lanes one by one on PoCL.
inline int some(const long16 x)
{
    const long8 a = x.lo | x.hi;
    const long4 b = a.lo | a.hi;
    const long2 c = b.lo | b.hi;
    return (c.x | c.y) < 0;
}

// More than one threshold crossed in a cycle: the charge beyond each stays (residual rule), and the
// latch has one flag. If more than ROOM thresholds are due (`room` = ROOM q, clipped to long), all but
// about JUMP are subtracted at once, at their mean.
inline void settle(long16 *deficit, ulong16 *spikes, const long q, const long room DEAD_PARAMETER
                   NOISE_PARAMETERS)
{
    long16 d = *deficit;
    ulong16 k = *spikes;
    while (some(d)) {
        const long16 deep = d < -room;
        if (some(deep)) {
            const long16 whole = LOST(add) + q;
            const long16 n = max(deep & (-d / whole - JUMP), (long16)(0));
            d += n * whole;
            k += as_ulong16(n);
        }
        const long16 fired = d >> 63;
        k -= as_ulong16(fired);
#ifdef SHOT_NOISE
        d += fired & (LOST(add) + next_threshold(k NOISE_ARGUMENTS));
#else
        d += fired & (LOST(add) + q);
#endif
    }
    *deficit = d;
    *spikes = k;
}

#ifdef SHOT_NOISE
// From spike to spike: `begin` to `stop` (at most 64) of one pair of words. The number of cycles to the
// next spike is estimated in float and corrected in integers, so the result has no rounding error.
inline ulong16 expose_window(long16 *deficit, ulong16 *spikes, const long16 add, const long16 slope,
                             const long begin, const long stop, const long q, const long room,
                             const long dead NOISE_PARAMETERS)
{
    long16 d = *deficit, at = begin;
    ulong16 k = *spikes, bits = 0;
    uint16 words[BATCH + 4], slot = 0;
    uint used = BATCH;
#ifndef RAMP
    const float16 reciprocal = 1.0f / convert_float16(max(add, 1L));
#endif
    for (;;) {
        const long16 left = stop - at;
        // n: cycles that can be run before the deficit turns negative, at most `left`.
#ifdef RAMP
        const long16 now = add + slope * (at - begin);
        const float16 s = convert_float16(slope), charge = convert_float16(d);
        const float16 b = convert_float16(now) - 0.5f * s;
        // charge = n b + n^2 s / 2, solved without cancellation; no root means no spike.
        const float16 square = b * b + 2.0f * s * charge;
        const float16 root = 2.0f * charge / fmax(b + sqrt(fmax(square, 0.0f)), 1.0f);
        const float16 most = convert_float16(left);
        const float16 guess = fmax(select(fmin(root, most), most, square < 0.0f), 0.0f);
        long16 n = convert_long16(convert_int16(guess));
        long16 rest = d - n * now - slope * ((n * (n - 1)) >> 1);
        while (some(rest & (n > 0))) {
            const long16 over = (rest >> 63) & (n > 0);
            n += over;
            rest += over & (slope * n + now);
        }
        for (;;) {
            const long16 more = rest - (now + slope * n);
            const long16 go = ~(more >> 63) & (n < left);
            if (!some(go))
                break;
            rest = select(rest, more, go);
            n -= go;
        }
        const long16 last = now + slope * n;
#else
        const float16 guess = fmax(fmin(convert_float16(d) * reciprocal, convert_float16(left)), 0.0f);
        long16 n = convert_long16(convert_int16(guess));
        long16 rest = d - n * add;
        const long16 over = (rest >> 63) & (n > 0);
        n += over;
        rest += over & add;
        const long16 go = (rest >= add) & (n < left);
        n -= go;
        rest -= go & add;
        const long16 last = add;
#endif
        const long16 fired = n < left;
        d = rest - (fired & last);
        if (!some(fired))
            break;
        at += n;
        bits |= as_ulong16(fired) & ((ulong16)(1) << as_ulong16(at & 63));
        at -= fired;
        k -= as_ulong16(fired);
        if (used == BATCH) {
            draw_batch(words, k, pixel, seed);
            slot = convert_uint16(k) & 3;
            used = 0;
        }
        // A lane that did not fire has reached its end and draws no more; the others stay in step.
        d = START(d, fired, threshold(batch_word(words, used++, slot), table), last);
#if defined(RESET_SUBTRACT)
        d = max(d, (long16)(DEEPEST));
#elif !defined(RESET_HARD)
        if (some(d)) {
            settle(&d, &k, q, room DEAD_ARGUMENTS(last) NOISE_ARGUMENTS);
            used = BATCH;
        }
#endif
    }
    *deficit = d;
    *spikes = k;
    return bits;
}
#endif

__kernel void expose(__global long *deficit, __global uint *spikes_low, __global uint *spikes_high,
                     __global const uint *pixels, __global const long *charge,
                     __global const long *slopes, __global const long *table,
                     __global uint *words, const long q, const long room, const uint seed,
                     const uint first, const uint n, const long elapsed,
                     const long dead, const uint groups)
{
    const size_t g = get_global_id(0), stride = groups;
    if (g >= groups)
        return;
    const uint end = first + n;
    long16 d = vload16(g, deficit);
    long16 add = TRANSFERRED(vload16(g, charge));
#ifdef RAMP
    const long16 slope = vload16(g, slopes);
    add += slope * elapsed;
#else
    const long16 slope = 0;
#endif
#ifdef SHOT_NOISE
    const uint16 pixel = vload16(g, pixels);
    ulong16 k = convert_ulong16(vload16(g, spikes_low)) |
                (convert_ulong16(vload16(g, spikes_high)) << 32);
    for (uint c = first; c < end;) {
        const uint pair = c >> 6, begin = c & 63, stop = min(64u, end - (pair << 6));
        const ulong16 bits = expose_window(&d, &k, add, slope, begin, stop, q, room, dead
                                           NOISE_ARGUMENTS);
        const size_t low = 2 * pair * stride + g, high = low + stride;
        if (begin < 32)
            vstore16((begin ? vload16(low, words) : (uint16)(0)) | convert_uint16(bits), low, words);
        if (stop > 32)
            vstore16((begin > 32 ? vload16(high, words) : (uint16)(0)) | convert_uint16(bits >> 32),
                     high, words);
        add += slope * (long)(stop - begin);
        c = (pair << 6) + stop;
    }
    vstore16(convert_uint16(k), g, spikes_low);
    vstore16(convert_uint16(k >> 32), g, spikes_high);
#else
    ulong16 k = 0;
#ifdef WHOLE_FIRST
    // Constant light, no noise, `residual`: whole thresholds of an increment make the pixel fire in
    // every cycle and leave the deficit unchanged.
    const long16 whole = add / q;
    const uint16 always = convert_uint16(as_ulong16(whole > 0));
    add -= whole * q;
#endif
    for (uint c = first; c < end;) {
        const uint w = c >> 5, begin = c & 31, stop = min(32u, end - (w << 5));
        // Bits are collected in 64-bit lanes, like the charge, and converted once a word.
        ulong16 bits = begin ? convert_ulong16(vload16(w * stride + g, words)) : (ulong16)(0);
        for (uint b = begin; b < stop; b++) {
            d -= add;
            const long16 fired = d >> 63;
            bits |= as_ulong16(fired) & (1ul << b);
            d = START(d, fired, (long16)(q), add);
#if defined(RESET_SUBTRACT)
            d = max(d, (long16)(DEEPEST));
#elif !defined(WHOLE_FIRST) && !defined(RESET_HARD)
            if (some(d))
                settle(&d, &k, q, room DEAD_ARGUMENTS(add) NOISE_ARGUMENTS);
#endif
#ifdef RAMP
            add += slope;
#endif
        }
        uint16 word = convert_uint16(bits);
#ifdef WHOLE_FIRST
        word |= always & (0xFFFFFFFFu >> (32 - (stop - begin)) << begin);
#endif
        vstore16(word, w * stride + g, words);
        c = (w << 5) + stop;
    }
#endif
    vstore16(d, g, deficit);
}

// Whether any lane of sixteen is negative.
#if defined(__AVX512DQ__) && __has_builtin(__builtin_ia32_cvtd2mask512)
typedef int plain16 __attribute__((vector_size(64)));
typedef union { int16 v; plain16 p; } either16; // builtins take the vector types of the compiler
inline int some_int(const int16 v)
{
    const either16 lanes = {v};
    return __builtin_ia32_cvtd2mask512(lanes.p) != 0;
}
#else
inline int some_int(const int16 v)
{
    const int8 a = v.lo | v.hi;
    const int4 b = a.lo | a.hi;
    return (b.x | b.y | b.z | b.w) < 0;
}
#endif

#if defined(RESET_HARD) || defined(RESET_SUBTRACT)
#define ONE_A_CYCLE
#endif

#ifdef SHOT_NOISE
#define WORDS (BATCH + 4)
// Word `at`, 0 to 11, of each lane; lanes fire out of step if the light of all changes at once.
inline uint16 picked(const uint16 *words, const uint16 at)
{
    const int16 one = (at & 1) != 0, two = (at & 2) != 0, four = (at & 4) != 0;
    const int16 eight = (at & 8) != 0;
    uint16 pairs[WORDS / 2], fours[WORDS / 4];
    for (uint i = 0; i < WORDS / 2; i++)
        pairs[i] = select(words[2 * i], words[2 * i + 1], one);
    for (uint i = 0; i < WORDS / 4; i++)
        fours[i] = select(pairs[2 * i], pairs[2 * i + 1], two);
    return select(select(fours[0], fours[1], four), fours[2], eight);
}
#endif

// Entries of `spans`: first cycle, cycles, index of the charge, index of the slope (-1: none), elapsed
// cycles, index of the charge by which the comparison of the single cycle is early (-1: none). Spans
// follow each other without gaps.
#define ENTRY 6
__kernel WIDE void walk(__global long *deficit, __global uint *spikes_low,
                        __global uint *spikes_high, __global const uint *pixels,
                        __global const long *table, __global uint *words, const long q,
                        const long room, const uint seed, const long dead, const uint groups,
                        __global const long *spans, const uint n_spans,
                        __global const long *a0, __global const long *a1, __global const long *a2,
                        __global const long *a3, __global const long *a4, __global const long *a5,
                        __global const long *a6, __global const long *a7)
{
    const size_t g = get_global_id(0), stride = groups;
    if (g >= groups)
        return;
    __global const long *planes[PLANES] = {a0, a1, a2, a3, a4, a5, a6, a7};
    long16 d = vload16(g, deficit);
    ulong16 k = 0;
#ifdef SHOT_NOISE
    const uint16 pixel = vload16(g, pixels);
    k = convert_ulong16(vload16(g, spikes_low)) | (convert_ulong16(vload16(g, spikes_high)) << 32);
    uint16 drawn[WORDS], slot = WORDS, at = WORDS; // k + at - slot is the current interval
#endif
    uint c = spans[0];
    uint16 bits = c & 31 ? vload16((c >> 5) * stride + g, words) : (uint16)(0);
    for (uint s = 0; s < n_spans; s++) {
        __global const long *span = spans + s * ENTRY;
        const uint end = span[0] + span[1];
        long16 add = vload16(g, planes[span[2]]), slope = 0;
        if (span[3] >= 0) {
            slope = vload16(g, planes[span[3]]);
            add += slope * span[4];
        }
        long16 early = 0;
        if (span[5] >= 0)
            early = vload16(g, planes[span[5]]);
        for (; c < end; c++, add += slope) {
            const long16 now = TRANSFERRED(add);
            d -= now + early;
            if (some(d)) {
                long16 fired = d >> 63;
                uint16 f = convert_uint16(as_ulong16(fired));
                bits |= f & (1u << (c & 31));
#ifdef SHOT_NOISE
                for (;;) {
                    if (some_int(WORDS - 1 - as_int16(at))) {
                        k += convert_ulong16(at - slot);
                        draw_batch(drawn, k + 1, pixel, seed);
                        at = slot = convert_uint16(k + 1) & 3;
                    }
                    d = START(d, fired, threshold(picked(drawn, at), table), now);
                    at -= f;
#ifdef ONE_A_CYCLE
                    break;
#else
                    if (!some(d))
                        break;
                    if (some(d < -room)) {
                        k += convert_ulong16(at - slot);
                        at = slot = WORDS;
                        settle(&d, &k, q, room DEAD_ARGUMENTS(now) NOISE_ARGUMENTS);
                        break;
                    }
                    fired = d >> 63;
                    f = convert_uint16(as_ulong16(fired));
#endif
                }
#else
                d = START(d, fired, (long16)(q), now);
#ifndef ONE_A_CYCLE
                if (some(d))
                    settle(&d, &k, q, room DEAD_ARGUMENTS(now) NOISE_ARGUMENTS);
#endif
#endif
#ifdef RESET_SUBTRACT
                d = max(d, (long16)(DEEPEST));
#endif
            }
            d += early;
            if ((c & 31) == 31) {
                vstore16(bits, (c >> 5) * stride + g, words);
                bits = 0;
            }
        }
    }
    if (c & 31)
        vstore16(bits, (c >> 5) * stride + g, words);
#ifdef SHOT_NOISE
    k += convert_ulong16(at - slot);
    vstore16(convert_uint16(k), g, spikes_low);
    vstore16(convert_uint16(k >> 32), g, spikes_high);
#endif
    vstore16(d, g, deficit);
}
