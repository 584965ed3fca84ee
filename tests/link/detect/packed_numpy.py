"""The packed detector in numpy: the same whole steps, tick patterns and chain, without packing.

It processes one symbol and one pixel of every cell at a time; the reference of its tests.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD, Words
from link.detect.counting import CONTEXT, PAIRS, PART, PHASES, STEEP, WIDE
from link.detect.detector import LIMIT, Soft
from link.detect.geometry import PLACES
from link.detect.packed import Looks, Packed


def _steps(
    detector: Packed, words: Words, start_tick: int, looks: Looks, look: int, symbol: int
) -> npt.NDArray[np.int64]:
    """ln P(spikes | bits) of a look's symbol minus that for both bits off, in steps, (cells,
    PAIRS).

    Args:
        detector: detector that has learned.
        words, start_tick: spikes, which must contain the symbol, and the tick of their first bit.
        looks, look: all looks, and the number of the one.
        symbol: counted from the look's first; the sensor must contain all of its pixels.
    """
    cells, place = detector.cells, detector.cells.places
    u, v = cells.x + looks.shift[look, 0], cells.y + looks.shift[look, 1]
    x, y = np.floor(u + 0.5).astype(np.intp), np.floor(v + 0.5).astype(np.intp)
    qx = np.minimum(((u - x + 0.5) * PLACES).astype(np.intp), PLACES - 1)
    qy = np.minimum(((v - y + 0.5) * PLACES).astype(np.intp), PLACES - 1)
    row = np.clip(y, 0, len(looks.tick) - 1)
    _, bias = detector.steps
    entries = detector.entries(np.arange(PHASES)) - bias
    first = looks.tick[row, look] + symbol * detector.ticks - CONTEXT - start_tick
    out = np.zeros((cells.x.size, PAIRS), np.int64)
    count = place.count[cells.region, qy, qx]
    for part in range(entries.shape[2]):
        w, low = np.divmod(first + part * PART, WORD)
        later = np.minimum(w + 1, len(words) - 1)
        for k in range(count.max()):
            px, py = x + place.dx[cells.region, qy, qx, k], y + place.dy[cells.region, qy, qx, k]
            both = words[w, py, px].astype(np.uint64)
            both |= words[later, py, px].astype(np.uint64) << np.uint64(WORD)
            pattern = (both >> low.astype(np.uint64)) & np.uint64((1 << (CONTEXT + PART)) - 1)
            at = cells.region, looks.phase[row, look], part, place.share[cells.region, qy, qx, k]
            out[:, 1:] += np.where((k < count)[:, None], entries[*at, pattern.astype(np.intp)], 0)
    return out


def _either(a: Soft, b: Soft) -> Soft:
    near = STEEP * (WIDE - np.abs(a - b))
    return np.asarray(np.maximum(a, b) + np.maximum(near, np.float32(0)))


def packed_by_numpy(
    detector: Packed, words: Words, start_tick: int, first_symbol: int, count: int
) -> Soft:
    """Soft values of `Packed.soft`, with other rounding of the chain.

    The words must contain the symbols and those around them in whole groups.
    """
    group = detector.group
    begin, groups = detector.window(first_symbol, count)
    looks = detector.looks(begin, groups, words.shape[1])
    lengths = (looks.ends - looks.begins) * group
    scale, _ = detector.steps
    evidence = [
        _steps(detector, words, start_tick, looks, look, n).astype(np.float32) / np.float32(scale)
        for look, length in enumerate(lengths)
        for n in range(length)
    ]
    ahead = [np.zeros(detector.cells.x.size, np.float32)]
    for each in evidence:
        _, rose, fell, stayed = each.T
        m = ahead[-1]
        ahead.append(_either(rose, m + stayed) - _either(np.zeros_like(m), m + fell))
    m = np.zeros_like(ahead[0])
    out = np.empty((len(evidence), m.size), np.float32)
    for n in reversed(range(len(evidence))):
        out[n] = ahead[n + 1] + m
        _, rose, fell, stayed = evidence[n].T
        m = _either(fell, m + stayed) - _either(np.zeros_like(m), m + rose)
    return np.clip(out[first_symbol - begin :][:count], -LIMIT, LIMIT)
