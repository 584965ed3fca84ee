// Groups without noise and dead time. Charge is a phase in 2^-32 of a threshold, whose carry is the
// spike. Whole thresholds of a cycle make it fire and leave the phase unchanged.

#define SCALE 0x1p32f
#define MARGIN 0x1p-20f

// Phase that a cycle adds. It is truncated, as PoCL maps only truncation to an instruction.
inline uint16 phase_of(const float16 rate, uint16 *always)
{
    const float16 whole = convert_float16(convert_int16(rate));
    *always = as_uint16(rate >= 1.0f);
    return convert_uint16((rate - whole) * SCALE + 0.5f);
}

__kernel WIDE void steady(__global uint *charge, STEADY_PARAMETERS)
{
    STEADY_GROUP
    uint16 always, phase = vload16(g, charge);
    const float16 rate = TRANSFERRED(LIGHT_OF(plane, factor, row, x));
    REPORT
    const uint16 add = phase_of(rate, &always);
    uint c = 0;
    for (; c + 32 <= cycles; c += 32) {
        uint16 word = always;
#pragma unroll
        for (uint b = 0; b < 32; b++) {
            phase += add;
            word |= as_uint16(phase < add) & (1u << b);
        }
        store_word(word, words + (c >> 5) * stride, row, x, width);
    }
    if (c < cycles) {
        uint16 word = always & ((1u << (cycles & 31)) - 1);
        for (uint b = 0; b < (cycles & 31); b++) {
            phase += add;
            word |= as_uint16(phase < add) & (1u << b);
        }
        store_word(word, words + (c >> 5) * stride, row, x, width);
    }
    vstore16(phase, g, charge);
}

// Cycles within one word of the output and one of the clock.
#define STOP(end) min(min(end, (c | 31) + 1), c + 32 - ((start + c) & 31))
#define RAMP_CYCLE(bit)                                                                           \
    EACH                                                                                          \
    {                                                                                             \
        phase[i] += add[i];                                                                       \
        bits[i] |= as_uint16(phase[i] < add[i]) & (bit);                                          \
        add[i] += slope[i];                                                                       \
    }

// The light of a ramp is a whole number of phase units that grows by another in each cycle. The
// growth is even, to fit in an int. Light that falls to 0 is rounded upwards, so that it does not
// fall below. A ramp that passes one threshold a cycle before its next anchor is not simple.
__kernel WIDE void moving(__global uint *charge, const uint start, MOVING_PARAMETERS,
                          PLANE_PARAMETERS)
{
    MOVING_GROUPS
    uint c = segments[0];
    CHECK
    float16 levels[PLANES][GROUPS];
    for (uint p = 0; p < n_planes; p++)
        EACH
        {
            GAINS_OF(g[i])
            levels[p][i] = LIGHT_OF(planes[p], factor[p], row, x[i]);
        }
    REPORT
    uint16 phase[GROUPS], bits[GROUPS];
    EACH
    {
        phase[i] = vload16(g[i], charge);
        bits[i] = c & 31 ? load_word(words + (c >> 5) * stride, row, x[i], width) : (uint16)(0);
    }
    const uint at_row = rows > 1 ? row - y0 : 0;
    for (uint s = 0; s < n_segments; s++) {
        __global const int *segment = segments + s * SEGMENT;
        const uint end = segment[0] + segment[1], others = segment[4], jump = rows * others;
        const uint first = segment[3], final = segment[others ? 5 : 3];
        const int anchored = segment[5 + PLANES];
        __global const float *weight = weights + segment[2] + at_row * others;
        __global const float *anchor = weights + anchored + 3 * at_row;
        const float grows = as_float(segment[6 + PLANES]);
        while (c < end) {
            const uint stop = STOP(end);
            const float from = anchored ? anchor[0] : others ? weight[0] : 0.0f;
            const uint since = anchored ? c - (uint)(int)anchor[1] : 0;
            const uint further = anchored ? (uint)anchor[2] - 1 : 0;
            uint16 add[GROUPS], slope[GROUPS], always[GROUPS];
            int simple[GROUPS], all_simple = 1;
            EACH
            {
                const float16 step = levels[final][i] - levels[first][i], growth = step * grows;
                const float16 begin = lit(levels[first][i] + from * step);
                const float16 last = begin + (float)further * growth;
                const int16 below = as_int16((begin > last ? begin : last) - (1 - MARGIN));
                const int16 above = as_int16((1 + MARGIN) - (begin < last ? begin : last));
                simple[i] = LINEAR && others <= 1 &&
                            !some((~below & ~above) | as_int16(0.25f - fabs(growth)));
                all_simple &= simple[i];
                const int16 half_growth = convert_int16(growth * (0.5f * SCALE));
                const uint16 fall = as_uint16((half_growth >> 31) & -half_growth) * (2 * further);
                slope[i] = 2 * as_uint16(half_growth);
                const uint16 from_units = phase_of(begin, &always[i]);
                add[i] = max(from_units, fall & ~always[i]) + since * slope[i];
            }
            if (all_simple) {
                if (stop - c == 32) {
                    EACH bits[i] = always[i];
                    // Unrolled, so that each bit is a constant.
                    _Pragma("unroll") for (uint b = 0; b < 32; b++)
                        RAMP_CYCLE(1u << b)
                } else
                    for (uint bit = 1u << (c & 31), n = stop - c; n; n--, bit <<= 1) {
                        EACH bits[i] |= always[i] & bit;
                        RAMP_CYCLE(bit)
                    }
                weight += jump * (stop - c);
                c = stop;
            } else
                for (; c < stop; c++, weight += jump) {
                    const uint bit = 1u << (c & 31);
                    EACH
                    {
                        uint16 units = add[i], certain = always[i];
                        if (!simple[i]) {
                            const float16 base = levels[first][i];
                            float16 rate = base;
                            for (uint j = 0; j < others; j++)
                                rate = rate + weight[j] * (levels[segment[5 + j]][i] - base);
                            units = phase_of(TRANSFERRED(lit(rate)), &certain);
                        }
                        phase[i] += units;
                        bits[i] |= (certain | as_uint16(phase[i] < units)) & bit;
                        add[i] += slope[i];
                    }
                }
            if (!((start + c) & 31))
                anchor += 3 * rows;
            if (!(c & 31))
                EACH
                {
                    if (mine[i])
                        store_word(bits[i], words + ((c >> 5) - 1) * stride, row, x[i], width);
                    bits[i] = 0;
                }
        }
    }
    EACH if (mine[i])
    {
        if (c & 31)
            store_word(bits[i], words + (c >> 5) * stride, row, x[i], width);
        vstore16(phase[i], g[i], charge);
    }
}
