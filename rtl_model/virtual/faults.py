"""Faults of a virtual board, in the notation of the command line.

    drop:rx@100  flip:tx@5000  extra:rx@3   byte lost, byte with an inverted bit, byte sent twice;
                                            rx is towards the board, tx towards the host
    drop:rx%100                             every hundredth byte
    cut@20  cut:tx@6                        no transmission for 150 ms from that byte on
    power-cycle@50                          the board restarts; no transmission for 200 ms
    silent                                  no answers at all
    slow  slow=500                          delay of every answer, ms
    baud=6  noise=0.001                     error of the host's baud, percent; share of bits
    inverted stuck=3,7  stuck=3,7,0                  output bit of a pixel stuck at 1 or at 0
    foreign                                 another design, with another magic word

Bytes are counted from 1 since the start of the board.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

from cosim import InputError
from rtl_model.geometry import Geometry

Way = Literal["rx", "tx"]
Kind = Literal["drop", "flip", "extra", "cut", "power-cycle"]

_ON_BYTES: tuple[Kind, ...] = ("drop", "flip", "extra", "cut", "power-cycle")
_FORMS = (
    "drop|flip|extra:rx|tx@N (or %N), cut@N, power-cycle@N, silent, slow[=MS], baud=PERCENT, "
    "noise=SHARE, stuck=ROW,COLUMN[,0|1] or foreign"
)
_BYTE_MAX = 10**12
_SLOW_MS = 500.0  # default of `slow`, longer than hosts commonly wait


class ByteFault(NamedTuple):
    """A fault of single bytes.

    Attributes:
        kind: kind of the fault.
        way: direction of the byte.
        number: number of the byte, from 1.
        every: whether every `number`-th byte is affected.
    """

    kind: Kind
    way: Way
    number: int
    every: bool = False

    def hits(self, count: int) -> bool:
        """Whether byte `count`, from 1, is affected."""
        return count % self.number == 0 if self.every else count == self.number


class Faults(NamedTuple):
    """All faults of a board; none by default.

    Attributes:
        line: faults of single bytes.
        silent: whether the board never answers.
        delay_s: delay of every answer, s.
        baud_error: relative error of the host's baud; 0.06 is 6 % too fast.
        noise: probability that a bit on the line is inverted.
        stuck: (row, column, bit) of pixels with a stuck output.
        foreign: whether the magic word is another design's.
    """

    line: tuple[ByteFault, ...] = ()
    silent: bool = False
    delay_s: float = 0.0
    baud_error: float = 0.0
    noise: float = 0.0
    stuck: tuple[tuple[int, int, int], ...] = ()
    foreign: bool = False

    @property
    def of_pins(self) -> bool:
        """Whether some of the faults need the level "pins"."""
        return bool(self.baud_error or self.noise)

    @property
    def of_design(self) -> bool:
        """Whether some of the faults are of the design, not of the line."""
        return self.foreign or bool(self.stuck)


def parse(texts: Sequence[str], geometry: Geometry | None = None) -> Faults:
    """Parses faults.

    Args:
        texts: texts in the notation above.
        geometry: geometry of the board; the default one if None.

    Raises:
        InputError: for another text, or a pixel outside the board.
    """
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
            return faults._replace(delay_s=_SLOW_MS / 1e3)
        return faults._replace(line=(*faults.line, _line_fault(text)))
    if name == "baud":
        return faults._replace(baud_error=_number(text, value, -50.0, 50.0, "PERCENT") / 100)
    if name == "noise":
        return faults._replace(noise=_number(text, value, 0.0, 1.0, "SHARE"))
    if name == "slow":
        return faults._replace(delay_s=_number(text, value, 0.0, 60_000.0, "MS") / 1e3)
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


def _bad(text: str, must: str = _FORMS, remedy: str = "write one of these") -> InputError:
    return InputError("a fault of the board", must, repr(text[:60]), remedy)
