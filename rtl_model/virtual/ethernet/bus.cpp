// viform_ethernet, with the accesses of LiteEth's AXI-Lite master: one at a time, address and data
// of a write together.
#include "clocked.h"

namespace {

struct Board : Clocked {
    uint64_t clock = 0;

    void edge() {
        Clocked::edge();
        ++clock;
    }
};

}  // namespace

extern "C" {

Board *viform_open() {
    Board *board = new Board;
    Vtop &top = *board->top;
    top.mmap_bready = top.mmap_rready = 1;
    top.mmap_wstrb = 15;
    board->reset(top.rst);
    return board;
}

void viform_close(Board *board) { close_board(board); }

// Runs `clocks` clocks; like the accesses, returns the clock reached.
uint64_t viform_run(Board *board, uint64_t clocks) {
    for (uint64_t n = 0; n < clocks; ++n) board->edge();
    return board->clock;
}

uint64_t viform_read(Board *board, uint64_t count, const uint32_t *addresses, uint32_t *values) {
    Vtop &top = *board->top;
    for (uint64_t n = 0; n < count; ++n) {
        top.mmap_araddr = addresses[n];
        top.mmap_arvalid = 1;
        top.eval();
        while (!top.mmap_arready) board->edge();
        board->edge();
        top.mmap_arvalid = 0;
        top.eval();
        while (!top.mmap_rvalid) board->edge();
        values[n] = top.mmap_rdata;
        board->edge();
    }
    return board->clock;
}

uint64_t viform_write(Board *board, uint64_t count, const uint32_t *addresses, uint32_t *values) {
    Vtop &top = *board->top;
    for (uint64_t n = 0; n < count; ++n) {
        top.mmap_awaddr = addresses[n];
        top.mmap_wdata = values[n];
        top.mmap_awvalid = top.mmap_wvalid = 1;
        top.eval();
        while (!top.mmap_awready) board->edge();
        board->edge();
        top.mmap_awvalid = top.mmap_wvalid = 0;
        top.eval();
        while (!top.mmap_bvalid) board->edge();
        board->edge();
    }
    return board->clock;
}

}
