// viform_board at pin level for waveforms: bytes to the board, and the tiles that it computes.
#include <cstdint>
#include <memory>

#include "Vtop.h"
#include "waves.h"

namespace {

struct Tile {
    uint64_t clock;
    uint32_t frame;
    uint16_t row, tile;
    uint64_t bits;
};

struct Board {
    VerilatedContext context;
    std::unique_ptr<Vtop> top;
    Waves waves;
    uint64_t clock = 0;

    void half(bool level) {
        top->clk = level;
        top->eval();
        waves.dump(clock, level);
    }
};

const unsigned BITS = 10;  // of a byte on the line: start, eight data bits, stop

}  // namespace

extern "C" {

Board *viform_open() {
    Board *board = new Board;
#if defined(VIFORM_FST) || defined(VIFORM_VCD)
    board->context.traceEverOn(true);
#endif
    board->top.reset(new Vtop(&board->context));
    Vtop &top = *board->top;
    top.serial_rx = 1;
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

#if defined(VIFORM_FST) || defined(VIFORM_VCD)
// Waveforms of the clocks first to last - 1; returns whether the file could be opened.
int viform_waves(Board *board, const char *path, uint64_t first, uint64_t last) {
    return board->waves.begin(*board->top, path, first, last);
}
#endif

// Sends bytes back to back and runs `idle` clocks more, or until `room` tiles are computed; returns
// the number of tiles.
uint64_t viform_send(Board *board, const uint8_t *bytes, uint64_t count, uint64_t idle, Tile *tiles,
                     uint64_t room) {
    Vtop &top = *board->top;
    const uint64_t begin = board->clock, line = count * BITS * VIFORM_BIT_CLOCKS;
    uint64_t computed = 0;
    for (uint64_t n = 0; n < line + idle && computed < room; ++n) {
        if (n < line) {
            const uint64_t bit = n / VIFORM_BIT_CLOCKS;
            const unsigned frame = 0x200u | bytes[bit / BITS] << 1;  // stop, data, start
            top.serial_rx = frame >> bit % BITS & 1;
        } else {
            top.serial_rx = 1;
        }
        board->half(true);
        if (top.tile_valid)
            tiles[computed++] = {begin + n, top.tile_frame, top.tile_row, top.tile_index,
                                 top.tile_bits};
        board->half(false);
        ++board->clock;
    }
    return computed;
}

}
