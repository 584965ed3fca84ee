"""What can be wrong with a virtual board, as it is written on a command line.

    drop:rx@100  flip:tx@5000  extra:rx@3   a byte lost, with one bit turned over, sent twice;
                                            rx is towards the board, tx towards the host
    drop:rx%100                             every hundredth byte
    cut@20  cut:tx@6                        the line carries nothing for 150 ms from that byte on
    power-cycle@50                          the board starts anew; nothing for 200 ms
    silent                                  nothing ever comes back
    slow  slow=500                          every answer comes so many milliseconds late
    baud=6  noise=0.001                     host's baud off by percent; share of bits inverted
    stuck=3,7  stuck=3,7,0                  a pixel's bit stuck at 1 or at 0
    foreign                                 some other design: the magic is not ours

Bytes are counted from 1 since the board began to listen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

from cosim import InputError
from rtl_model.geometry import Geometry

__all__ = ["ByteFault", "Faults", "Kind", "Way", "parse"]

Way = Literal["rx", "tx"]
Kind = Literal["drop", "flip", "extra", "cut", "power-cycle"]

_ON_BYTES: tuple[Kind, ...] = ("drop", "flip", "extra", "cut", "power-cycle")
_FORMS = (
    "drop|flip|extra:rx|tx@N (or %N), cut@N, power-cycle@N, silent, slow[=MS], baud=PERCENT, "
    "noise=SHARE, stuck=ROW,COLUMN[,0|1] or foreign"
)
_BYTE_MAX = 10**12
_SLOW_MS = 500.0  # of `slow` alone; longer than hosts commonly wait


class ByteFault(NamedTuple):
    """A fault of the `number`-th byte of a way, or of every `number`-th."""

    kind: Kind
    way: Way
    number: int
    every: bool = False

    def hits(self, count: int) -> bool:
        """Whether byte `count`, from 1, is one of its bytes."""
        return count % self.number == 0 if self.every else count == self.number


class Faults(NamedTuple):
    """All faults of a board; without arguments, none.

    Attributes:
        line: of single bytes.
        silent: whether nothing ever comes back.
        late_s: seconds by which every answer is late.
        baud_error: of the host's baud, as a share: 0.06 is 6 % too fast.
        noise: probability that a bit on the line is inverted.
        stuck: (row, column, bit) of pixels.
        foreign: whether the magic is not ours.
    """

    line: tuple[ByteFault, ...] = ()
    silent: bool = False
    late_s: float = 0.0
    baud_error: float = 0.0
    noise: float = 0.0
    stuck: tuple[tuple[int, int, int], ...] = ()
    foreign: bool = False

    @property
    def of_pins(self) -> bool:
        """Whether there must be pins and bits for these to happen on."""
        return bool(self.baud_error or self.noise)

    @property
    def of_design(self) -> bool:
        """Whether these are faults of the design, not of the line."""
        return self.foreign or bool(self.stuck)


def parse(texts: Sequence[str], geometry: Geometry | None = None) -> Faults:
    """Returns the faults that `texts` name. InputError in one line for what is none, and for a
    pixel outside `geometry`."""
    size = Geometry() if geometry is None else geometry
    faults = Faults()
    for text in texts:
        faults = _with(faults, text, size)
    return faults


def _with(faults: Faults, text: str, size: Geometry) -> Faults:
    name, equals, value = text.partition("=")
    if not equals:
        if name == "silent":
            return faults._replace(silent=True)
        if name == "foreign":
            return faults._replace(foreign=True)
        if name == "slow":
            return faults._replace(late_s=_SLOW_MS / 1e3)
        return faults._replace(line=(*faults.line, _line_fault(text)))
    if name == "baud":
        return faults._replace(baud_error=_number(text, value, -50.0, 50.0, "PERCENT") / 100)
    if name == "noise":
        return faults._replace(noise=_number(text, value, 0.0, 1.0, "SHARE"))
    if name == "slow":
        return faults._replace(late_s=_number(text, value, 0.0, 60_000.0, "MS") / 1e3)
    if name == "stuck":
        return faults._replace(stuck=(*faults.stuck, _pixel(text, value, size)))
    raise _bad(text)


def _line_fault(text: str) -> ByteFault:
    every = "%" in text
    head, mark, digits = text.partition("%" if every else "@")
    name, colon, way = head.partition(":")
    kind = next((known for known in _ON_BYTES if known == name), None)
    if kind is None or not mark or not (digits.isascii() and digits.isdecimal()):
        raise _bad(text)
    if len(digits) > 12 or not 1 <= int(digits) <= _BYTE_MAX:
        raise _bad(text, f"a byte from 1 to {_BYTE_MAX}", "count from 1")
    if not colon and kind in ("cut", "power-cycle"):
        way = "rx"
    if way == "rx":
        return ByteFault(kind, "rx", int(digits), every)
    if way == "tx":
        return ByteFault(kind, "tx", int(digits), every)
    raise _bad(text)


def _number(text: str, value: str, least: float, most: float, unit: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not least <= number <= most:
        name = text.partition("=")[0]
        raise _bad(text, f"{name}={unit} of {least:g} to {most:g}", "give such a number")
    return number


def _pixel(text: str, value: str, size: Geometry) -> tuple[int, int, int]:
    parts = value.split(",")
    if len(parts) == 2:
        parts.append("1")
    if len(parts) != 3 or not all(p.isascii() and p.isdecimal() and len(p) < 6 for p in parts):
        raise _bad(text)
    row, column, bit = (int(part) for part in parts)
    if row >= size.rows or column >= size.columns or bit > 1:
        must = f"stuck=ROW,COLUMN[,0|1] in {size.rows} rows and {size.columns} columns from 0"
        raise _bad(text, must, "name a pixel of the board")
    return row, column, bit


def _bad(text: str, must: str = _FORMS, mend: str = "write it like one of these") -> InputError:
    return InputError("a fault of the board", must, repr(text[:60]), mend)
