"""A sensor's data lanes: rows as lane words with faults in bits, and lane words to tiles
(`viform_lane.v`, `viform_lines.v`), edge by edge.

Each lane carries eight columns of every tile, one word (eight bits, the earliest in bit 0) a clock:
the training word in pauses, and for a row the marker, the row's head, the bits and a CRC-8.
`viform_lines.v` describes the head.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt
from fastcrc import crc8

from rtl_model.geometry import Geometry
from rtl_model.stream.ring import Tile

TRAINING = 0xE9
"""Word of a pause. Its rotations differ from each other in four bits or more."""
MARKER = 0x02
"""First word of a row. It differs from all rotations of the training word in four bits or more."""
FIND = 4
"""Training words in a row that are an alignment."""
LOSE = 4
"""Wrong words in a row, outside rows, that are its loss."""
SKEW = 3
"""Largest difference between two lanes, clocks of eight bits."""
_HEAD = 3  # words between marker and bits


class Lines:
    """All lanes: rows are put together and checked, and leave as tiles.

    Args:
        geometry: geometry of the sensor.

    Attributes:
        lanes: each lane's alignment.
        tile: tile at the pins before the next edge; None for none.
        bad_rows, missed_rows: rows with an error, and rows that lack a lane.
    """

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry
        self._row_words = geometry.tiles + _HEAD + 1
        self.lanes = [Lane(self._row_words) for _ in range(geometry.lanes // 8)]
        self.tile: Tile | None = None
        self.bad_rows = self.missed_rows = 0
        self._recent: deque[list[int]] = deque(maxlen=SKEW + 1)  # words of the lanes, latest first
        self._since: list[int | None] = [None] * len(self.lanes)  # clocks since the marker
        self._delay = [0] * len(self.lanes)
        self._row: list[list[int]] | None = None  # words of the row, all lanes of each
        self._leaving: deque[Tile] = deque()
        self._frame = 0

    @property
    def losses(self) -> int:
        """Losses of alignment, over all lanes."""
        return sum(lane.losses for lane in self.lanes)

    def edge(self, bits: Sequence[int]) -> None:
        """A clock edge with eight bits of each lane."""
        self._recent.appendleft([lane.word for lane in self.lanes])
        markers = [lane.marker for lane in self.lanes]
        self.tile = self._leaving.popleft() if self._leaving else None
        since = [0 if marker else age for marker, age in zip(markers, self._since, strict=True)]
        if self._row is not None:
            self._row.append([self._recent[age][n] for n, age in enumerate(self._delay)])
            if len(self._row) == self._row_words:
                self._finish(self._row)
                self._row = None
        elif all(age is not None and age <= SKEW for age in since):
            self._row = []
            self._delay = [age for age in since if age is not None]
            since = [None] * len(since)
        elif any(age is not None and age > SKEW for age in self._since):
            self.missed_rows += 1
            since = [0 if marker else None for marker in markers]
        self._since = [None if age is None or age > SKEW else age + 1 for age in since]
        for lane, part in zip(self.lanes, bits, strict=True):
            lane.edge(part)

    def _finish(self, words: list[list[int]]) -> None:
        """Checks a row; sends it on or drops it."""
        heads, check = words[:_HEAD], words[-1]
        low, middle, high = (each[0] for each in heads)
        row, number = low | (middle & 15) << 8, middle >> 4 | high << 4
        good = all(len(set(head)) == 1 for head in heads) and row < self.geometry.rows
        for n in range(len(self.lanes)):
            good &= check_word(word[n] for word in words[:-1]) == check[n]
        if not good:
            self.bad_rows += 1
            return
        self._frame = (self._frame + (number - self._frame) % 4096) & 0xFFFFFFFF
        for index, tile in enumerate(words[_HEAD:-1]):
            self._leaving.append(
                Tile(self._frame, row, index, int.from_bytes(bytes(tile), "little"))
            )


class Lane:
    """Word alignment of one lane.

    Args:
        row_words: words of a row after its marker.

    Attributes:
        word: aligned, or not yet; before the next edge.
        aligned: whether it is.
        losses: losses of the alignment, each counted an edge after it.
    """

    def __init__(self, row_words: int) -> None:
        self.row_words = row_words
        self.word = self._before = 0
        self.aligned = False
        self.losses = self._lost = 0
        self._slip = 0
        self._settles = False
        self._run = 0  # of training words, or of wrong ones
        self._left = 0  # words of the row

    @property
    def marker(self) -> bool:
        """Whether `word` opens a row."""
        return self.aligned and not self._left and self.word == MARKER

    def edge(self, bits: int) -> None:
        """A clock edge with eight bits, the earliest in bit 0."""
        self.losses, self._lost = self.losses + self._lost, 0
        word, slip = self.word, self._slip
        if not self.aligned:
            self._search(word == TRAINING)
        elif self._left:
            self._left -= 1
        elif word == MARKER:
            self._left, self._run = self.row_words, 0
        else:
            self._run = 0 if word == TRAINING else self._run + 1
            if self._run == LOSE:
                self.aligned, self._run, self._lost = False, 0, 1
        self.word = (bits << 8 | self._before) >> slip & 0xFF
        self._before = bits

    def _search(self, trains: bool) -> None:
        if self._settles:
            self._settles = False
        elif trains:
            self._run += 1
            if self._run == FIND:
                self.aligned, self._run = True, 0
        else:
            self._run = 0
            self._slip = (self._slip + 1) % 8
            self._settles = True


def lane_words(
    planes: Mapping[int, npt.NDArray[np.bool_]], geometry: Geometry, *, training: int, pause: int
) -> npt.NDArray[np.uint8]:
    """The words of all lanes, (clocks, lanes) uint8.

    Args:
        planes: (rows, columns) bool by number.
        geometry: geometry of the sensor; `lanes` is the width of a tile, eight columns a data lane.
        training: clocks of training before the first row.
        pause: clocks of training after each row, at least four.
    """
    wires = geometry.lanes // 8
    parts = [np.full((training, wires), TRAINING, np.uint8)]
    for number, plane in planes.items():
        wide = np.zeros((geometry.rows, geometry.tiles * geometry.lanes), bool)
        wide[:, : geometry.columns] = plane
        words = np.packbits(wide, axis=1, bitorder="little").reshape(geometry.rows, -1, wires)
        for row in range(geometry.rows):
            head = [row & 255, (number & 15) << 4 | row >> 8, number >> 4 & 255]
            lanes = [head + words[row, :, wire].tolist() for wire in range(wires)]
            full = [[MARKER, *lane, check_word(lane)] for lane in lanes]
            parts += [np.array(full, np.uint8).T, np.full((pause, wires), TRAINING, np.uint8)]
    return np.concatenate(parts)


def disturbed(
    lane: npt.NDArray[np.uint8], *, slips: Sequence[tuple[int, int]] = (), wrong: Sequence[int] = ()
) -> npt.NDArray[np.uint8]:
    """A lane with bit errors, then bit slips; its length stays.

    Args:
        lane: words, (clocks,) uint8.
        slips: (place in bits, count): so many zeros are put in there, or, below 0, bits taken out.
        wrong: places of inverted bits.
    """
    bits = np.unpackbits(lane, bitorder="little")
    bits[list(wrong)] ^= 1
    for place, count in sorted(slips, reverse=True):
        if count > 0:
            bits = np.insert(bits, place, np.zeros(count, np.uint8))
        else:
            bits = np.delete(bits, slice(place, place - count))
    missing = max(0, 8 * lane.size - bits.size)
    return np.packbits(np.pad(bits, (0, missing))[: 8 * lane.size], bitorder="little")


def check_word(words: Iterable[int]) -> int:
    """CRC-8 of words: x^8 + x^2 + x + 1 from FF, most significant bit first, not inverted."""
    return int(crc8.smbus(bytes(words), 0xFF))
