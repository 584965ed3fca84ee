"""`CounterSequencer`: the same sequencer clock by clock, by counters that count down, as a chip has
it. Slow; it proves that `Sequencer` and `signals_of` know every edge to the clock."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from imagers.adaptive.device.signals import Code, ring
from imagers.adaptive.device.timing import Timing


@dataclass
class _ResetCounter:
    """left: clocks to its next reset's end; None while it is idle. done: rows reset. due: its code
    steps with the next work phase. code: rows it has stepped over."""

    left: int | None = None
    done: int = 0
    due: bool = False
    steps: int = 0


@dataclass(frozen=True)
class Tick:
    """One clock. signals: as `signal_list` names them. codes: of all counters, with the phase ring,
    the timer and the columns. idle: of the work cycle. resets: (counter, row) that end here.
    sampled: the row sampled here."""

    clock: int
    signals: dict[str, int]
    codes: dict[str, int]
    idle: bool
    resets: tuple[tuple[int, int], ...]
    sampled: int | None


def johnson(number: int, states: int) -> int:
    """Code of a Johnson counter: ones are shifted in, then zeros. states: even; states/2 bits."""
    if states < 2 or states % 2:
        raise ValueError(f"states of a Johnson counter must be even, not {states}")
    half, step = states // 2, number % states
    ones = (1 << half) - 1
    return (1 << step) - 1 if step <= half else ones & ~((1 << (step - half)) - 1)


class CounterSequencer:
    """exposures: of the frames to come, clocks; it runs until the last of them has been read."""

    def __init__(self, timing: Timing, exposures: list[int], code: Code = "gray") -> None:
        self._t, self._code = timing, code
        self._coming = list(exposures)
        self._clock = 0
        self._counters = (_ResetCounter(), _ResetCounter())
        self._turn, self._before = 0, 0
        self._hold: int | None = None
        self._frame: int | None = None
        self._row, self._line = timing.rows, 0
        self._reading: tuple[int, int] | None = None
        self._columns, self._row_steps = 0, 0
        self._take()

    def run(self) -> Iterator[Tick]:
        """Every clock from power-on to the one after the last frame's decision."""
        while True:
            yield self._tick()
            busy = self._reading is not None or self._row < self._t.rows
            if self._frame is None and not busy:
                yield self._tick()
                return

    def _take(self) -> None:
        """Vout, or power-on: hold and frame time of the next exposure are set, and the counter."""
        if not self._coming:
            self._hold = self._frame = None
            return
        exposure = self._coming.pop(0)
        self._frame = self._t.frame
        if exposure + self._t.turn > self._frame:
            cycles, over = divmod(exposure + self._t.turn, self._t.cycle)
            self._frame = (cycles + bool(over)) * self._t.cycle
        self._hold = self._frame - exposure
        if self._before and exposure != self._before:
            self._turn = 1 - self._turn
        self._before = exposure

    def _tick(self) -> Tick:
        t = self._t
        phase = self._clock % t.cycle
        vout = self._frame == 0
        if vout:
            self._take()
            self._row, self._line = 0, 0
        sampled = None
        if self._row < t.rows and self._line == 0:
            sampled, self._line = self._row, t.line
            self._row += 1
            self._reading = (sampled, 0)
        resets = self._reset(phase)
        signals = self._signals(phase)
        tick = Tick(
            self._clock, signals, self._codes(phase), phase >= t.work, resets, sampled
        )  # fmt: skip
        self._count_down()
        return tick

    def _reset(self, phase: int) -> tuple[tuple[int, int], ...]:
        t = self._t
        if self._hold == 0:
            counter = self._counters[self._turn]
            if counter.left is not None:
                raise RuntimeError("a reset counter is started while it works")
            counter.left, counter.done, self._hold = 0, 0, None
        ended = []
        for number, counter in enumerate(self._counters):
            if counter.left == 0:
                ended.append((number + 1, counter.done))
                counter.done += 1
                counter.left = t.line if counter.done < t.rows else None
                counter.due = True
            if counter.due and phase == 0:
                counter.due = False
                counter.steps += 1
        return tuple(ended)

    def _signals(self, phase: int) -> dict[str, int]:
        t = self._t
        soon = range(1, t.work + 1)
        pulse = [int(c.left in soon if c.left is not None else False) for c in self._counters]
        if self._hold is not None and self._hold in soon:
            pulse[self._turn] = 1
        more = self._row < t.rows and self._line in soon
        sampling = more or (self._frame is not None and self._frame in soon)
        out = select = hout = vout = 0
        if self._reading is not None:
            row, since = self._reading
            hout = int(since < t.work)
            vout = int(hout and row == 0)
            cycle, within = divmod(since - t.turn, t.cycle)
            out = int(0 <= cycle < t.out_cycles and within < t.work)
            select = int(row == t.rows - 1 and cycle == t.out_cycles)
            if since == t.turn:
                self._row_steps += 1
            step = cycle * t.work + within
            if out and 0 <= step < t.out_steps:
                self._columns += 1
        return {
            "Vout": vout, "Hout": hout, "Hrst1": pulse[0], "Hrst2": pulse[1],
            "sampling": int(sampling), "Pout": out, "select": select,
            **self._row_codes(),
        }  # fmt: skip

    def _row_codes(self) -> dict[str, int]:
        steps = (self._row_steps, *(counter.steps for counter in self._counters))
        codes = (ring(step, self._t.rows, self._code) for step in steps)
        return dict(zip(("row", "reset1", "reset2"), codes, strict=True))

    def _codes(self, phase: int) -> dict[str, int]:
        t = self._t
        return {
            "phase": johnson(phase, t.cycle),
            "timer": ring(self._clock // t.cycle, 1 << t.timer_bits, self._code),
            "columns": ring(self._columns, t.out_steps, self._code),
            **self._row_codes(),
        }

    def _count_down(self) -> None:
        self._clock += 1
        if self._frame is not None:
            self._frame -= 1
        if self._hold is not None:
            self._hold -= 1
        for counter in self._counters:
            if counter.left is not None:
                counter.left -= 1
        if self._line:
            self._line -= 1
        if self._reading is not None:
            row, since = self._reading
            over = since + 1 >= self._t.turn + (self._t.out_cycles + 1) * self._t.cycle
            self._reading = None if over else (row, since + 1)
