"""Error of a baud that is derived from a clock by an integer divider."""

from __future__ import annotations

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.host import BAUD_MIN

TOLERANCE = 0.02
"""Largest relative error of a baud. Sender and receiver may differ by half a bit in 9.5, 5.3 %
(viform_uart.v). This leaves the larger part to the adapter and to the rounding of the edge."""

_FEWEST_CLOCKS = 4  # of a bit; its middle is undefined with fewer (HALF in viform_uart.v)
_COMMON = (
    9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 500_000, 921_600, 1_000_000,
    1_500_000, 2_000_000, 2_500_000, 3_000_000, 4_000_000, 6_000_000, 8_000_000, 12_000_000,
)  # fmt: skip
"""Rates of common adapters: those of POSIX, of Linux's termios.h, and of an FT2232H."""


def baud_error(clock_hz: int, baud: int) -> float:
    """Signed relative error of the rate of the nearest integer divider."""
    return clock_hz / Geometry(clock_hz=clock_hz, baud=baud).bit_clocks / baud - 1.0


def check_baud(clock_hz: int, baud: int) -> None:
    """Raises InputError for a baud whose error exceeds `TOLERANCE`.

    The message names the nearest common rates within the tolerance.
    """
    if baud < BAUD_MIN:
        raise InputError(
            "--baud", f"at least {BAUD_MIN}, for the board drops a transaction after 100 ms",
            str(baud), "take 115200",
        )  # fmt: skip
    if _good(clock_hz, baud):
        return
    below = [rate for rate in _COMMON if rate < baud and _good(clock_hz, rate)]
    above = [rate for rate in _COMMON if rate > baud and _good(clock_hz, rate)]
    near = " or ".join(map(str, below[-1:] + above[:1]))
    megahertz = f"{clock_hz / 1e6:g} MHz"
    if clock_hz < _FEWEST_CLOCKS * baud:
        actual = f"{baud}, which leaves less than {_FEWEST_CLOCKS} clocks a bit"
    else:
        clocks = Geometry(clock_hz=clock_hz, baud=baud).bit_clocks
        off = 100 * baud_error(clock_hz, baud)
        actual = f"{baud}, for which {clocks} clocks a bit are off by {off:+.1f} %"
    raise InputError(
        "--baud", f"a rate that {megahertz} allows within {100 * TOLERANCE:g} %", actual,
        f"take {near}",
    )  # fmt: skip


def _good(clock_hz: int, baud: int) -> bool:
    return clock_hz >= _FEWEST_CLOCKS * baud and abs(baud_error(clock_hz, baud)) <= TOLERANCE
