// viform_stream_lines: TREADY and the bits of all lanes in; alignment and counters out.
#include "stepped.h"

struct Board : Stepped {
    void set(const uint64_t *in) {
        top->m_tready = in[0];
        top->bits = in[1];
    }
    void get(uint64_t *out) const {
        out = stream(out);
        *out++ = top->aligned;
        *out++ = top->losses;
        *out++ = top->bad_rows;
        *out++ = top->missed_rows;
    }
    void passed() {}
};

VIFORM_STEPPED(Board, 2, 10)
