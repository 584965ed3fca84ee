// viform_event_encoder, stepped in batches: timed tiles and m_tready in, words of the stream out.
#include "clocked.h"

namespace {

struct Tile {
    uint64_t clock;
    uint32_t frame;
    uint16_t row, tile;
    uint64_t bits;
};

struct Word {
    uint64_t clock;
    uint16_t data;
    uint8_t last;
};

struct Board : Clocked {
    uint64_t clock = 0;
    bool waits = false;  // a word that was not taken must stay as it is
    uint16_t data = 0;
    uint8_t last = 0;
};

}  // namespace

extern "C" {

Board *viform_open() {
    Board *board = new Board;
    board->reset(board->top->reset);
    return board;
}

void viform_close(Board *board) { close_board(board); }

// Runs `clocks` clocks; returns the number of words. counts: rows and spikes lost, and clocks in
// which the stream broke the rule that a word stays until it is taken.
uint64_t viform_run(Board *board, uint64_t clocks, const Tile *tiles, uint64_t tile_count,
                    const uint8_t *ready, Word *words, uint64_t *counts) {
    Vtop &top = *board->top;
    uint64_t next = 0, count = 0;
    for (uint64_t n = 0; n < clocks; ++n, ++board->clock) {
        const bool due = next < tile_count && tiles[next].clock == board->clock;
        top.tile_valid = due;
        if (due) {
            top.tile_frame = tiles[next].frame;
            top.tile_row = tiles[next].row;
            top.tile_index = tiles[next].tile;
            top.tile_bits = tiles[next].bits;
            ++next;
        }
        top.m_tready = ready[n];
        if (board->waits &&
            (!top.m_tvalid || top.m_tdata != board->data || top.m_tlast != board->last))
            ++counts[2];
        board->waits = top.m_tvalid && !ready[n];
        board->data = top.m_tdata;
        board->last = top.m_tlast;
        if (top.m_tvalid && ready[n]) words[count++] = {board->clock, board->data, board->last};
        board->edge();
    }
    counts[0] = top.lost_rows;
    counts[1] = top.lost_spikes;
    return count;
}

}
