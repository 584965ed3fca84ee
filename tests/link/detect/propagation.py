"""Schedule of belief propagation: symbols in order, rounds of messages in each, and charge between.

In a symbol messages go round between pixels and cells a few times, all at once. The charge of each
pixel is then carried on to the next symbol by what is known of its cells. A sweep back carries what
the later spikes say of the charge, and another sweep forward uses both. Where the graph has no
loops the result is exact after two sweeps of as many rounds as the graph is long; with loops it is
an approximation, and its soft values are too sure of themselves by a common factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.detect.detector import LIMIT
from tests.link.detect.belief_kernel import (
    LEVELS,
    LIGHTS,
    advance,
    decide,
    explain,
    laws,
    messages,
    recede,
)
from tests.link.detect.belief_learning import PixelModel
from tests.link.detect.footprints import Footprints

MANY: Final = 9
"""Cells of a footprint that are summed over at most; the others count by their mean."""
ROUNDS: Final = (8, 5)
"""Rounds of messages in a symbol, in each sweep."""
DAMPING: Final = 0.3
"""Share of a cell's last total that is kept in a round."""
Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Graph:
    """The factor graph of a symbol.

    Attributes:
        pixels: camera pixels and the cells that they see.
        begin: (cells + 1,) int64, where the messages to each cell begin in the next two.
        of_pixel, of_seen: (messages,) int64, pixel of a message, and its place in the footprint.
    """

    pixels: Footprints
    begin: Ints
    of_pixel: Ints
    of_seen: Ints


def graph_of(pixels: Footprints, cells: int) -> Graph:
    """Graph of these pixels and of all cells, `cells` in number."""
    place = np.flatnonzero(pixels.share.ravel() > 0)
    cell = pixels.cell.ravel()[place]
    order = np.argsort(cell, kind="stable")
    begin = np.searchsorted(cell[order], np.arange(cells + 1))
    of_pixel, of_seen = np.divmod(place[order], pixels.cell.shape[1])
    return Graph(pixels, begin, of_pixel, of_seen)


def propagate(
    graph: Graph, model: PixelModel, spikes: list[npt.NDArray[np.uint8]], late: Floats,
    known: Floats, many: int = MANY, rounds: tuple[int, ...] = ROUNDS, damping: float = DAMPING,
) -> Floats:  # fmt: skip
    """Log likelihood ratios of all cells, (symbols, cells) float32.

    Args:
        graph: pixels and cells.
        model: model of light and pixels.
        spikes: spikes of each symbol, (pixels, ticks).
        late: (symbols, pixels), as for `belief_kernel.shared`.
        known: (symbols, cells) log likelihood ratios before any spike.
        many: cells of a footprint that are summed over at most.
        rounds: rounds of messages in a symbol, for each sweep.
        damping: damping as for `belief_kernel.decide`.
    """
    pixels, symbols = graph.pixels, len(spikes)
    # The time of a sum doubles with each cell; the largest shares stand first.
    summed = np.minimum((pixels.share > 0).sum(axis=1), many)
    tables = *laws(model.brightest, model.shot, model.softness, model.hard), model.hard
    states, lights = len(tables[2]), int(np.ceil(model.brightest * LIGHTS)) + 2
    count, on, base = len(pixels.row), np.float32(model.on), np.float32(model.off)
    view = pixels.cell, pixels.share, summed, on, base
    whole = model.off + model.on * pixels.share.sum(axis=1)
    low = np.full(count, int(model.off * LIGHTS), np.int64)
    high = np.minimum((whole * LIGHTS).astype(np.int64) + 2, lights)
    charge = np.zeros((symbols + 1, count, states), np.float32)
    charge[0, :, :LEVELS] = 1 / LEVELS
    later = np.ones((symbols + 1, count, states), np.float32)
    back = np.zeros((symbols, *pixels.cell.shape), np.float32)
    total, law = known.copy(), np.empty((count, lights), np.float32)
    mean = np.full((symbols + 2, count), model.off, np.float32)  # from the symbol before on
    mean[1:] += model.on * pixels.share.sum(axis=1) / 2
    for sweep, repeats in enumerate(rounds):
        for n in range(symbols):
            around = mean[n], mean[n + 2]
            explain(
                0,
                count,
                spikes[n],
                charge[n],
                later[n + 1],
                late[n],
                *around,
                low,
                high,
                *tables,
                law,
            )
            for _ in range(repeats):
                messages(0, count, law, *view, total[n], back[n])
                decide(
                    0, known[n].size, known[n], graph.begin, graph.of_pixel, graph.of_seen, back[n],
                    np.float32(damping), np.float32(LIMIT), total[n],
                )  # fmt: skip
            advance(
                0, count, spikes[n], charge[n], late[n], *around, *view, total[n], back[n], lights,
                *tables, charge[n + 1], mean[n + 1],
            )  # fmt: skip
        if sweep + 1 == len(rounds):
            break
        for n in range(symbols - 1, -1, -1):
            recede(
                0, count, spikes[n], later[n + 1], late[n], mean[n], mean[n + 2], *view, total[n],
                back[n], lights, *tables, later[n],
            )  # fmt: skip
    return total
