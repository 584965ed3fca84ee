// viform_stream_external with its memory: settings, TREADY and the memory's readiness in; the
// memory's commands out. A word that is read arrives a fixed number of
// edges after its command.
#include <array>
#include <deque>
#include <vector>

#include "stepped.h"

typedef std::array<uint64_t, 3> Word;  // 160 bits at most

static void copy(const IData &from, Word &to) { to = {from, 0, 0}; }
static void copy(const QData &from, Word &to) { to = {from, 0, 0}; }
template <std::size_t N>
static void copy(const VlWide<N> &from, Word &to) {
    to = {0, 0, 0};
    for (unsigned n = 0; n < N; ++n) to[n / 2] |= static_cast<uint64_t>(from[n]) << 32 * (n % 2);
}
static void copy(const Word &from, IData &to) { to = from[0]; }
static void copy(const Word &from, QData &to) { to = from[0]; }
template <std::size_t N>
static void copy(const Word &from, VlWide<N> &to) {
    for (unsigned n = 0; n < N; ++n) to[n] = from[n / 2] >> 32 * (n % 2);
}

struct Answer {
    bool valid;
    Word word;
};

struct Board : Stepped {
    std::vector<Word> memory;
    std::deque<Answer> answers;

    void set(const uint64_t *in) {
        top->m_tready = in[0];
        top->mem_ready = in[1];
        top->run = in[2];
        top->clear = in[3];
        top->threshold = in[4];
        top->clock_select = in[5];
        top->reset_rule = in[6];
        top->rows = in[7];
        top->columns = in[8];
        top->tick_clocks = in[9];
        top->pattern = in[10];
        top->level = in[11];
        top->mem_rvalid = answers.front().valid;
        copy(answers.front().word, top->mem_rdata);
    }
    void get(uint64_t *out) {
        out = stream(out);
        *out++ = top->frames;
        *out++ = top->late;
        const bool valid = top->mem_valid, write = valid && top->mem_write;
        Answer answer = {valid && !write && top->mem_ready, {0, 0, 0}};
        if (answer.valid) answer.word = memory.at(top->mem_address);
        answers.push_back(answer);
        Word word = {0, 0, 0};
        if (write) copy(top->mem_wdata, word);
        if (write && top->mem_ready) memory.at(top->mem_address) = word;
        *out++ = valid;
        *out++ = write;
        *out++ = valid ? top->mem_address : 0;
        for (uint64_t part : word) *out++ = part;
    }
    void passed() { answers.pop_front(); }
};

extern "C" void viform_memory(Board *board, const uint64_t *words, uint64_t count,
                              uint64_t latency) {
    board->answers.assign(latency, Answer{false, {0, 0, 0}});
    board->memory.resize(count);
    for (Word &word : board->memory)
        for (uint64_t &part : word) part = *words++;
}

VIFORM_STEPPED(Board, 12, 14)
