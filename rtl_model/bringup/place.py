"""The board that `--port` or `board.port` names: a real one's port, or a virtual board that is
started and lives as long as it is used."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rtl_model.geometry import Geometry
    from rtl_model.host import CsrMap
    from rtl_model.virtual import Level, VirtualBoard

__all__ = ["VIRTUAL", "Opened", "csr_of", "known_level", "opened", "virtual_board"]

VIRTUAL = "virtual"
"""The port's name that asks for a virtual board."""


@dataclass(frozen=True)
class Opened:
    """A port that can be opened: a real one, or a virtual board's that runs."""

    url: str
    baud: int
    simulated: bool | None
    time_scale: float


def known_level(level: str) -> Level:
    """`level`, or InputError."""
    from cosim import InputError
    from rtl_model.virtual import LEVELS

    known = next((name for name in LEVELS if name == level), None)
    if known is None:
        raise InputError("--level", "one of " + ", ".join(LEVELS), repr(level), "choose one")
    return known


def virtual_board(
    *,
    baud: int,
    level: str = "bytes",
    faults: list[str] | None = None,
    geometry: Geometry | None = None,
    link: Path | None = None,
    imager: str | None = None,
) -> VirtualBoard:
    """A virtual board, not yet begun; without a geometry the table's own, at a clock that the
    simulator keeps up with. link: to make for its port. imager: in its place. InputError for a
    level, a fault or a baud that cannot be."""
    from cosim import InputError
    from rtl_model.geometry import Geometry
    from rtl_model.virtual import VirtualBoard, nominal_clock

    known = known_level(level)
    size = geometry or Geometry(clock_hz=nominal_clock(known, baud), baud=baud)
    if size.bit_clocks < 4:
        must = f"at most a quarter of the virtual board's clock, {size.clock_hz // 4}"
        raise InputError("--baud", must, str(baud), "lower it")
    return VirtualBoard(size, level=known, faults=faults or (), link=link, imager=imager)


@contextmanager
def opened(
    port: str,
    baud: int,
    time_scale: float | None,
    *,
    level: str = "bytes",
    faults: list[str] | None = None,
    geometry: Geometry | None = None,
) -> Iterator[Opened]:
    """What to open for `--port`; a virtual board lives as long as the block."""
    from cosim import InputError

    if time_scale is not None and not 0 < time_scale < 1e6:
        raise InputError("--time-scale", "above 0", str(time_scale), "1 is a real board's")
    if baud <= 0:
        raise InputError("--baud", "above 0", str(baud), "115200 is common")
    if port != VIRTUAL:
        if faults or level != "bytes":
            raise InputError(
                "--fault and --level", "given with --port virtual", f"with {port}", "leave them out"
            )
        yield Opened(port, baud, None, time_scale or 1.0)
        return
    with virtual_board(baud=baud, level=level, faults=faults, geometry=geometry) as board:
        yield Opened(board.port, baud, True, time_scale or board.time_scale)


def csr_of(csr: Path | None) -> CsrMap | None:
    """The map of `--csr`, None for our own. InputError for a file that is none."""
    from rtl_model.host import read_csr

    return None if csr is None else read_csr(csr)
