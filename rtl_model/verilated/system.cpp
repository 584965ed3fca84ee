// viform_system, stepped in batches: timed writes in, tiles out.
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

struct Write {
    uint64_t clock;
    uint32_t address, value;
};

struct Board {
    VerilatedContext context;
    std::unique_ptr<Vtop> top;
    uint64_t clock = 0;
    Waves waves;

    void half(bool level) {
        top->clk = level;
        top->eval();
        waves.dump(clock, level);
    }
};

}  // namespace

extern "C" {

Board *viform_open() {
    Board *board = new Board;
#if defined(VIFORM_FST) || defined(VIFORM_VCD)
    board->context.traceEverOn(true);
#endif
    board->top.reset(new Vtop(&board->context));
    Vtop &top = *board->top;
    top.shortest_low = 0xFFFFFFFF;
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

// Runs edges up to `stop` - 1, or until a list could overflow; returns the clock reached.
// `counts` are the numbers of pixel tiles, sink tiles and completed writes.
uint64_t viform_run(Board *board, uint64_t stop, const Write *writes, uint64_t write_count,
                    Tile *tiles, Tile *sink_tiles, uint64_t room, uint64_t *counts) {
    Vtop &top = *board->top;
    uint64_t next = 0, computed = 0, displayed = 0;
    while (board->clock < stop && computed < room && displayed < room) {
        const uint64_t clock = board->clock;
        const bool due = next < write_count && writes[next].clock == clock;
        if (due) {
            top.bus_adr = writes[next].address >> 2;
            top.bus_wdata = writes[next].value;
            ++next;
        }
        top.bus_we = due;
        board->half(true);
        if (top.tile_valid)
            tiles[computed++] = {
                clock | static_cast<uint64_t>(top.tile_clock ^ static_cast<uint32_t>(clock)) << 32,
                top.tile_frame, top.tile_row, top.tile_index, top.tile_bits};
        if (top.sink_valid)
            sink_tiles[displayed++] = {clock, 0, top.sink_row, top.sink_tile, top.sink_bits};
        board->half(false);
        board->clock = clock + 1;
    }
    top.bus_we = 0;
    counts[0] = computed;
    counts[1] = displayed;
    counts[2] = next;
    return board->clock;
}

// Reads a word in two clocks; -1 if there is no answer.
int64_t viform_read(Board *board, uint32_t address, Tile *tiles, Tile *sink_tiles, uint64_t *counts) {
    Vtop &top = *board->top;
    top.bus_re = 1;
    top.bus_adr = address >> 2;
    viform_run(board, board->clock + 1, nullptr, 0, tiles, sink_tiles, 2, counts);
    const uint64_t computed = counts[0], displayed = counts[1];
    top.bus_re = 0;
    viform_run(board, board->clock + 1, nullptr, 0, tiles + computed, sink_tiles + displayed, 2, counts);
    counts[0] += computed;
    counts[1] += displayed;
    return top.bus_rvalid ? static_cast<int64_t>(top.bus_rdata) : -1;
}

}
