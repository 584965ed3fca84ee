"""Measures the baud of a board: the host varies its own rate until the board answers."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from cosim import InputError
from rtl_model.host.board import Board
from rtl_model.host.faults import Cause, LineFault
from rtl_model.host.ports import Port
from rtl_model.host.uartbone import BAUD_MIN, Uartbone
from rtl_model.registers import MAGIC

if TYPE_CHECKING:
    from rtl_model.host.log import LineLog

REACH_PERCENT = 20
"""Range of the search on either side of the nominal rate."""

STANDARD_RATES = (
    115_200, 9_600, 57_600, 230_400, 921_600, 19_200, 38_400, 460_800, 1_000_000, 2_000_000,
    3_000_000, 500_000, 1_500_000, 4_000_000,
)  # fmt: skip
"""Usual rates of boards (those of Linux's termios), in the order in which they are tried."""

_STRIDE = 0.03  # of the search; a board answers over 8 % at least, at 4 clocks a bit
_FINE = 0.0005  # accuracy of an edge
_EDGE_TRIES = 2
_NOMINAL_TRIES = 4  # if only other rates answered: noise may have changed the first answer

# A receiver samples the stop bit nominally 9.5 bits after the edge of the start bit. The board's
# receiver (rtl_model/verilog/viform_uart.v) detects the edge at its next clock and counts half a
# bit, rounded down. An adapter takes 16 samples a bit (assumed, as of a 16550); a simulated one
# takes one in each clock of the board.
_STOP = 9.5
_ADAPTER = 1 / 16


class BaudReport(NamedTuple):
    """Baud of a board, measured by the host's clock.

    Attributes:
        nominal: baud that was requested.
        lowest, highest: host's rates at which the board answered.
        measured: rate of the board.
        error_percent: deviation of `measured` from `nominal`.
        uncertainty_percent: the true deviation lies within this of `error_percent`, provided that
            the adapter produces the rates that are set.
        by_pulse: whether the board's measurement (shortest low pulse) was used.
        bit_clocks: clocks of a bit on the board, 0 if they could not be read.
        baud: rate at which the port was left.
    """

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
        """Whether the board answers at the nominal rate."""
        return self.lowest <= self.nominal <= self.highest


def find_baud(
    port: Port,
    nominal: int,
    *,
    time_scale: float = 1.0,
    patience_s: float = 0.15,
    log: LineLog | None = None,
) -> BaudReport:
    """Finds the rate of a Viform board within 20 % of `nominal` or of a standard rate.

    The standard rates are tried only if the board does not answer within 20 % of `nominal`.
    Bisection finds the lowest and the highest rate at which the board answers, with about 30
    probes. A probe is one read of six bytes followed by silence. No rate can turn it into a write,
    which has ten bytes and an odd command: if the host's bit is shorter than 5/3 of the board's,
    the board receives fewer than ten bytes, and if it is longer than 3/2, bit 0 of every byte is
    low, as its start bit.

    If the bits of one side are too short or too long by half a bit in 9.5, the other side
    samples a wrong bit as the stop bit. So each edge gives the board's rate, up to the sampling
    instants of both sides. The port is left at `nominal` if the board answers there, else at the
    board's rate.

    Args:
        port: port to the board.
        nominal: rate at which the search begins, baud.
        time_scale: seconds of the host's time to a second of the board's clock.
        patience_s: wait for an answer beyond line time, s.
        log: records every transaction, None for no log.

    Raises:
        LineFault: SILENT if the board answers at no rate. The port is back at `nominal`.
    """
    bone = Uartbone(port, baud=nominal, time_scale=time_scale, patience_s=patience_s, log=log)
    try:
        start = next((rate for rate in _nearest_first(nominal) if _answers(bone, rate)), None)
        centre = nominal
        if start is None:
            start = next((rate for rate in STANDARD_RATES if _answers_standard(bone, rate)), None)
            centre = start or nominal
    finally:
        bone.set_baud(nominal)
    if start is None:
        raise LineFault(
            Cause.SILENT,
            f"no Viform board answers on {port.name} within {REACH_PERCENT} % of {nominal} baud or "
            "at a standard rate",
        )
    low, below = _edge(bone, centre, start, -1)
    high, above = _edge(bone, centre, start, 1)
    if not low <= nominal <= high and _answers(bone, nominal, _NOMINAL_TRIES):
        low, high = min(low, nominal), max(high, nominal)
        below, above = min(below, low), max(above, high)
    bone.set_baud(round((low * high) ** 0.5))
    bone.resynchronise()  # ends all pulses of other rates
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
        # rounded up, because error_percent is rounded too
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
    """The last rate from `start` on that the board answers, and the first that it does not.

    Both are the same if the range of the search ends first.
    """
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


def _answers_standard(bone: Uartbone, rate: int) -> bool:
    """Whether the board answers at a rate that the adapter may not support."""
    try:
        return _answers(bone, rate)
    except InputError:
        return False


def _by_edges(low: tuple[int, int], high: tuple[int, int], bit_clocks: int) -> tuple[float, float]:
    """Bounds of the board's rate from the edges of the answered range.

    A receiver that samples the stop bit s of its own bits after the edge of the start bit requires
    9 < s r < 10, where r is the ratio of the receiver's bit to the sender's. The board's receiver
    always applies this limit. An adapter may not, since some accept a byte whose stop bit is low.

    Args:
        low, high: pairs of rates that enclose the lower and the upper edge.
        bit_clocks: clocks of a bit on the board, 0 if unknown.
    """
    clock = 1 / max(bit_clocks, 4)
    rounding = 0.5 * (bit_clocks % 2)  # clocks by which half a bit was rounded down
    board = _STOP - rounding * clock, _STOP + (1 - rounding) * clock
    adapter = _STOP - max(_ADAPTER, clock), _STOP + _ADAPTER
    # The host's rate at either edge, relative to the board's rate.
    lowest = 9 / board[1], max(9 / board[0], adapter[1] / 10)
    highest = min(10 / board[1], adapter[0] / 9), 10 / board[0]
    one = min(low) / lowest[1], max(low) / lowest[0]
    other = min(high) / highest[1], max(high) / highest[0]
    if one[0] <= other[1] and other[0] <= one[1]:
        return max(one[0], other[0]), min(one[1], other[1])
    return min(one[0], other[0]), max(one[1], other[1])  # inconsistent, as on a noisy line


def _by_pulse(bone: Uartbone) -> tuple[int, tuple[float, float] | None]:
    """Clocks of the board's bit (0 if unreadable), and bounds of its rate; None without a pulse.

    The shortest low pulse is one bit of the host, which the board counts in its own clocks, so it
    is known to one clock. A board without pins measures no pulse.
    """
    board = Board(bone)
    try:
        board.write("uart_clear", 1)  # pulses of other rates
        bit, low = board.read_twice("uart_bit_clocks"), board.read_twice("uart_shortest_low")
    except LineFault:
        return 0, None
    if not 0 < bit < 1 << 31 or not 0 < low < 2 * bit:
        return (bit if 0 < bit < 1 << 31 else 0), None
    return bit, (bone.baud * (low - 1) / bit, bone.baud * (low + 1) / bit)
