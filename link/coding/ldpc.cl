// Decoding of low-density parity-check words: the bits of link/coding/ldpc_decoding.py. A work-group
// decodes a word; each of its ITEMS work-items takes every ITEMS-th stretch of LANES of the Z checks
// of a row. Defined outside: ITEMS, LANES, Z, ROWS, COLUMNS, FIRST (the first parity column), EDGES,
// DEGREE (the largest of a row), DATA_BITS, WORD_BITS, and MESSAGE,
// OFFSET, SOFT and SUM of ldpc_numpy.py. FAR: messages are in global memory, because the local one
// is too small for them; a work-item reads only its own.

#define SENT (DATA_BITS - 2 * Z)

// OpenCL has vectors of 16; wider ones, which 512-bit registers need, are those of clang.
#if LANES == 64 && __has_builtin(__builtin_elementwise_add_sat)
typedef char lanes __attribute__((ext_vector_type(64)));
typedef lanes anywhere __attribute__((aligned(1)));
#define LOAD(from) (*(const __local anywhere *)(from))
#define LOAD_GLOBAL(from) (*(const __global anywhere *)(from))
#define STORE(value, into) (*(__local anywhere *)(into) = (value))
#define ADD __builtin_elementwise_add_sat
#define SUBTRACT __builtin_elementwise_sub_sat
#define LEAST __builtin_elementwise_min
#define GREATEST __builtin_elementwise_max
#define ANY_NEGATIVE(value) (__builtin_reduce_or(value) < 0)
#else
#if LANES == 64
#undef LANES
#define LANES 16
#endif
#define JOIN(a, b) a##b
#define NAME(a, b) JOIN(a, b)
typedef NAME(char, LANES) lanes;
#define LOAD(from) NAME(vload, LANES)(0, from)
#define LOAD_GLOBAL LOAD
#define STORE(value, into) NAME(vstore, LANES)(value, 0, into)
#define ADD add_sat
#define SUBTRACT sub_sat
#define LEAST min
#define GREATEST max
#define ANY_NEGATIVE(value) any(value)
#endif

#ifdef FAR
#define ROOM __global
#else
#define ROOM __local
#endif
#if ITEMS == 1
#define WAIT
#else
#define WAIT barrier(CLK_LOCAL_MEM_FENCE)
#endif

// A column begins with room for LANES values that are never read; behind its Z values stand the
// first LANES of them again, so that a stretch may be read across its end, and room for LANES more.
#define STRIDE (Z + 3 * LANES)
#define AT(posterior, column) ((posterior) + (column) * STRIDE + LANES)

// Stores a stretch at `at`, below Z, of a column, in all its places.
static inline void put(__local char *column, int at, lanes value) {
    STORE(value, column + at);
    if (at + LANES > Z)
        STORE(value, column + at - Z);
    if (at < LANES)
        STORE(value, column + at + Z);
}

static inline int turned(int stretch, int shift) {
    const int at = stretch * LANES + shift;
    return at < Z ? at : at - Z;
}

// Fills a stretch with ln P(0) - ln P(1) of a word as sent. Bits that are not sent are 0, those
// behind the data, which are zero, as sure as can be.
static inline void load(__local char *posterior, __global const char *soft, int column, int stretch) {
    const bool data = column < FIRST;
    const int start = (data ? column - 2 : column - FIRST) * Z + (data ? 0 : SENT) + stretch * LANES;
    const int end = data ? SENT : WORD_BITS;
    __local char *into = AT(posterior, column);
    union {
        lanes all;
        char each[LANES];
    } value = {0};
    if (start >= 0 && start + LANES <= end)
        value.all = -LEAST(GREATEST(LOAD_GLOBAL(soft + start), (lanes)-SOFT), (lanes)SOFT);
    else if (start >= 0)
        for (int i = 0; i < LANES; i++)
            value.each[i] = start + i < end ? -clamp(soft[start + i], (char)-SOFT, (char)SOFT)
                            : data          ? SUM
                                            : 0;
    put(into, stretch * LANES, value.all);
}

// Answers to the edges of a row, for one stretch of its checks.
static inline void answer(
    __local char *posterior, ROOM char *messages, __global const int2 *edges, int first, int last,
    int stretch) {
    lanes values[DEGREE], least = MESSAGE + OFFSET, second = MESSAGE + OFFSET, sign = 0;
    for (int e = first; e < last; e++) {
        const int at = turned(stretch, edges[e].y);
        const lanes message = LOAD(messages + e * Z + stretch * LANES);
        const lanes value = GREATEST(
            SUBTRACT(LOAD(AT(posterior, edges[e].x) + at), message), (lanes)-SUM);
        const lanes size = GREATEST(value, -value);
        values[e - first] = value;
        second = LEAST(second, GREATEST(least, size));
        least = LEAST(least, size);
        sign ^= value;
    }
    for (int e = first; e < last; e++) {
        const lanes value = values[e - first];
        lanes size = GREATEST(value, -value) == least ? second : least;
        size = GREATEST(size - (lanes)OFFSET, (lanes)0);
        const lanes minus = (sign ^ value) >> (lanes)7;
        const lanes new = (size ^ minus) - minus;
        STORE(new, messages + e * Z + stretch * LANES);
        put(AT(posterior, edges[e].x), turned(stretch, edges[e].y),
            GREATEST(ADD(value, new), (lanes)-SUM));
    }
}

// Whether a check of this work-item fails or one of its bits is undecided.
static inline bool fails(
    __local char *posterior, __global const int *starts, __global const int2 *edges, int item) {
    for (int row = 0; row < ROWS; row++)
        for (int stretch = item; stretch < Z / LANES; stretch += ITEMS) {
            lanes sign = 0;
            for (int e = starts[row]; e < starts[row + 1]; e++)
                sign ^= LOAD(AT(posterior, edges[e].x) + turned(stretch, edges[e].y));
            if (ANY_NEGATIVE(sign))
                return true;
        }
    lanes zero = 0;
    for (int column = 0; column < COLUMNS; column++)
        for (int stretch = item; stretch < Z / LANES; stretch += ITEMS) {
            const lanes value = LOAD(AT(posterior, column) + stretch * LANES);
            zero |= (value - (lanes)1) & ~value; // its sign: that of 0 alone
        }
    return ANY_NEGATIVE(zero);
}

// Eight signs as a byte: one product brings them together, in the highest byte.
static inline uchar pack(__local const char *values) {
    const ulong signs = (as_ulong(vload8(0, values)) & 0x8080808080808080UL) >> 7;
    return (uchar)((signs * 0x0102040810204080UL) >> 56);
}

// soft: (words, WORD_BITS). starts: (ROWS + 1). edges: (EDGES) column and shift, in the order of
// decoding. data: (words, DATA_BITS / 8). ok, spent: (words). far: (words, EDGES, Z), only if FAR.
__kernel __attribute__((reqd_work_group_size(ITEMS, 1, 1))) WIDE void decode(
    __global const char *soft, __global const int *starts, __global const int2 *edges, int rounds,
    __global uchar *data, __global uchar *ok, __global int *spent, __global char *far) {
    __local char posterior[COLUMNS * STRIDE];
    __local int failed;
    const int item = get_local_id(0);
    const size_t word = get_group_id(0);
#ifdef FAR
    __global char *messages = far + word * EDGES * Z;
#else
    __local char messages[EDGES * Z];
#endif
    for (int column = 0; column < COLUMNS; column++)
        for (int stretch = item; stretch < Z / LANES; stretch += ITEMS)
            load(posterior, soft + word * WORD_BITS, column, stretch);
    for (int edge = 0; edge < EDGES; edge++)
        for (int stretch = item; stretch < Z / LANES; stretch += ITEMS)
            STORE((lanes)0, messages + edge * Z + stretch * LANES);
    int round = 0;
    bool again = true;
    while (again && round < rounds) {
        for (int row = 0; row < ROWS; row++) {
            WAIT;
            for (int stretch = item; stretch < Z / LANES; stretch += ITEMS)
                answer(posterior, messages, edges, starts[row], starts[row + 1], stretch);
        }
        round++;
        failed = 0;
        WAIT;
        if (fails(posterior, starts, edges, item))
            atomic_or(&failed, 1); // PoCL takes a plain store for one that no other item makes
        WAIT;
        again = failed;
        WAIT;
    }
    for (int i = item; i < DATA_BITS / 8; i += ITEMS)
        data[word * (DATA_BITS / 8) + i] = pack(AT(posterior, 8 * i / Z) + 8 * i % Z);
    if (item == 0) {
        ok[word] = !again;
        spent[word] = round;
    }
}
