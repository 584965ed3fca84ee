// viform_event_decoder, stepped in batches: words of packets, s_tvalid and m_tready in, words of
// spikes out.
#include "clocked.h"

namespace {

struct Half {
    uint64_t clock;
    uint16_t data;
    uint8_t last;
};

struct Word {
    uint64_t clock;
    uint32_t data, first, tile;
    uint8_t last, gaps;
};

struct Gap {
    uint64_t clock;
    uint16_t place;
};

struct Board : Clocked {
    uint64_t clock = 0;
    bool waits = false;  // a word that was not taken must stay as it is
    Word held{};
};

}  // namespace

extern "C" {

Board *viform_open() {
    Board *board = new Board;
    board->reset(board->top->reset);
    return board;
}

void viform_close(Board *board) { close_board(board); }

// Runs until all halves are taken and then `idle` clocks more, or until `clocks` clocks have
// passed; returns the clocks. A half is offered where offered[n % size] is 1, and stays until it is
// taken. counts: halves taken, words out, gap places, good packets, damaged ones, and clocks in
// which the stream broke the rule that a word stays until it is taken.
uint64_t viform_run(Board *board, uint64_t clocks, uint64_t idle, const Half *halves,
                    uint64_t half_count, const uint8_t *offered, const uint8_t *ready,
                    uint64_t size, Word *words, Gap *gaps, uint64_t *counts) {
    Vtop &top = *board->top;
    uint64_t taken = 0, count = 0, places = 0, n = 0, left = idle;
    bool offers = false;
    for (; n < clocks && left; ++n, ++board->clock) {
        if (taken == half_count) --left;
        offers = taken < half_count && (offers || offered[n % size]);
        top.s_tvalid = offers;
        if (offers) {
            top.s_tdata = halves[taken].data;
            top.s_tlast = halves[taken].last;
        }
        const bool is_ready = ready[n % size];
        top.m_tready = is_ready;
        top.eval();
        const Word word = {board->clock, top.m_tdata, top.m_first, top.m_tile, top.m_tlast,
                           top.m_tuser};
        const Word &held = board->held;
        if (board->waits &&
            (!top.m_tvalid || word.data != held.data || word.first != held.first ||
             word.tile != held.tile || word.last != held.last || word.gaps != held.gaps))
            ++counts[5];
        board->waits = top.m_tvalid && !is_ready;
        board->held = word;
        if (top.m_tvalid && is_ready) words[count++] = word;
        if (top.gap_valid) gaps[places++] = {board->clock, top.gap_place};
        if (offers && top.s_tready) {
            ++taken;
            offers = false;
        }
        board->edge();
    }
    counts[0] = taken;
    counts[1] = count;
    counts[2] = places;
    counts[3] = top.packets;
    counts[4] = top.damaged;
    return n;
}

}
