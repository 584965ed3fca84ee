// Waveforms of a range of clocks, in picoseconds: edge n is at n / CLOCK_HZ.
#pragma once
#include <cstdint>

#include "verilated.h"
#ifdef VIFORM_FST
#include "verilated_fst_c.h"
typedef VerilatedFstC WaveFile;
#endif
#ifdef VIFORM_VCD
#include "verilated_vcd_c.h"
typedef VerilatedVcdC WaveFile;
#endif

#if defined(VIFORM_FST) || defined(VIFORM_VCD)
struct Waves {
    WaveFile file;
    bool open = false;
    uint64_t first = 0, last = 0;

    // Returns whether the file could be opened.
    template <class Top>
    bool begin(Top &top, const char *path, uint64_t from, uint64_t until) {
        top.trace(&file, 99);
        file.set_time_unit("ps");
        file.set_time_resolution("ps");
        file.open(path);
        first = from;
        last = until;
        return open = file.isOpen();
    }
    void dump(uint64_t clock, bool level) {
        if (!open || clock < first || clock >= last) return;
        const unsigned __int128 halves = static_cast<unsigned __int128>(2) * clock + !level;
        file.dump(static_cast<uint64_t>(halves * 500000000000ull / VIFORM_CLOCK_HZ));
    }
    ~Waves() {
        if (open) file.close();
    }
};
#else
struct Waves {
    void dump(uint64_t, bool) {}
};
#endif
