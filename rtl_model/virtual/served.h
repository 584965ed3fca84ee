// Common part of the boards at byte and pin level: reset, closing, and the loop over clocks.
#ifndef VIFORM_SERVED_H
#define VIFORM_SERVED_H

#include "clocked.h"

struct Served : Clocked {
    uint64_t clock = 0;
    uint64_t last = 0;  // clock of the last activity on the line
    bool moved = false;

    bool still(uint64_t clocks) const { return !moved || clock - last >= clocks; }
};

// Runs at most `clocks` clocks. If a transmission was in progress, it stops when that is complete.
// Returns the number of waiting bytes, plus one if a transmission is in progress; 0 is a quiet line.
// `sent` bytes have been written to `out`, at most `room`. Before each edge `Board::line` advances the
// line, returns whether it is in use, and counts the output bytes.
template <class Board>
int run_board(Board &board, uint64_t clocks, uint8_t *out, const uint16_t *noise, uint64_t room,
              uint64_t *clock, uint64_t *sent) {
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
    *sent = got;
    return static_cast<int>(board.waiting.size()) + !board.quiet();
}

#endif
