// A verilated design with pins clk, rst, serial_rx and serial_tx behind a pty.
//
//   pty_board CLOCK_HZ BAUD      prints the pty's name, then runs until its standard input ends
//
// Busy, it runs as fast as it can; idle, at about the speed of life, so that time passes for the
// board's watchdog.
#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <chrono>

#include "Vsoc.h"
#include "verilated.h"

namespace {
const int kBits = 10;  // start, eight, stop
const unsigned kAtOnce = 2000;  // clocks run between two looks at the pty
}  // namespace

int main(int argc, char **argv) {
    if (argc != 3) return 2;
    const double clock_hz = atof(argv[1]), bit = clock_hz / atof(argv[2]);
    auto looked = std::chrono::steady_clock::now();
    int master, slave;
    char name[128];
    termios raw;
    if (openpty(&master, &slave, name, nullptr, nullptr)) return 1;
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(slave, TCSANOW, &raw);
    fcntl(master, F_SETFL, O_NONBLOCK);
    printf("%s\n", name);
    fflush(stdout);

    Vsoc top;
    double clock = 0, sent_at = 0, heard_at = 0;
    unsigned send = 0, heard = 0;
    bool sending = false, hearing = false;
    unsigned char queue[4096];
    ssize_t queued = 0, next = 0;
    double busy_until = 0;
    top.rst = 1;
    top.serial_rx = 1;
    for (;;) {
        pollfd look[2] = {{master, POLLIN, 0}, {0, POLLIN, 0}};
        const bool busy = sending || hearing || next < queued || clock < busy_until;
        poll(look, 2, busy ? 0 : 1);
        if (look[1].revents & (POLLIN | POLLHUP)) {
            char any[64];
            if (read(0, any, sizeof any) <= 0) return 0;
        }
        if (next == queued) {
            next = 0;
            queued = read(master, queue, sizeof queue);
            if (queued < 0) queued = 0;
        }
        // Idle, as many clocks pass as the time since the last look has.
        const auto now = std::chrono::steady_clock::now();
        const double passed = std::chrono::duration<double>(now - looked).count() * clock_hz;
        const unsigned most = 50 * kAtOnce;
        looked = now;
        const unsigned run = busy || passed < kAtOnce ? kAtOnce : passed < most ? passed : most;
        for (unsigned n = 0; n < run; n++, clock++) {
            top.rst = clock < 4;
            if (!sending && next < queued && clock > 8) {
                send = queue[next++] << 1 | 1 << 9;
                sending = true;
                sent_at = clock;
            }
            if (sending) {
                const int place = int((clock - sent_at) / bit);
                if (place >= kBits) {
                    sending = false;
                    busy_until = clock + 20 * kBits * bit;
                } else {
                    top.serial_rx = send >> place & 1;
                }
            }
            top.clk = 0;
            top.eval();
            top.clk = 1;
            top.eval();
            if (!hearing && !top.serial_tx && clock > 8) {
                hearing = true;
                heard = 0;
                heard_at = clock;
            }
            if (hearing && clock - heard_at >= 9.5 * bit) {
                hearing = false;
                busy_until = clock + 2 * kBits * bit;
                const unsigned char byte = heard >> 1;
                while (write(master, &byte, 1) != 1) poll(nullptr, 0, 1);
            } else if (hearing) {
                const int place = int((clock - heard_at) / bit);
                if (clock - heard_at <= (place + 0.5) * bit)  // the last look counts
                    heard = (heard & ~(1u << place)) | unsigned(top.serial_tx) << place;
            }
        }
    }
}
