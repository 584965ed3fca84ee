"""A sensor's data lanes to tiles (`viform_lane.v`, `viform_lines.v`), edge by edge."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from rtl_model.geometry import Geometry
from rtl_model.stream.ring import Tile
from rtl_model.stream.sensor import MARKER, TRAINING, check_word

FIND = 4
"""Training words in a row that are an alignment."""
LOSE = 4
"""Wrong words in a row, outside rows, that are its loss."""
SKEW = 3
"""Largest difference between two lanes, clocks of eight bits."""
_HEAD = 3  # words between marker and bits


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
