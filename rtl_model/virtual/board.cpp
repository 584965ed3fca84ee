// viform_board at pin level, with the host's serialiser and deserialiser at the host's baud.
#include <cmath>
#include <deque>

#include "served.h"

namespace {

const int BITS = 10;  // of a byte on the line: start, eight data bits, stop

struct Board : Served {
    double bit_clocks = VIFORM_BIT_CLOCKS;  // of the host

    // Host to board.
    std::deque<uint16_t> waiting;  // bits to send, first in bit 0, including the noise
    uint16_t sending = 0;
    int bits_left = 0;
    double boundary = 0;  // end of the bit on the line, clocks
    uint64_t next = 0;    // the same, rounded up

    // Board to host.
    bool high = true, receiving = false;
    int taken = 0;
    uint16_t samples = 0;
    double begun = 0;
    uint64_t sample_at = 0;

    // An answer begins at most three bits after the request, and its bytes follow each other
    // directly. So a longer pause is the end of the answer.
    uint64_t patience() const {
        const double longer = bit_clocks > VIFORM_BIT_CLOCKS ? bit_clocks : VIFORM_BIT_CLOCKS;
        return static_cast<uint64_t>(3 * longer) + 32;
    }
    bool quiet() const {
        return waiting.empty() && !bits_left && !receiving && still(patience());
    }
    bool line(const uint16_t *noise, uint8_t *out, uint64_t &sent) {
        const bool sends = drive();
        return receive(noise, out, sent) || sends;
    }
    bool drive();
    bool receive(const uint16_t *noise, uint8_t *out, uint64_t &sent);
};

// Puts the host's next bit on the line when it is due; returns whether the line is in use.
bool Board::drive() {
    if (!bits_left) {
        if (waiting.empty()) return false;
        if (clock > next) boundary = static_cast<double>(clock);  // else directly after the last
        sending = waiting.front();
        waiting.pop_front();
        bits_left = BITS;
    } else if (clock < next) {
        return true;
    } else if (--bits_left == 0) {
        top->serial_rx = 1;
        return waiting.empty() ? true : drive();
    } else {
        sending >>= 1;
    }
    top->serial_rx = sending & 1;
    boundary += bit_clocks;
    next = static_cast<uint64_t>(std::ceil(boundary));
    return true;
}

// Samples the board's line; returns whether a byte is in transmission.
bool Board::receive(const uint16_t *noise, uint8_t *out, uint64_t &sent) {
    const bool falls = high && !top->serial_tx;
    high = top->serial_tx;
    if (!receiving) {
        if (!falls) return false;
        receiving = true;
        taken = 0;
        samples = 0;
        begun = static_cast<double>(clock);
        sample_at = static_cast<uint64_t>(begun + 0.5 * bit_clocks);
        return true;
    }
    if (clock < sample_at) return true;
    const bool bit = high != ((noise[sent] >> taken & 1) != 0);
    samples |= static_cast<uint16_t>(bit) << taken;
    ++taken;
    sample_at = static_cast<uint64_t>(begun + (taken + 0.5) * bit_clocks);
    if (taken == 1 && bit) receiving = false;  // no start bit
    if (taken == BITS) {
        receiving = false;
        // A byte without its stop bit reads as 0, as by default in Linux.
        out[sent++] = bit ? static_cast<uint8_t>(samples >> 1) : 0;
    }
    return true;
}

}  // namespace

extern "C" {

Board *viform_open() {
    Board *board = new Board;
    board->top->serial_rx = 1;
    board->reset(board->top->rst);
    return board;
}

void viform_close(Board *board) { close_board(board); }

// Sets the clocks of a bit of the host, from the next bit on.
void viform_line(Board *board, double bit_clocks) { board->bit_clocks = bit_clocks; }

// Takes `count` bytes for the board and calls run_board. The masks in `noise` and `noise_out` invert
// bits of the input and output bytes, start bit in bit 0.
int viform_step(Board *board, const uint8_t *bytes, const uint16_t *noise, uint64_t count,
                uint64_t clocks, uint8_t *out, const uint16_t *noise_out, uint64_t room,
                uint64_t *clock, uint64_t *sent) {
    for (uint64_t n = 0; n < count; ++n)
        board->waiting.push_back(static_cast<uint16_t>((bytes[n] << 1 | 0x200) ^ noise[n]));
    return run_board(*board, clocks, out, noise_out, room, clock, sent);
}

}
