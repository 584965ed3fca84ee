// What the boards behind bytes and behind pins share: opening, closing, and the loop over clocks.
#ifndef VIFORM_SERVED_H
#define VIFORM_SERVED_H

#include <cstdint>
#include <memory>

#include "Vtop.h"
#include "verilated.h"

struct Served {
    VerilatedContext context;
    std::unique_ptr<Vtop> top{new Vtop(&context)};
    uint64_t clock = 0;
    uint64_t last = 0;  // when something last moved on the line
    bool moved = false;

    void edge() {
        top->clk = 1;
        top->eval();
        top->clk = 0;
        top->eval();
    }
    void reset() {
        top->rst = 1;
        for (int n = 0; n < 4; ++n) edge();
        top->rst = 0;
    }
    bool still(uint64_t clocks) const { return !moved || clock - last >= clocks; }
};

template <class Board>
void close_board(Board *board) {
    board->top->final();
    delete board;
}

// Runs at most `clocks` clocks: until nothing is under way or, where nothing was, all of them.
// Returns how many bytes still wait, and one more where any is under way; 0 is a quiet line. `made`
// bytes have come out into `out`, at most `room`. Before each edge `Board::line` moves the line on,
// says whether it is in use, and counts what has come out.
template <class Board>
int run_board(Board &board, uint64_t clocks, uint8_t *out, const uint16_t *noise, uint64_t room,
              uint64_t *clock, uint64_t *made) {
    const bool busy = !board.quiet();
    uint64_t got = 0;
    for (uint64_t n = 0; n < clocks && got < room && !(busy && board.quiet()); ++n) {
        if (board.line(noise, out, got)) {
            board.last = board.clock;
            board.moved = true;
        }
        board.edge();
        ++board.clock;
    }
    *clock = board.clock;
    *made = got;
    return static_cast<int>(board.waiting.size()) + !board.quiet();
}

#endif
