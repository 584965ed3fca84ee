"""How far a board's baud is off: the host's own rate is moved until the board answers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rtl_model.host.board import Board
from rtl_model.host.faults import Cause, LineFault
from rtl_model.host.ports import Port
from rtl_model.host.uartbone import BAUD_MIN, Uartbone
from rtl_model.registers import MAGIC

if TYPE_CHECKING:
    from rtl_model.host.log import Recorder

__all__ = ["TOLERANCE_PERCENT", "BaudReport", "find_baud"]

TOLERANCE_PERCENT = 5.0
"""A receiver that samples mid-bit and starts at the start bit's edge reads the stop bit right while
the rates differ by less than half a bit in 9.5: 5.3 %, less the edge's rounding."""

REACH_PERCENT = 20
"""How far from the nominal rate a board is looked for, each way."""

_STRIDE = 0.03  # of the search: the rates that answer span 8 % at least, at 4 clocks a bit
_FINE = 0.0005  # how closely an edge is found
_EDGE_TRIES = 2
_NOMINAL_TRIES = 4  # more, where only others answered: a noisy line may have spoilt the first

# When a receiver samples a byte's stop bit, in bits from the start bit's edge: 9.5, and later by
# what follows. The board's (rtl_model/verilog/viform_uart.v) sees an edge at its next clock and
# begins half a bit, rounded down, before the middle; an adapter takes 16 samples a bit (assumed, as
# of a 16550) or, simulated, one a clock of the board.
_STOP = 9.5
_ADAPTER = 1 / 16


class BaudReport(NamedTuple):
    """nominal: as asked. lowest, highest: host's rates at which the board answered. measured: the
    board's own rate by the host's clock, error_percent: its deviation from nominal; the true one
    lies within uncertainty_percent (of nominal) of it, as far as the adapter makes the rates that
    it is set to. by_pulse: whether the board's own measurement (shortest low pulse) went into it.
    bit_clocks: of the board, 0 where it could not be read. baud: left set."""

    nominal: int
    lowest: int
    highest: int
    measured: int
    error_percent: float
    uncertainty_percent: float
    by_pulse: bool
    bit_clocks: int
    baud: int

    @property
    def tolerable(self) -> bool:
        """Whether nominal works."""
        return self.lowest <= self.nominal <= self.highest


def find_baud(
    port: Port,
    nominal: int,
    *,
    time_scale: float = 1.0,
    patience_s: float = 0.15,
    log: Recorder | None = None,
) -> BaudReport:
    """Returns the rate of a board of ours, found from 20 % below to 20 % above `nominal`; the port
    is left at `nominal` where the board answers there, else at the board's own rate.

    Both edges of the rates that are answered are found by bisection, some 30 probes in all. A probe
    is one read of six bytes and then silence, so no rate can turn it into a write. Where the bytes
    of one side are too short or too long by half a bit in nine and a half, the other takes a wrong
    bit for the stop bit: so each edge tells the board's rate, to the moment at which either side
    samples. LineFault SILENT where the board answers at no rate (the port is back at `nominal`).
    """
    bone = Uartbone(port, baud=nominal, time_scale=time_scale, patience_s=patience_s, log=log)
    try:
        start = next((rate for rate in _nearest_first(nominal) if _answers(bone, rate)), None)
    finally:
        bone.set_baud(nominal)
    if start is None:
        raise LineFault(
            Cause.SILENT,
            f"no board of ours answers on {port.name} within {REACH_PERCENT} % of {nominal} baud",
        )
    low, below = _edge(bone, nominal, start, -1)
    high, above = _edge(bone, nominal, start, 1)
    if not low <= nominal <= high and _answers(bone, nominal, _NOMINAL_TRIES):
        low, high = min(low, nominal), max(high, nominal)
        below, above = min(below, low), max(above, high)
    bone.set_baud(round((low * high) ** 0.5))
    bone.resynchronise()  # no pulse of another rate is under way
    bit, pulse = _by_pulse(bone)
    least, most = _by_edges((below, low), (high, above), bit)
    by_pulse = pulse is not None and pulse[0] < most and least < pulse[1]
    if by_pulse and pulse is not None:
        least, most = max(least, pulse[0]), min(most, pulse[1])
    measured = round((least + most) / 2)
    left = nominal if low <= nominal <= high else measured
    bone.set_baud(left)
    return BaudReport(
        nominal=nominal,
        lowest=low,
        highest=high,
        measured=measured,
        error_percent=round(100 * (measured / nominal - 1), 2),
        # rounded up, for error_percent is rounded too
        uncertainty_percent=round(100 * max(most - measured, measured - least) / nominal + 0.01, 2),
        by_pulse=by_pulse,
        bit_clocks=bit,
        baud=left,
    )


def _nearest_first(nominal: int) -> list[int]:
    count = int(REACH_PERCENT / 100 / _STRIDE)
    steps = [0, *(sign * n for n in range(1, count + 1) for sign in (1, -1))]
    shares = [*(_STRIDE * n for n in steps), REACH_PERCENT / 100, -REACH_PERCENT / 100]
    return [_rate(nominal * (1 + share)) for share in shares]


def _rate(baud: float) -> int:
    return max(BAUD_MIN, round(baud))


def _edge(bone: Uartbone, nominal: int, start: int, sign: int) -> tuple[int, int]:
    """The last rate from `start` on that is answered, and the first that is not (the same where
    the search ends first)."""
    end = _rate(nominal * (1 + sign * (REACH_PERCENT / 100 + 2 * _STRIDE)))
    inside, outside = start, start
    while outside == inside:
        if inside == end or (inside == BAUD_MIN and sign < 0):
            return inside, inside
        step = _rate(inside + sign * _STRIDE * nominal)
        step = max(step, end) if sign < 0 else min(step, end)
        if _answers(bone, step, _EDGE_TRIES):
            inside = outside = step
        else:
            outside = step
    while abs(outside - inside) > max(1.0, _FINE * nominal):
        middle = round((inside + outside) / 2)
        if _answers(bone, middle, _EDGE_TRIES):
            inside = middle
        else:
            outside = middle
    return inside, outside


def _answers(bone: Uartbone, rate: int, tries: int = 1) -> bool:
    bone.set_baud(rate)
    for _ in range(tries):
        try:
            if bone.read(0, retry=False) == [MAGIC]:
                return True
        except LineFault as fault:
            if fault.cause not in (Cause.SILENT, Cause.SHORT, Cause.GARBLED):
                raise
        else:
            bone.resynchronise()
    return False


def _by_edges(low: tuple[int, int], high: tuple[int, int], bit_clocks: int) -> tuple[float, float]:
    """The least and the most that the board's rate can be, by the edges' rates (each a pair that
    holds the edge).

    A receiver that samples the stop bit s bits after the edge needs 9 < s r and s r < 10, r being
    the sender's bit in its own. That of the board always matters; the adapter's may not, since some
    hand on a byte whose stop bit is low.
    """
    clock = 1 / max(bit_clocks, 4)
    late = 0.5 * (bit_clocks % 2)  # clocks by which half a bit was rounded down
    board = _STOP - late * clock, _STOP + (1 - late) * clock
    adapter = _STOP - max(_ADAPTER, clock), _STOP + _ADAPTER
    # As shares of the board's rate: the host's rate at either edge.
    lowest = 9 / board[1], max(9 / board[0], adapter[1] / 10)
    highest = min(10 / board[1], adapter[0] / 9), 10 / board[0]
    one = min(low) / lowest[1], max(low) / lowest[0]
    other = min(high) / highest[1], max(high) / highest[0]
    if one[0] <= other[1] and other[0] <= one[1]:
        return max(one[0], other[0]), min(one[1], other[1])
    return min(one[0], other[0]), max(one[1], other[1])  # a noisy line: both are told


def _by_pulse(bone: Uartbone) -> tuple[int, tuple[float, float] | None]:
    """Clocks of the board's bit (0 where they cannot be read), and the least and the most that its
    rate can be by the shortest low pulse that it saw: that is one bit of the host's, counted in
    clocks of the board and so known to one of them. No such pulse where there are no pins."""
    board = Board(bone)
    try:
        board.write("uart_clear", 1)  # pulses of other rates
        bit, low = board.read_twice("uart_bit_clocks"), board.read_twice("uart_shortest_low")
    except LineFault:
        return 0, None
    if not 0 < bit < 1 << 31 or not 0 < low < 2 * bit:
        return (bit if 0 < bit < 1 << 31 else 0), None
    return bit, (bone.baud * (low - 1) / bit, bone.baud * (low + 1) / bit)
