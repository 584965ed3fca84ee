"""Belief propagation over the footprints of camera pixels: for cells as small as a camera pixel.

Where a camera pixel sees several cells of like share, a decision by each cell's own pixels
(`joint`) takes its neighbours for noise. Here the spikes of all pixels and the bits of all cells
form a factor graph, and messages between them go round until every pixel is explained
(`propagation`). The charge of a pixel is carried from symbol to symbol as a distribution. Light,
blur and place are learned from the training by likelihood (`belief_learning`), so that a receiver's
registration need not be right to a hundredth of a pixel, but the image must then stay where it was
but for the registration's drift. Slow: some 20 microseconds for each pixel and symbol.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, Words
from link.detect.detector import Bits, Soft, bits_held
from link.layout import PERIOD, TRAINING, Layout, pilots, training
from link.timing import Registration, Timing
from tests.link.detect.belief_learning import PixelModel, learn_model
from tests.link.detect.footprints import footprints
from tests.link.detect.propagation import graph_of, propagate

SEEN: Final = 14
"""Largest number of cells in a footprint."""
_BEFORE: Final = 4
"""Symbols before the first that is asked for: the charge is then known well enough."""
_AFTER: Final = 1
"""Symbols after the last that is asked for."""
_SURE: Final = np.float32(20.0)
"""Magnitude of the log likelihood ratio of a known bit."""
_NOT_KNOWN: Final = 2
"""Mark of a tick outside the words."""
Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float32]


class BeliefPropagation:
    """The detector by belief propagation; see `Detector`.

    Learning again starts from what was learned before, and is a new fit to the given symbols alone.

    Attributes:
        timing: time of the symbols.
        model: what has been learned of light, image and pixels; None before.
    """

    def __init__(
        self, layout: Layout, registration: Registration, timing: Timing, pixel: object = None
    ) -> None:
        self._layout, self._registration, self.timing = layout, registration, timing
        self._ticks = layout.mode.ticks
        self.model: PixelModel | None = None

    def _known(self, first_symbol: int, count: int, trained: int) -> Floats:
        """Log likelihood ratios of all cells before any spike, (count, cells).

        Pilots are sure, and of the first `trained` symbols the training and the darkness before it.
        """
        layout, number = self._layout, first_symbol + np.arange(count)
        out = np.zeros((count, layout.free.size), np.float32)
        sure = np.where(pilots()[number % PERIOD], _SURE, -_SURE)
        out[:, np.flatnonzero(layout.pilot)] = sure[:, None]
        first = number[:trained]
        known = np.flatnonzero((first >= 0) & (first < TRAINING))
        bits = training(layout)[first[known]]
        out[np.ix_(known, layout.data)] = np.where(bits, _SURE, -_SURE)
        out[:trained][first < 0] = -_SURE
        return out

    def _begins(self, first_symbol: int, count: int, row: Ints) -> tuple[Ints, Floats]:
        """First tick of symbols in rows, and by how much they begin after it, ticks, -1/2 to 1/2:
        (count, rows) both."""
        start = self.timing.start(first_symbol + np.arange(count)[:, None], row)
        tick = np.rint(start).astype(np.int64)
        return tick, (start - tick).astype(np.float32)

    def _spikes(
        self, words: Words, start_tick: int, stop: int, row: Ints, column: Ints, tick: Ints
    ) -> npt.NDArray[np.uint8]:
        """Spikes of pixels in a symbol, (pixels, ticks) uint8.

        Args:
            words, start_tick: spikes.
            stop: number of ticks to read.
            row, column: (pixels,) of the camera.
            tick: (pixels,) in which the symbol begins.
        """
        at = tick[:, None] - start_tick + np.arange(self._ticks)
        inside = (at >= 0) & (at < stop)
        at = np.where(inside, at, 0)
        spike = (words[at // WORD, row[:, None], column[:, None]] >> (at % WORD)) & 1
        return np.where(inside, spike, _NOT_KNOWN).astype(np.uint8)

    def _shift(self, first_symbol: int, count: int) -> tuple[float, float]:
        middle = self.timing.start(first_symbol + count / 2, self.timing.rows / 2)
        return self._registration.shift(float(middle))

    def learn(self, words: Words, start_tick: int, known: Bits, first_symbol: int) -> None:
        layout = self._layout
        if known.ndim != 2 or known.shape[1] != layout.cells:
            raise ValueError(f"known must be of {layout.cells} cells, not {known.shape}")
        cells = self._known(first_symbol, len(known), 0) > 0
        cells[:, layout.data] = known
        shift = self._shift(first_symbol, len(known))
        start = self.model or PixelModel(blur=max(self._registration.blur, 0.1))
        seen = footprints(layout, self._registration, words.shape[1:], start.blur, shift, SEEN)
        tick, late = self._begins(first_symbol, len(known), seen.row)
        held = len(words) * WORD
        spikes = np.stack([
            self._spikes(words, start_tick, held, seen.row, seen.column, each) for each in tick
        ], axis=1)  # fmt: skip
        # Cells of tags are unknown; to `soft` they are cells that no one asks for.
        known_all = (layout.free.ravel()[seen.cell] | (seen.share == 0)).all(axis=1)
        whole = (spikes != _NOT_KNOWN).all(axis=(1, 2)) & known_all
        if not whole.any():
            raise ValueError("the known symbols must lie within the words")
        self.model = learn_model(
            layout, self._registration, seen.row[whole], seen.column[whole], spikes[whole], cells,
            late.mean(axis=0)[whole], shift, start,
        )  # fmt: skip

    def learn_pilots(self, words: Words, start_tick: int, first_symbol: int, count: int) -> None:
        raise ValueError(
            "belief propagation must learn from the training: a pilot's pixels also see cells "
            "that are not known"
        )

    def soft(
        self, words: Words, start_tick: int, first_symbol: int, count: int,
        stop_tick: int | None = None,
    ) -> Soft:  # fmt: skip
        if self.model is None:
            raise ValueError("the detector must have learned from known symbols before")
        model, layout = self.model, self._layout
        first, symbols = first_symbol - _BEFORE, count + _BEFORE + _AFTER
        dx, dy = self._shift(first_symbol, count)
        pixels = footprints(
            layout, self._registration, words.shape[1:], model.blur, (dx + model.dx, dy + model.dy),
            SEEN,
        )  # fmt: skip
        graph = graph_of(pixels, layout.free.size)
        tick, late = self._begins(first, symbols, pixels.row)
        stop = bits_held(words, start_tick, stop_tick)
        spikes = [
            self._spikes(words, start_tick, stop, pixels.row, pixels.column, each) for each in tick
        ]
        total = propagate(graph, model, spikes, late, self._known(first, symbols, _BEFORE))
        out = total[_BEFORE : _BEFORE + count, layout.data]
        seen = [bool((each != _NOT_KNOWN).any()) for each in spikes[_BEFORE : _BEFORE + count]]
        out[~np.array(seen, np.bool_)] = 0.0
        return np.ascontiguousarray(out)
