// viform_stream_array: a bus write, or none, and TREADY in.
#include "stepped.h"

struct Board : Stepped {
    void set(const uint64_t *in) {
        top->m_tready = in[0];
        top->bus_we = in[1];
        top->bus_adr = in[2] >> 2;
        top->bus_wdata = in[3];
    }
    void get(uint64_t *out) const { stream(out); }
    void passed() {}
};

VIFORM_STEPPED(Board, 4, 6)
