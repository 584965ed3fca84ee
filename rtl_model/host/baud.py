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

_STEP = 0.01
_REACH = 20  # steps each way
_EDGE_TRIES = 2
_NOMINAL_TRIES = 4  # more, where only others answered: a noisy line may have spoilt the first
_DOUBT = 0.03  # a pulse that says otherwise than the middle of the rates by more is none of a bit


class BaudReport(NamedTuple):
    """nominal: as asked. lowest, highest: host's rates at which the board answered. measured: the
    board's own rate; error_percent: its deviation from nominal. by_pulse: whether it was measured
    by the board (shortest low pulse), else it is the middle of those rates. baud: left set."""

    nominal: int
    lowest: int
    highest: int
    measured: int
    error_percent: float
    by_pulse: bool
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

    A probe is one read of six bytes and then silence, so no rate can turn it into a write.
    LineFault SILENT where the board answers at no rate (the port is back at `nominal`).
    """
    bone = Uartbone(port, baud=nominal, time_scale=time_scale, patience_s=patience_s, log=log)
    try:
        start = next((step for step in _nearest_first() if _answers(bone, nominal, step)), None)
    finally:
        bone.set_baud(nominal)
    if start is None:
        reach = round(100 * _REACH * _STEP)
        raise LineFault(
            Cause.SILENT,
            f"no board of ours answers on {port.name} within {reach} % of {nominal} baud",
        )
    low = high = start
    while low > -_REACH and _answers(bone, nominal, low - 1, _EDGE_TRIES):
        low -= 1
    while high < _REACH and _answers(bone, nominal, high + 1, _EDGE_TRIES):
        high += 1
    if not low <= 0 <= high and _answers(bone, nominal, 0, _NOMINAL_TRIES):
        low, high = min(low, 0), max(high, 0)
    middle = _rate(nominal, (low + high) / 2)
    bone.set_baud(middle)
    bone.resynchronise()  # no pulse of another rate is under way
    pulse = _by_pulse(bone)
    measured = middle if pulse is None else pulse
    left = nominal if low <= 0 <= high else middle
    bone.set_baud(left)
    return BaudReport(
        nominal=nominal,
        lowest=_rate(nominal, low),
        highest=_rate(nominal, high),
        measured=measured,
        error_percent=round(100 * (measured / nominal - 1), 2),
        by_pulse=pulse is not None,
        baud=left,
    )


def _nearest_first() -> list[int]:
    return sorted(range(-_REACH, _REACH + 1), key=lambda step: (abs(step), -step))


def _rate(nominal: int, step: float) -> int:
    return max(BAUD_MIN, round(nominal * (1 + _STEP * step)))


def _answers(bone: Uartbone, nominal: int, step: int, tries: int = 1) -> bool:
    bone.set_baud(_rate(nominal, step))
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


def _by_pulse(bone: Uartbone) -> int | None:
    """Returns the board's rate from the host's: the shortest low pulse it sees is one bit of the
    host's, counted in its own clocks. None where that is no bit (no pins, or noise)."""
    board = Board(bone)
    try:
        board.write("uart_clear", 1)  # pulses of other rates
        bit, low = board.read_twice("uart_bit_clocks"), board.read_twice("uart_shortest_low")
    except LineFault:
        return None
    if not bit or abs(low / bit - 1) > _DOUBT:
        return None
    return round(bone.baud * low / bit)
