"""Modes: chosen by a sender, and read by a receiver from the panel itself.

The ids of the four AprilTags (36h11, 587 of them) carry the mode: corner k shows id 4 d_k + k, with
digits d: width of the panel in 32 pixels, its height, cell and ticks, codes and redundancy. So any
part of a stream identifies the mode and the corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Protocol

from link.line_codes import CATALOGUE
from link.line_codes.code import LineCode

LINE_CODES: Final = tuple(CATALOGUE)
"""Names of the line codes."""
CELLS: Final = (1, 2, 3, 4, 6, 8, 12, 16)
"""Sides of a cell, panel pixels."""
TICKS: Final = (1, 2, 3, 4, 6, 8, 12, 16)
"""Lengths of a symbol, panel planes."""
PARITIES: Final = (16, 32, 64, 128)
"""Parity bytes of a Reed-Solomon codeword of 255."""
CODES: Final = ("reed-solomon", "ldpc")
"""Codes of the words, by their names in scenarios."""
RATES: Final = (0.75, 0.8, 0.84, 0.88, 0.91, 0.935, 0.955, 0.97)
"""Rates of the low-density parity-check codes. From one to the next, the information that a code
needs of a bit grows by .02 to .05 (`link.theory.words`)."""
EVERY_RATE: Final = (0.4, 0.5, 0.55, 0.6, 0.65, 0.7, *RATES)
"""Rates of a mode with a rate for each block, in the order of their numbers in a block's header, so
a new one goes to the end."""
_WORD: Final = 255
"""Bytes of a Reed-Solomon codeword."""
STEP: Final = 32
"""Factor of a panel's sides, pixels."""
_DIGITS: Final = 146
"""Values of a digit: 587 ids for four corners."""
_LDPC: Final = 64
"""Value of the fourth digit for the first of RATES. Line codes and parities are below it."""
_ADAPTIVE: Final = 96
"""Value of the fourth digit for a rate for each block."""


class Modem(Protocol):
    """How bytes are to become planes; "auto" is chosen from pilots.

    Attributes:
        cell, ticks, line, code, parity, rate: Parts of a mode, or "auto"; `rate` may be "adaptive".
        interleave: Whether each codeword is spread over the panel.
        overhead: Frames beyond the file's own, as a share of them.
        detector: Name of the receiver's detector.
    """

    cell: Any
    ticks: Any
    line: Any
    code: Any
    parity: Any
    rate: Any
    interleave: bool
    overhead: float
    detector: Any


def ticks_chosen(line: str) -> tuple[int, ...]:
    """Lengths of a symbol that a run chooses itself in a line code. Symbols of one tick need a
    training like their data, which scrambled symbols have."""
    return TICKS[0:4] if line == "scrambled" else TICKS[1:4]


def codes_of(line: str) -> list[tuple[int | None, float | None]]:
    """Parities and rates of a mode with a line code: of Reed-Solomon codes, and of low-density
    parity-check codes for scrambled symbols, whose soft values are those of bits."""
    codes: list[tuple[int | None, float | None]] = [(parity, None) for parity in PARITIES]
    return codes + [(None, rate) for rate in RATES] if line == "scrambled" else codes


def word_code(parity: int | None, rate: float | None) -> str:
    """Name of a code of words, for people. Without both, each block has a rate."""
    if parity is not None:
        return f"Reed-Solomon ({_WORD}, {_WORD - parity})"
    if rate is None:
        return "LDPC of a rate for each block"
    return f"LDPC of rate {rate:g}"


def _index(name: str, value: object, known: tuple[object, ...]) -> int:
    if value not in known:
        raise ValueError(f"{name} must be one of {', '.join(map(str, known))}, not {value}")
    return known.index(value)


@dataclass(frozen=True)
class Mode:
    """A mode of transmission.

    Attributes:
        width, height: width and height of the panel, pixels, multiples of 32.
        cell: side of a cell, panel pixels.
        ticks: length of a symbol, panel planes.
        line: name of the line code, applied to each cell independently.
        parity: parity bytes of 255 of a Reed-Solomon code; None for the other code.
        rate: rate of a low-density parity-check code, which needs scrambled symbols; None for the
            other code.
        adaptive: whether each block has a low-density parity-check code of its own rate, one of
            EVERY_RATE; then parity and rate are None.
    """

    width: int
    height: int
    cell: int
    ticks: int
    line: str
    parity: int | None
    rate: float | None = None
    adaptive: bool = False

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
        if [self.parity is None, self.rate is None, not self.adaptive].count(False) != 1:
            raise ValueError(
                f"a mode must have parity or rate, or a rate for each block, not {self.parity}, "
                f"{self.rate} and {self.adaptive}"
            )
        if self.parity is not None:
            _index("parity", self.parity, PARITIES)
        elif self.line != "scrambled":
            raise ValueError(f"line must be scrambled with a rate, not {self.line}")
        elif self.rate is not None:
            _index("rate", self.rate, RATES)

    @property
    def format(self) -> int:
        """2 for random training and few pilots, which scrambled symbols have; else 1."""
        return 2 if self.line == "scrambled" else 1

    @property
    def code(self) -> LineCode:
        """The line code."""
        return CATALOGUE[self.line]

    @property
    def symbols(self) -> tuple[int, int, str]:
        """What decides how symbols are received: cell, ticks and line code."""
        return self.cell, self.ticks, self.line

    @property
    def word_code(self) -> str:
        """Name of the words' code, with its redundancy, for people."""
        return word_code(self.parity, self.rate)

    @property
    def word_rate(self) -> float:
        """Share of data in the words; with a rate for each block, the largest."""
        if self.parity is not None:
            return (_WORD - self.parity) / _WORD
        return EVERY_RATE[-1] if self.rate is None else self.rate

    @property
    def tags(self) -> tuple[int, int, int, int]:
        """Ids of the tags at top left, top right, bottom right, bottom left."""
        digits = (
            self.width // STEP,
            self.height // STEP,
            CELLS.index(self.cell) * len(TICKS) + TICKS.index(self.ticks),
            self._codes,
        )
        a, b, c, d = (4 * digit + corner for corner, digit in enumerate(digits))
        return a, b, c, d

    @property
    def _codes(self) -> int:
        """The fourth digit."""
        if self.adaptive:
            return _ADAPTIVE
        if self.rate is not None:
            return _LDPC + RATES.index(self.rate)
        assert self.parity is not None
        return LINE_CODES.index(self.line) * len(PARITIES) + PARITIES.index(self.parity)

    @classmethod
    def from_tags(cls, tags: tuple[int, int, int, int]) -> Mode:
        """Mode of these tags. Raises ValueError if they belong to no mode."""
        if [tag % 4 for tag in tags] != [0, 1, 2, 3]:
            raise ValueError(f"tags must be of corners 0, 1, 2 and 3, not {tags}")
        wide, high, size, code = (tag // 4 for tag in tags)
        of_ldpc = _LDPC <= code < _LDPC + len(RATES)
        known = of_ldpc or code == _ADAPTIVE or code < len(LINE_CODES) * len(PARITIES)
        if size >= len(CELLS) * len(TICKS) or not known:
            raise ValueError(f"tags must be those of a mode, not {tags}")
        shape = wide * STEP, high * STEP, CELLS[size // len(TICKS)], TICKS[size % len(TICKS)]
        if of_ldpc:
            return cls(*shape, "scrambled", None, RATES[code - _LDPC])
        if code == _ADAPTIVE:
            return cls(*shape, "scrambled", None, adaptive=True)
        return cls(*shape, LINE_CODES[code // len(PARITIES)], PARITIES[code % len(PARITIES)])
