// A module stepped with a row of numbers for its inputs and one for its outputs at each clock. The
// outputs are those before the edge.
#pragma once
#include "clocked.h"

struct Stepped : Clocked {
    // The stream's outputs: valid, data, last, user, lost planes, lost rows.
    uint64_t *stream(uint64_t *out) const {
        const bool valid = top->m_tvalid;
        *out++ = valid;
        *out++ = valid ? top->m_tdata : 0;
        *out++ = valid ? top->m_tlast : 0;
        *out++ = valid ? top->m_tuser : 0;
        *out++ = top->lost_planes;
        *out++ = top->lost_rows;
        return out;
    }
};

// `Board` has set(in), get(out) and passed(), which is called after each edge.
#define VIFORM_STEPPED(Board, INPUTS, OUTPUTS)                                              \
    extern "C" {                                                                            \
    unsigned viform_inputs() { return INPUTS; }                                             \
    unsigned viform_outputs() { return OUTPUTS; }                                           \
    Board *viform_open() {                                                                  \
        Board *board = new Board;                                                           \
        board->reset(board->top->rst);                                                      \
        return board;                                                                       \
    }                                                                                       \
    void viform_close(Board *board) { close_board(board); }                                 \
    void viform_steps(Board *board, const uint64_t *in, uint64_t *out, uint64_t clocks) {   \
        for (uint64_t n = 0; n < clocks; ++n, in += INPUTS, out += OUTPUTS) {               \
            board->set(in);                                                                 \
            board->top->eval();                                                             \
            board->get(out);                                                                \
            board->edge();                                                                  \
            board->passed();                                                                \
        }                                                                                   \
    }                                                                                       \
    }
