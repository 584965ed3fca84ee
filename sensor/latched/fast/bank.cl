// Groups that draw from the bank (sensor/latched/pixel/bank.py), cycle by cycle. The state is the
// deficit, threshold - charge - 1, whose sign is the spike, and the latest spike: the number of the
// cycle after it times 2, plus 1 if another threshold was crossed in its cycle; 0 before the first.
//   DEAD_TIME                    each spike loses a share of its cycle's light (charge.cl)
//   RESET_HARD, RESET_SUBTRACT   reset rules other than `residual`: at most one threshold a cycle
// A work-item steps several groups at a time, to hide the latency of each.

#define TOP_BIT 0x80000000u

#define BANK_PARAMETERS                                                                           \
    __global uint *charge, __global uint *latest, __global const uint *keys,                      \
        __global const int *bank, __global const uint *steps, const uint start,                   \
        const float dead, const int one, const int shortest, const int over                       \
        MOVE_PARAMETERS

#define WHOLE(rate) rounded(held(rate, LIMIT) * SCALE)

inline uint scrambled(uint word)
{
    word = (word ^ (word >> SHIFT_1)) * FACTOR_1;
    word = (word ^ (word >> SHIFT_2)) * FACTOR_2;
    return word ^ (word >> 16);
}

// States of a group's generator in all cycles of a word; `key` is the hash of the group (bank.py).
// steps: factors and summands that lead there from the first (bank.py).
inline void generate(uint *states, const uint key, const uint cycle, __global const uint *steps)
{
    const uint first = scrambled(key ^ (((cycle & (PERIOD - 1)) >> 5) * WEYL));
    vstore16(first * vload16(0, steps) + vload16(2, steps), 0, states);
    vstore16(first * vload16(1, steps) + vload16(3, steps), 1, states);
}

// Thresholds of the first, the second and a further crossing of a cycle.
#define FIRST(state) as_uint16(vload16(0, bank + ((state) >> (32 - BANK_BITS))))
#define SECOND(state) as_uint16(vload16(0, bank + (((state) >> 8) & ((1 << BANK_BITS) - 1))))
#define FURTHER(state, n) FIRST(scrambled((state) + (n)))

#define PUSH(bits, sign) bits = (bits >> 1) | ((sign) & TOP_BIT)

// A cycle whose light crosses at most one threshold. All numbers are below 2^31, and a difference
// wraps where it is negative, so that the smaller one is the deficit that is left.
#if defined(RESET_HARD)
#define AFTER(r, threshold) as_uint16(select(as_int16(r), as_int16((threshold) - 1), as_int16(r)))
#elif defined(RESET_SUBTRACT)
#define AFTER(r, threshold)                                                                       \
    as_uint16(max(as_int16(r + (as_uint16(as_int16(r) >> 31) & (threshold))), (int16)(DEEPEST)))
#else
#define AFTER(r, threshold) min(r, r + (threshold))
#endif
#define ONCE(i)                                                                                   \
    {                                                                                             \
        const uint16 r = d[i] - add;                                                              \
        d[i] = AFTER(r, FIRST(states[i][at]) + lost);                                             \
        PUSH(word[i], r);                                                                         \
    }

#if defined(RESET_HARD) || defined(RESET_SUBTRACT)
#define ANY(i) ONCE(i)
#else
// Light below two thresholds.
#define TWICE(i)                                                                                  \
    {                                                                                             \
        const uint16 r = d[i] - add;                                                              \
        const uint16 fired = as_uint16(as_int16(r) >> 31);                                        \
        const uint16 rest = r + (fired & (FIRST(states[i][at]) + lost));                          \
        d[i] = min(rest, rest + SECOND(states[i][at]) + lost);                                    \
        PUSH(word[i], r);                                                                         \
        PUSH(again[i], rest);                                                                     \
    }

// Any light. Where it reaches `over`, the pixel fires at any deficit, and whole thresholds are
// subtracted at their mean.
#define ANY(i)                                                                                    \
    any_cycle(&d[i], &word[i], &again[i], as_int16(add), as_int16(lost), bank, states[i][at],     \
              one, over);
inline void any_cycle(uint16 *d, uint16 *word, uint16 *again, const int16 add, const int16 lost,
                      __global const int *bank, const uint state, const int one, const int over)
{
    const int16 certain = (add >= over + lost) & (as_int16(*d) < add);
    int16 r = as_int16(*d) - add;
    PUSH(*word, as_uint16(r | certain));
#ifdef DEAD_TIME
    if (some(certain)) {
        uint16 count = 0;
        r = select(r, run_over(as_int16(*d), (int16)(1), add, one + lost, &count, certain), certain);
    }
#else
    r = select(r, r & (one - 1), certain);
#endif
    int16 rest = r + ((r >> 31) & (as_int16(FIRST(state)) + lost));
    PUSH(*again, as_uint16(rest));
    if (some(rest)) {
        rest += (rest >> 31) & (as_int16(SECOND(state)) + lost);
        for (uint n = 2; some(rest); n++)
            rest += (rest >> 31) & (as_int16(FURTHER(state, n)) + lost);
    }
    *d = as_uint16(rest);
}
#endif

// Which of these light allows: 0 for ONCE, 1 for TWICE, 2 for ANY, 3 if it may reach CAP. most: the
// most light of a cycle, in units. The margins are wider than the rounding of a ramp.
#define EASY_CAP ((float)CAP * (1 - 0x1p-20f))
inline int way_of(const float16 most, const int shortest)
{
    const float16 up = most * (1 + 0x1p-20f) + 64.0f;
    return some(as_int16((float)shortest - up)) + some(as_int16(2 * (float)shortest - up)) +
           some(as_int16(EASY_CAP - most));
}
#ifdef TWICE
#define BY_WAY(way, ONCE_LOOP, TWICE_LOOP, ANY_LOOP)                                              \
    if (way == 0) {                                                                               \
        const uint from = c;                                                                      \
        ONCE_LOOP                                                                                 \
        EACH again[i] >>= (c - from) & 31; /* 0 after a whole word, in which there are none */    \
    } else if (way == 1)                                                                          \
        TWICE_LOOP                                                                                \
    else                                                                                          \
        ANY_LOOP
#else
#define BY_WAY(way, ONCE_LOOP, TWICE_LOOP, ANY_LOOP) ONCE_LOOP
#endif

#if FLAGS & JITTER_FLAG
#define MOVES                                                                                     \
    uint16 own[GROUPS];                                                                           \
    float16 knots[GROUPS], next_knots[GROUPS];                                                    \
    EACH                                                                                          \
    {                                                                                             \
        MOVES_OF(own[i], knots[i], next_knots[i], g[i], c)                                        \
    }
#define EARLY(i)                                                                                  \
    const uint16 early = as_uint16(EARLY_OF(as_int16(add), own[i], knots[i], next_knots[i]));     \
    d[i] -= early;
#define LATE(i) d[i] += early;
#else
#define MOVES
#define EARLY(i)
#define LATE(i)
#endif

// Cycles up to `stop`, within one word of the output and one of the generator.
#define LOOP(LIGHT, STEP)                                                                         \
    for (uint at = (start + c) & 31; c < stop; c++, at++, weight += jump) {                       \
        EACH                                                                                      \
        {                                                                                         \
            LIGHT(i)                                                                              \
            EARLY(i)                                                                              \
            STEP(i)                                                                               \
            LATE(i)                                                                               \
        }                                                                                         \
    }
#define UNTIL(end) min(min(end, (c | 31) + 1), c + 32 - ((start + c) & 31))

// Groups `g` of a work-item; those that are not `mine` are padding and are not stored.
#define GROUP_STATE                                                                               \
    uint16 d[GROUPS], word[GROUPS], again[GROUPS], last[GROUPS];                                  \
    uint key[GROUPS], states[GROUPS][32];                                                         \
    EACH                                                                                          \
    {                                                                                             \
        d[i] = vload16(g[i], charge);                                                             \
        last[i] = vload16(g[i], latest);                                                          \
        key[i] = keys[g[i]];                                                                      \
        generate(states[i], key[i], start + c, steps);                                            \
        word[i] = again[i] = 0;                                                                   \
    }                                                                                             \
    uint begun = c;
#define KEEP_GROUPS                                                                               \
    EACH if (mine[i])                                                                             \
    {                                                                                             \
        STORE16(d[i], charge + 16 * (size_t)g[i]);                                                        \
        STORE16(last[i], latest + 16 * (size_t)g[i]);                                                     \
    }

// The latest spike of each lane, if there is one in the cycles up to `cycle`; the top bits are the
// latest.
inline uint16 latest_of(const uint16 word, const uint16 again, const uint cycle, const uint16 before)
{
    const uint16 away = leading_zeros(word);
    const uint16 found = ((cycle - away) << 1) | ((again << (away & 31)) >> 31);
    return select(before, found, as_int16(word) != 0);
}

// Cycles `begun` to `c` of a word; the others keep their bits.
inline void store_part(const uint16 word, const uint begun, const uint c, __global uint *words,
                       const uint row, const uint x, const uint width)
{
    uint16 out = word >> (-c & 31);
    if (begun & 31)
        out |= load_word(words, row, x, width);
    store_word(out, words, row, x, width);
}

// After each loop: the next word of the generator and of the output, where they begin.
#define NEXT_WORDS(ROW, X)                                                                        \
    if (!((start + c) & 31))                                                                      \
        EACH generate(states[i], key[i], start + c, steps);                                       \
    if (!(c & 31)) {                                                                              \
        STORE_WORDS(ROW, X)                                                                       \
        begun = c;                                                                                \
    }
#define STORE_WORDS(ROW, X)                                                                       \
    EACH                                                                                          \
    {                                                                                             \
        last[i] = latest_of(word[i], again[i], start + c, last[i]);                               \
        if (mine[i])                                                                              \
            store_part(word[i], begun, c, words + (begun >> 5) * stride, ROW, X, width);          \
        word[i] = again[i] = 0;                                                                   \
    }

// Memory that the work-item after the next reads, where one work-item follows another.
#define AWAY 2
#if defined(IN_TURN) && __has_builtin(__builtin_prefetch)
#define AHEAD(at) __builtin_prefetch((const void *)(size_t)(at));
#else
#define AHEAD(at)
#endif
#ifdef PATTERN
#define GAINS_AHEAD(g) AHEAD(gains + 16 * ((g) + AWAY * GROUPS)) AHEAD(darks + 16 * ((g) + AWAY * GROUPS))
#else
#define GAINS_AHEAD(g)
#endif
#define STATE_AHEAD(g)                                                                            \
    AHEAD(charge + 16 * ((g) + AWAY * GROUPS))                                                    \
    AHEAD(latest + 16 * ((g) + AWAY * GROUPS))                                                    \
    GAINS_AHEAD(g)

#define STEADY_LIGHT(i) const uint16 add = adds[i], lost = losts[i];
#define STEADY_COURSE(CYCLES)                                                                     \
    while (c < cycles) {                                                                          \
        const uint stop = UNTIL(cycles);                                                          \
        CYCLES                                                                                    \
        NEXT_WORDS(row[i], x[i])                                                                  \
    }                                                                                             \
    if (c & 31)                                                                                   \
        STORE_WORDS(row[i], x[i])                                                                 \
    KEEP_GROUPS

#if !(FLAGS & JITTER_FLAG) // whose light is a course
__kernel WIDE void steady(BANK_PARAMETERS, STEADY_PARAMETERS)
{
    uint g[GROUPS], row[GROUPS], x[GROUPS], c = 0;
    int mine[GROUPS], any = 0;
    EACH
    {
        g[i] = list[GROUPS * get_global_id(0) + i];
        row[i] = ROW_OF(g[i]);
        x[i] = X_OF(g[i]);
        mine[i] = g[i] != 0xFFFFFFFF &&
                  !(row[i] >= y0 && row[i] < y1 && x[i] >= 16 * g0 && x[i] < 16 * g1);
        any |= mine[i];
    }
    if (!any)
        return;
    CHECK
    uint16 adds[GROUPS], losts[GROUPS];
    int way = 0;
    EACH
    {
        STATE_AHEAD(g[i]) // lists are mostly of neighbours
        AHEAD(plane + (size_t)row[i] * width + x[i] + 16 * AWAY * GROUPS)
        if (g[i] == 0xFFFFFFFF) // padding of the list repeats the first group
            g[i] = g[0], row[i] = row[0], x[i] = x[0];
        GAINS_OF(g[i])
        const float16 rate = TRANSFERRED(LIGHT_OF(plane, factor, row[i], x[i]));
        const int16 add = WHOLE(rate);
        adds[i] = as_uint16(add);
        losts[i] = as_uint16(LOST(add));
        way = max(way, way_of(convert_float16(add), shortest));
    }
    REPORT
    GROUP_STATE
    __global const float *weight = 0; // the light does not change
    const uint jump = 0;
    if (way == 0) { // alone, this loop fits in the registers
        STEADY_COURSE(LOOP(STEADY_LIGHT, ONCE))
        return;
    }
    STEADY_COURSE(BY_WAY(way, LOOP(STEADY_LIGHT, ONCE), LOOP(STEADY_LIGHT, TWICE), LOOP(STEADY_LIGHT, ANY)))
}

#endif

// Light of a ramp: a whole number of units that grows by another in each cycle.
#define RAMP_LIGHT(i)                                                                             \
    const int16 whole = adds[i];                                                                  \
    const uint16 add = as_uint16(whole), lost = as_uint16(LOST(whole));                           \
    adds[i] += slopes[i];
// Light of several planes of which none may reach CAP.
#define SUM_LIGHT(i)                                                                              \
    const float16 base = levels[i][first];                                                        \
    float16 level = base;                                                                         \
    for (uint j = 0; j < others; j++)                                                             \
        level = level + weight[j] * (levels[i][segment[5 + j]] - base);                           \
    const int16 whole = rounded(lit(level));                                                      \
    const uint16 add = as_uint16(whole), lost = as_uint16(LOST_NOW(whole, weight, others));
// The same of two planes, whose differences from the base are known.
#define PAIR_LIGHT(i)                                                                             \
    const int16 whole = rounded(lit(bases[i] + weight[0] * steps_of[i] + weight[1] * darks_of[i])); \
    const uint16 add = as_uint16(whole), lost = as_uint16(LOST_NOW(whole, weight, 2));
// The same, or with a map, or beyond CAP.
#define ANY_LIGHT(i)                                                                              \
    int16 whole = adds[i];                                                                        \
    if (!ramps[i]) {                                                                              \
        const float16 base = levels[i][first];                                                    \
        float16 level = base;                                                                     \
        for (uint j = 0; j < others; j++)                                                         \
            level = level + weight[j] * (levels[i][segment[5 + j]] - base);                       \
        const float16 rate = level < 0.0f ? (float16)(0.0f) : level * (1.0f / SCALE);             \
        whole = WHOLE(TRANSFERRED(rate));                                                         \
    }                                                                                             \
    const uint16 add = as_uint16(whole), lost = as_uint16(LOST_NOW(whole, weight, others));       \
    adds[i] += slopes[i];

// All segments, and the state after them. CYCLES steps the cycles up to `stop`, within a word; adds:
// light of the first of them, which grows by `slopes` in each.
#define COURSE(CYCLES)                                                                            \
    for (uint s = 0; s < n_segments; s++) {                                                       \
        __global const int *segment = segments + s * SEGMENT;                                     \
        const uint end = segment[0] + segment[1], others = segment[4];                            \
        const uint jump = rows * (others + TIMED);                                                \
        const uint first = segment[3], final = segment[others ? 5 : 3];                           \
        __global const float *weight = weights + segment[2] + at_row * (others + TIMED);          \
        __global const float *anchor = weights + segment[5 + PLANES] + 3 * at_row;                \
        const float grows = as_float(segment[6 + PLANES]);                                        \
        const int ramp = others && segment[5 + PLANES];                                           \
        EACH AHEAD(planes[final] + (size_t)row * width + x[i] + 16 * AWAY * GROUPS)               \
        while (c < end) {                                                                         \
            const uint stop = UNTIL(end);                                                         \
            int16 adds[GROUPS], slopes[GROUPS];                                                   \
            const float from = ramp ? anchor[0] : 0.0f;                                           \
            const int since = ramp ? (int)c - (int)anchor[1] : 0;                                 \
            EACH                                                                                  \
            {                                                                                     \
                const float16 base = levels[i][first], step = levels[i][final] - base;            \
                slopes[i] = rounded(step * grows);                                                \
                adds[i] = rounded(base + from * step);                                            \
            }                                                                                     \
            if (since)                                                                            \
                EACH adds[i] += since * slopes[i];                                                \
            CYCLES                                                                                \
            if (!((start + c) & 31))                                                              \
                anchor += 3 * rows;                                                               \
            NEXT_WORDS(row, x[i])                                                                 \
        }                                                                                         \
    }                                                                                             \
    if (c & 31)                                                                                   \
        STORE_WORDS(row, x[i])                                                                    \
    KEEP_GROUPS

// Cycles of planes of light below CAP. With noise of the instants there are mostly two, of which the
// second gathers nothing.
#define BY_COUNT(STEP)                                                                            \
    if (others == 2) {                                                                            \
        float16 bases[GROUPS], steps_of[GROUPS], darks_of[GROUPS];                                \
        EACH                                                                                      \
        {                                                                                         \
            bases[i] = levels[i][first];                                                          \
            steps_of[i] = levels[i][final] - bases[i];                                            \
            darks_of[i] = levels[i][segment[6]] - bases[i];                                       \
        }                                                                                         \
        LOOP(PAIR_LIGHT, STEP)                                                                    \
    } else                                                                                        \
        LOOP(SUM_LIGHT, STEP)
// Cycles of any light.
#define LIGHT_WAY                                                                                 \
    const int way = max(ways[first], ways[final]);                                                \
    const int linear = LINEAR && !TIMED && (!others || ramp);
#define MIXED_LIGHT                                                                               \
    {                                                                                             \
        int ramps[GROUPS];                                                                        \
        EACH ramps[i] = linear && !((beyond[first] | beyond[final]) & (1 << i));                  \
        LOOP(ANY_LIGHT, ANY)                                                                      \
    }
#define BY_LIGHT                                                                                  \
    LIGHT_WAY                                                                                     \
    if (linear && way < 3)                                                                        \
        BY_WAY(way, LOOP(RAMP_LIGHT, ONCE), LOOP(RAMP_LIGHT, TWICE), LOOP(RAMP_LIGHT, ANY))       \
    else                                                                                          \
        MIXED_LIGHT

__kernel WIDE void moving(BANK_PARAMETERS, MOVING_PARAMETERS, PLANE_PARAMETERS)
{
    MOVING_GROUPS
    uint c = segments[0];
    CHECK
    // Light of each plane in units; all are loaded at once, to overlap memory latency.
    float16 levels[GROUPS][PLANES];
    float16 top = 0.0f;
    for (uint p = 0; p < n_planes; p++) {
        float16 most = 0.0f;
        EACH
        {
            GAINS_OF(g[i])
            const float16 level = LIGHT_OF(planes[p], factor[p], row, x[i]) * SCALE;
            most = most > level ? most : level;
            levels[i][p] = level;
        }
        top = top > most ? top : most;
    }
    EACH
    {
        AHEAD(planes[0] + (size_t)row * width + x[i] + 16 * AWAY * GROUPS)
        STATE_AHEAD(g[i])
    }
    REPORT
    GROUP_STATE
    MOVES
    const uint at_row = rows > 1 ? row - y0 : 0;
    const int highest = way_of(top * MOVED_MOST, shortest);
    if (LINEAR && !TIMED && !highest) { // below one threshold a cycle: it fits in the registers
        COURSE(if (!others || ramp) LOOP(RAMP_LIGHT, ONCE) else LOOP(SUM_LIGHT, ONCE))
        return;
    }
#if TIMED
    // The longest cycle, in cycles without noise.
    float longest = 1.0f;
    for (uint s = 0; s < n_segments; s++)
        longest = max(longest, as_float(segments[s * SEGMENT + 6 + PLANES]));
    const int timed = LINEAR ? way_of(top * longest * MOVED_MOST, shortest) : 3;
    if (timed == 0) {
        COURSE(BY_COUNT(ONCE))
        return;
    }
#ifdef TWICE
    if (timed == 1) {
        COURSE(BY_COUNT(TWICE))
        return;
    }
#endif
#endif
    int ways[PLANES], beyond[PLANES]; // bits of the groups whose light may reach CAP
    for (uint p = 0; p < n_planes; p++) {
        float16 most = 0.0f;
        EACH most = most > levels[i][p] ? most : levels[i][p];
        ways[p] = highest ? way_of(most * MOVED_MOST, shortest) : 0;
        beyond[p] = 0;
        if (ways[p] == 3)
            EACH beyond[p] |= some(as_int16(EASY_CAP - levels[i][p])) << i;
    }
    COURSE(BY_LIGHT)
}
