// Charge of a cycle in integers, and whole thresholds of pixels that fire in every cycle.
//   DEAD_TIME  each spike loses the share `dead` of its cycle's light

#define SCALE ((float)one)
#define LIMIT ((float)CAP / (float)one)

#ifdef DEAD_TIME
#define LOST_OF(add, share) convert_int16(convert_float16(add) * (share))
#else
#define LOST_OF(add, share) (int16)(0)
#endif
// Without these, a deficit is below the longest threshold.
#if defined(DEAD_TIME) || FLAGS & JITTER_FLAG
#define BELOW(d, add) ((d) < (add))
#else
#define BELOW(d, add) (int16)(-1)
#endif

#define LOST(add) LOST_OF(add, dead)

// Light that a spike of a cycle loses. A cycle whose length has noise has another light, but its
// dead time stays: its last weight is that of a cycle without noise over its own.
#if FLAGS & TIMING_FLAG
#define TIMED 1
#define LOST_NOW(add, weight, others) LOST_OF(add, dead * (weight)[others])
#else
#define TIMED 0
#define LOST_NOW(add, weight, others) LOST(add)
#endif

inline int16 units_of(const float16 rate, const int one)
{
    return convert_int16(held(rate, LIMIT) * SCALE + 0.5f);
}

// Largest m with m x part <= whole; both are >= 0 and below 2^31, part > 0.
inline int16 multiple(const int16 whole, const int16 part)
{
    int16 m = convert_int16(convert_float16(whole) / convert_float16(part));
    m += (m * part > whole);
    m -= (whole - m * part >= part);
    return m;
}

// Runs n cycles of lanes that fire in every cycle and whose deficit is below their light: subtracts
// thresholds of the mean `whole` until 0 to whole - 1 is left. Adds their number to *count.
inline int16 run_over(const int16 d, const int16 n, const int16 add, const int16 whole,
                      uint16 *count, const int16 lanes)
{
    const int16 each = multiple(add, whole), part = add - each * whole;
    // The products overflow, but their difference is small.
    const float16 guess = (convert_float16(n) * convert_float16(part) - convert_float16(d)) /
                          convert_float16(whole);
    int16 m = convert_int16(guess);
    int16 r = as_int16(as_uint16(d) + as_uint16(m) * as_uint16(whole) - as_uint16(n) * as_uint16(part));
    for (uint i = 0; i < 2; i++) {
        m -= (r < 0);
        r += (r < 0) & whole;
    }
    m += (r >= whole);
    r -= (r >= whole) & whole;
    *count += as_uint16(lanes & (n * each + m));
    return select(d, r, lanes);
}
