"""A transmission as planes of a panel, of a file or of a spike stream.

Symbols are drawn on cells, cells and tags on pixels, and pixels in words. The four AprilTags in the
panel's corners, the same in every plane, give its position and its mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any, Final, TypeVar

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Clock
from cosim.spikes.viform import WORD, Words, words_for
from link.coding import BlockWriter, Outbox
from link.layout import PERIOD, TAG_MODULES, TRAINING, Layout, closing, pilots, training
from link.line_codes import encode_line
from link.mode import Mode

_Bits = npt.NDArray[np.bool_]
T = TypeVar("T", np.bool_, np.uint32)
_KEPT: Final = 8
"""Number of groups in the state: a run that resumes shows the last ones again."""


class Transmission:
    """A transmission: training, then groups that carry data, then the closing. Several threads may
    read it.

    Args:
        mode: mode of the transmission.
        writer: the data.
        most_symbols: number of symbols after which the transmission is cut; None for no limit.

    Attributes:
        mode, layout: mode and layout of the transmission.
        writer: the data.
        whole: symbols of all data.
        symbols: symbols of the transmission, training and closing included.
        data_end: number of the symbol after the last one that carries data.

    Raises:
        ValueError: for a mode or data that cannot be sent.
    """

    def __init__(self, mode: Mode, writer: BlockWriter, most_symbols: int | None = None) -> None:
        if most_symbols is not None and most_symbols < 1:
            raise ValueError(f"most_symbols must be 1 or more, not {most_symbols}")
        self.mode, self.layout, self.writer = mode, Layout(mode), writer
        carrying = TRAINING + writer.groups * self.layout.group
        self.whole = carrying + self.layout.closing
        self.symbols = self.whole if most_symbols is None else min(self.whole, most_symbols)
        self.data_end = min(carrying, self.symbols)
        self._disparities = {0: np.packbits(np.zeros(self.layout.cells, np.bool_))}
        self._group: tuple[int, _Bits] | None = None
        self._encoding = Lock()

    @property
    def ticks(self) -> int:
        """Planes of a symbol."""
        return self.mode.ticks

    @property
    def planes(self) -> int:
        """Planes of the transmission."""
        return self.symbols * self.mode.ticks

    @property
    def groups(self) -> int:
        """Groups that are shown whole."""
        return max(self.data_end - TRAINING, 0) // self.layout.group

    @cached_property
    def _training(self) -> _Bits:
        return training(self.layout)

    @cached_property
    def _closing(self) -> _Bits:
        return closing(self.layout)

    @cached_property
    def _tags(self) -> tuple[Tag, ...]:
        return draw_tags(self.layout)

    @cached_property
    def _pilots(self) -> tuple[npt.NDArray[np.intp], _Bits]:
        return np.flatnonzero(self.layout.pilot), pilots()

    def _line(self, group: int) -> _Bits:
        """Symbols of the data cells in a group, (symbols, cells)."""
        if self._group is None or self._group[0] != group:
            known, cells = self._disparities, self.layout.cells
            begin = max((n for n in known if n <= group), default=None)
            if begin is None:
                raise ValueError(f"group must be {min(known)} or a later one, not {group}")
            state = np.unpackbits(known[begin], count=cells).view(np.bool_)
            for n in range(begin, group + 1):
                values = self.writer.values(n)[None]
                self._group = n, encode_line(self.mode.line, values, state)
                if n + 1 not in known:
                    known[n + 1] = np.packbits(state)
        assert self._group is not None
        return self._group[1]

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """State of the line code at the last groups, as arrays."""
        last = sorted(self._disparities)[-_KEPT:]
        return {f"disparity/{n}": self._disparities[n] for n in last}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`; earlier groups are not available any more."""
        self._disparities = {int(name.rpartition("/")[2]): bits for name, bits in state.items()}
        self._group = None

    def _check(self, first: int, count: int) -> None:
        if min(first, count) < 0 or first + count > self.symbols:
            raise ValueError(
                f"symbols must be within 0 to {self.symbols}, not {first} to {first + count}"
            )

    def bits(self, first: int, count: int) -> _Bits:
        """Bits of the data cells from symbol `first` on, (count, cells)."""
        self._check(first, count)
        out = np.empty((count, self.layout.cells), np.bool_)
        for n, symbol in enumerate(range(first, first + count)):
            group, within = divmod(symbol - TRAINING, self.layout.group)
            if group < 0:
                out[n] = self._training[symbol]
            elif group < self.writer.groups:
                with self._encoding:
                    out[n] = self._line(group)[within]
            else:
                out[n] = self._closing[symbol - self.data_end]
        return out

    def cells(self, first: int, count: int) -> _Bits:
        """Bits of all cells, (count, rows, columns); those covered by tags are off."""
        rows, columns = self.layout.shape
        out = np.zeros((count, rows * columns), np.bool_)
        out[:, self.layout.data] = self.bits(first, count)
        at, known = self._pilots
        out[:, at] = known[np.arange(first, first + count) % PERIOD, None]
        return out.reshape(count, rows, columns)

    def pixels(self, symbol: int) -> _Bits:
        """Panel's pixels in every plane of a symbol, (height, width)."""
        return self._spread(self.cells(symbol, 1)[0], np.bool_(True))

    def words(self, first_plane: int, planes: int) -> Words:
        """Planes from `first_plane` on as words, (ceil(planes / 32), height, width) uint32.

        After the last plane the panel is dark.
        """
        if first_plane < 0 or planes < 0:
            raise ValueError(f"planes must be 0 or more, not {first_plane}, {planes}")
        out = np.empty((words_for(planes), self.mode.height, self.mode.width), np.uint32)
        stop = min(first_plane + planes, self.planes)
        for n in range(len(out)):
            low = first_plane + n * WORD
            high = max(min(low + WORD, stop), low)
            lit = np.zeros(self.layout.shape, np.uint32)
            for symbol in range(low // self.ticks, -(-high // self.ticks) if high > low else 0):
                begin = max(symbol * self.ticks, low) - low
                end = min((symbol + 1) * self.ticks, high) - low
                mask = np.uint32((1 << end) - (1 << begin))
                lit |= np.where(self.cells(symbol, 1)[0], mask, np.uint32(0))
            out[n] = self._spread(lit, np.uint32((1 << (high - low)) - 1))
        return out

    def _spread(self, cells: npt.NDArray[T], on: T) -> npt.NDArray[T]:
        """Panel's pixels of cells, with `on` where tags are bright."""
        out = np.zeros((self.mode.height, self.mode.width), cells.dtype)
        _enlarge(cells, self.mode.cell, out)
        for tag in self._tags:
            out[tag.place] = np.where(tag.bright, on, np.zeros((), cells.dtype))
        return out


class FileTransmission(Transmission):
    """A transmission of a file.

    Args:
        mode: mode of the transmission.
        data, name: bytes and name of the file.
        interleave, overhead, rates: interleaving, overhead and rates as in `Outbox`.
        most_symbols: limit of the number of symbols, as in `Transmission`.

    Attributes:
        outbox: the file in frames.
    """

    def __init__(
        self, mode: Mode, data: bytes, name: str, *, interleave: bool = True,
        overhead: float = 0.05, most_symbols: int | None = None, rates: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self.outbox = Outbox(
            data, name, Layout(mode), interleave=interleave, overhead=overhead, rates=rates
        )
        super().__init__(mode, self.outbox, most_symbols)

    @property
    def sent_whole(self) -> bool:
        """Whether at least as many frames are shown as the file fills; False if most_symbols cuts
        it."""
        return self.outbox.frames_by(self.groups) >= self.outbox.frames_needed


@dataclass(frozen=True, eq=False)
class PlaneStream:
    """The planes of a transmission: plane p is cycle p, panel pixels are pixels.

    Attributes:
        sent: the transmission.
        clock: clock of the panel.
    """

    sent: Transmission
    clock: Clock

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the panel."""
        return self.sent.mode.height, self.sent.mode.width

    @property
    def cycles(self) -> int:
        """Number of planes."""
        return self.sent.planes

    def read_words(self, first: int, stop: int) -> Words:
        """Words of the stream; see `SpikeStream`."""
        count = max(min(stop * WORD, self.cycles) - first * WORD, 0)
        return np.ascontiguousarray(self.sent.words(first * WORD, count))


@dataclass(frozen=True, eq=False)
class Tag:
    """A tag on the panel.

    Attributes:
        number: id in the family 36h11.
        place: rows and columns of panel pixels that it covers.
        bright: (side, side) bool, pixels that are on, its margin of one module included.
    """

    number: int
    place: tuple[slice, slice]
    bright: npt.NDArray[np.bool_]


def draw_tags(layout: Layout) -> tuple[Tag, ...]:
    """Tags at top left, top right, bottom right, bottom left; they are the same in every plane.

    The family is that of Olson, ICRA 2011, and Wang & Olson, IROS 2016.
    """
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    side, black = layout.tag, (TAG_MODULES - 2) * layout.module
    down, right = layout.mode.height - side, layout.mode.width - side
    tags = []
    for number, (top, left) in zip(
        layout.mode.tags, ((0, 0), (0, right), (down, right), (down, 0)), strict=True
    ):
        marker = np.asarray(cv2.aruco.generateImageMarker(dictionary, number, black)) > 127
        bright = np.pad(marker, layout.module, constant_values=True)
        tags.append(Tag(number, (slice(top, top + side), slice(left, left + side)), bright))
    return tuple(tags)


@njit(cache=True, nogil=True)
def _enlarge(cells, side, out):  # type: ignore[no-untyped-def]
    """Fills out, (height, width), with cells, (rows, columns), of side x side pixels."""
    for row in range(cells.shape[0] * side):
        line = cells[row // side]
        for column in range(line.size):
            for n in range(column * side, (column + 1) * side):
                out[row, n] = line[column]
