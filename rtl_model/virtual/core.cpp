// viform_core behind bytes: a line of no duration, one byte a clock each way.
#include <cstdint>
#include <deque>
#include <memory>

#include "Vtop.h"
#include "verilated.h"

namespace {

// Clocks without a byte after which no answer is to come: five from a request to its first byte,
// and between two words of an answer (viform_uartbone.v); and some.
const uint64_t QUIET = 16;

struct Board {
    VerilatedContext context;
    std::unique_ptr<Vtop> top;
    std::deque<uint8_t> waiting;
    uint64_t clock = 0;
    uint64_t last = 0;  // when a byte last moved
    bool moved = false;

    bool quiet() const { return waiting.empty() && (!moved || clock - last >= QUIET); }
};

}  // namespace

extern "C" {

Board *viform_open() {
    Board *board = new Board;
    board->top.reset(new Vtop(&board->context));
    Vtop &top = *board->top;
    top.shortest_low = 0xFFFFFFFF;  // there is no line
    top.tx_ready = 1;
    top.rst = 1;
    for (int n = 0; n < 4; ++n) {
        top.clk = 1;
        top.eval();
        top.clk = 0;
        top.eval();
    }
    top.rst = 0;
    return board;
}

void viform_close(Board *board) {
    board->top->final();
    delete board;
}

void viform_line(Board *, double) {}

// Takes `count` bytes for the board and runs at most `clocks` clocks: until nothing is under way,
// or, where nothing was, all of them. Returns whether something still is. `made` bytes have come
// out, at most `room`; the noise is for the board with pins.
int viform_step(Board *board, const uint8_t *bytes, const uint16_t *, uint64_t count,
                uint64_t clocks, uint8_t *out, const uint16_t *, uint64_t room,
                uint64_t *clock, uint64_t *made) {
    Vtop &top = *board->top;
    board->waiting.insert(board->waiting.end(), bytes, bytes + count);
    const bool busy = !board->quiet();
    uint64_t sent = 0;
    for (uint64_t n = 0; n < clocks && sent < room && !(busy && board->quiet()); ++n) {
        top.rx_valid = !board->waiting.empty();
        if (top.rx_valid) {
            top.rx_data = board->waiting.front();
            board->waiting.pop_front();
        }
        if (top.tx_valid) out[sent++] = top.tx_data;
        if (top.rx_valid || top.tx_valid) {
            board->last = board->clock;
            board->moved = true;
        }
        top.clk = 1;
        top.eval();
        top.clk = 0;
        top.eval();
        ++board->clock;
    }
    *clock = board->clock;
    *made = sent;
    return !board->quiet();
}

}
