"""Modes: chosen by a sender, and read by a receiver from the panel itself.

The ids of the four AprilTags (36h11, 587 of them) carry the mode: corner k shows id 4 d_k + k, with
digits d: width of the panel in 32 pixels, its height, cell and ticks, line code and redundancy. So
any part of a stream identifies the mode and the corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from link.line_codes import CATALOGUE
from link.line_codes.code import LineCode

__all__ = ["CELLS", "LINE_CODES", "PARITIES", "STEP", "TICKS", "Mode", "ticks_chosen"]

LINE_CODES: Final = tuple(CATALOGUE)
"""Names of the line codes."""
CELLS: Final = (1, 2, 3, 4, 6, 8, 12, 16)
"""Sides of a cell, panel pixels."""
TICKS: Final = (1, 2, 3, 4, 6, 8, 12, 16)
"""Lengths of a symbol, panel planes."""
PARITIES: Final = (16, 32, 64, 128)
"""Parity bytes of a Reed-Solomon codeword of 255."""
STEP: Final = 32
"""Factor of a panel's sides, pixels."""
_DIGITS: Final = 146
"""Values of a digit: 587 ids for four corners."""


def ticks_chosen(line: str) -> tuple[int, ...]:
    """Returns the lengths of a symbol that a run chooses itself in a line code. Symbols of one tick
    need a training like their data, which scrambled symbols have."""
    return TICKS[0:4] if line == "scrambled" else TICKS[1:4]


def _index(name: str, value: object, known: tuple[object, ...]) -> int:
    if value not in known:
        raise ValueError(f"{name} must be one of {', '.join(map(str, known))}, not {value}")
    return known.index(value)


@dataclass(frozen=True)
class Mode:
    """A mode of transmission.

    Attributes:
        width, height: of the panel, pixels, multiples of 32.
        cell: side of a cell, panel pixels.
        ticks: length of a symbol, panel planes.
        line: name of the line code, applied to each cell independently.
        parity: parity bytes of 255.
    """

    width: int
    height: int
    cell: int
    ticks: int
    line: str
    parity: int

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            size = getattr(self, name)
            if size % STEP or not 4 * STEP <= size <= STEP * (_DIGITS - 1):
                raise ValueError(
                    f"{name} must be a multiple of {STEP} from {4 * STEP} to "
                    f"{STEP * (_DIGITS - 1)} pixels, not {size}"
                )
        _index("cell", self.cell, CELLS)
        _index("ticks", self.ticks, TICKS)
        _index("line", self.line, LINE_CODES)
        _index("parity", self.parity, PARITIES)

    @property
    def format(self) -> int:
        """2 for random training and few pilots, which scrambled symbols have; else 1."""
        return 2 if self.line == "scrambled" else 1

    @property
    def code(self) -> LineCode:
        """The line code."""
        return CATALOGUE[self.line]

    @property
    def tags(self) -> tuple[int, int, int, int]:
        """Ids of the tags at top left, top right, bottom right, bottom left."""
        digits = (
            self.width // STEP,
            self.height // STEP,
            CELLS.index(self.cell) * len(TICKS) + TICKS.index(self.ticks),
            LINE_CODES.index(self.line) * len(PARITIES) + PARITIES.index(self.parity),
        )
        a, b, c, d = (4 * digit + corner for corner, digit in enumerate(digits))
        return a, b, c, d

    @classmethod
    def from_tags(cls, tags: tuple[int, int, int, int]) -> Mode:
        """Returns the mode of these tags. Raises ValueError if they belong to no mode."""
        if [tag % 4 for tag in tags] != [0, 1, 2, 3]:
            raise ValueError(f"tags must be of corners 0, 1, 2 and 3, not {tags}")
        wide, high, size, code = (tag // 4 for tag in tags)
        if size >= len(CELLS) * len(TICKS) or code >= len(LINE_CODES) * len(PARITIES):
            raise ValueError(f"tags must be those of a mode, not {tags}")
        return cls(
            wide * STEP, high * STEP, CELLS[size // len(TICKS)], TICKS[size % len(TICKS)],
            LINE_CODES[code // len(PARITIES)], PARITIES[code % len(PARITIES)],
        )  # fmt: skip
