// A module in Verilator with the clock `clk`: its edges, its reset and its end.
#pragma once
#include <cstdint>
#include <memory>

#include "Vtop.h"
#include "verilated.h"

struct Clocked {
    VerilatedContext context;
    std::unique_ptr<Vtop> top{new Vtop(&context)};

    void edge() {
        top->clk = 1;
        top->eval();
        top->clk = 0;
        top->eval();
    }
    // Holds the input `port` high for four edges.
    template <class Port>
    void reset(Port &port) {
        port = 1;
        for (int n = 0; n < 4; ++n) edge();
        port = 0;
    }
};

template <class Board>
void close_board(Board *board) {
    board->top->final();
    delete board;
}
