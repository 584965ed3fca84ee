// viform_core at byte level, on a line that takes one clock for a byte in either direction.
#include <deque>

#include "served.h"

namespace {

// Clocks without a byte after which an answer is complete. There are five from a request to its first
// byte and between two words of an answer (viform_uartbone.v).
const uint64_t QUIET = 8;

struct Board : Served {
    std::deque<uint8_t> waiting;

    bool quiet() const { return waiting.empty() && still(QUIET); }

    bool line(const uint16_t *, uint8_t *out, uint64_t &sent) {
        top->rx_valid = !waiting.empty();
        if (top->rx_valid) {
            top->rx_data = waiting.front();
            waiting.pop_front();
        }
        if (top->tx_valid) out[sent++] = top->tx_data;
        return top->rx_valid || top->tx_valid;
    }
};

}  // namespace

extern "C" {

Board *viform_open() {
    Board *board = new Board;
    board->top->shortest_low = 0xFFFFFFFF;  // there is no line
    board->top->tx_ready = 1;
    board->reset(board->top->rst);
    return board;
}

void viform_close(Board *board) { close_board(board); }

void viform_line(Board *, double) {}

// Takes `count` bytes for the board and calls run_board. Noise exists at pin level only.
int viform_step(Board *board, const uint8_t *bytes, const uint16_t *, uint64_t count,
                uint64_t clocks, uint8_t *out, const uint16_t *noise_out, uint64_t room,
                uint64_t *clock, uint64_t *sent) {
    board->waiting.insert(board->waiting.end(), bytes, bytes + count);
    return run_board(*board, clocks, out, noise_out, room, clock, sent);
}

}
