// Groups without noise and dead time. Charge is a phase in 2^-32 of a threshold, whose carry is the
// spike. Whole thresholds of a cycle make it fire and leave the phase unchanged.

#define SCALE 0x1p32f
#define LIMIT 1.0f

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
    const float16 rate = TRANSFERRED(LEVEL(plane));
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

__kernel WIDE void moving(__global uint *charge, MOVING_PARAMETERS, PLANE_PARAMETERS)
{
    MOVING_GROUP
    uint16 phase = vload16(g, charge);
    WALK(const uint16 add = convert_uint16(units + 0.5f); phase += add;
         bits |= as_uint16(phase < add) & bit;,
         uint16 always; const uint16 add = phase_of(rate, &always); phase += add;
         bits |= (always | as_uint16(phase < add)) & bit;)
    vstore16(phase, g, charge);
}
