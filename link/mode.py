"""Modes: what a sender chooses and a receiver reads from the panel itself.

The ids of the four AprilTags (36h11, 587 of them) carry the mode: corner k shows id 4 d_k + k, with
digits d: width of the panel in 32 pixels, its height, cell and ticks, line code and redundancy. So
any stretch of a stream says how to read it, and which corner is which.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from link.line_codes import CATALOGUE
from link.line_codes.code import LineCode

__all__ = ["CELLS", "LINE_CODES", "PARITIES", "STEP", "TICKS", "Mode"]

LINE_CODES: Final = tuple(CATALOGUE)
"""Names of the codes along time."""
CELLS: Final = (1, 2, 3, 4, 6, 8, 12, 16)
"""Panel pixels to the side of a cell."""
TICKS: Final = (1, 2, 3, 4, 6, 8, 12, 16)
"""Panel planes to a symbol."""
PARITIES: Final = (16, 32, 64, 128)
"""Bytes of a Reed-Solomon codeword of 255 that are parity."""
STEP: Final = 32
"""Panel pixels that a panel's sides are multiples of."""
_DIGITS: Final = 146
"""Values of a digit: 587 ids, four corners."""


def _index(name: str, value: object, known: tuple[object, ...]) -> int:
    if value not in known:
        raise ValueError(f"{name} must be one of {', '.join(map(str, known))}, not {value}")
    return known.index(value)


@dataclass(frozen=True)
class Mode:
    """width, height: of the panel, pixels, multiples of 32. cell: panel pixels to its side. ticks:
    panel planes to a symbol. line: code along time, of each cell on its own. parity: bytes of 255.
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
    def code(self) -> LineCode:
        """The code along time."""
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
        """The mode whose `tags` these are. Raises ValueError where they are of no mode."""
        if [tag % 4 for tag in tags] != [0, 1, 2, 3]:
            raise ValueError(f"tags must be of corners 0, 1, 2 and 3, not {tags}")
        wide, high, size, code = (tag // 4 for tag in tags)
        if size >= len(CELLS) * len(TICKS) or code >= len(LINE_CODES) * len(PARITIES):
            raise ValueError(f"tags must be those of a mode, not {tags}")
        return cls(
            wide * STEP, high * STEP, CELLS[size // len(TICKS)], TICKS[size % len(TICKS)],
            LINE_CODES[code // len(PARITIES)], PARITIES[code % len(PARITIES)],
        )  # fmt: skip
