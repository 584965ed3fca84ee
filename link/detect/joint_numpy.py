"""The joint detector in numpy, as the baseline of benchmarks.

It processes one symbol and one pixel of every cell at a time, then the chain of bits over all
cells, with the exact logarithm of a sum.
"""

from __future__ import annotations

import numpy as np

from cosim.spikes.viform import WORD, Words
from link.detect.counting import CONTEXT, PAIRS, PART, PHASES
from link.detect.detector import LIMIT, Soft
from link.detect.geometry import PLACES, CellImages
from link.detect.joint import AROUND, Joint


def _evidence(detector: Joint, words: Words, start_tick: int, symbol: int) -> Soft:
    """ln P(spikes | bits) of a symbol minus that for both bits off, (cells, PAIRS).

    The words must contain the symbol, and the sensor every pixel.
    """
    cells: CellImages = detector.cells
    whole, _ = detector.tables()
    time, place = detector.timing, cells.places
    dx, dy = detector.shifts(symbol, 1)[0]
    u, v = cells.x + dx, cells.y + dy
    x, y = np.floor(u + 0.5).astype(np.intp), np.floor(v + 0.5).astype(np.intp)
    qx = np.minimum(((u - x + 0.5) * PLACES).astype(np.intp), PLACES - 1)
    qy = np.minimum(((v - y + 0.5) * PLACES).astype(np.intp), PLACES - 1)
    begin = time.start(symbol, y) + detector.delay
    tick = np.floor(begin).astype(np.intp)
    phase = np.minimum(((begin - tick) * PHASES).astype(np.intp), PHASES - 1)
    out = np.zeros((cells.x.size, PAIRS), np.float32)
    count = place.count[cells.region, qy, qx]
    for part in range(whole.shape[2]):
        bit = tick - CONTEXT - start_tick + part * PART
        w, low = bit // WORD, (bit % WORD).astype(np.uint64)
        later = np.minimum(w + 1, len(words) - 1)
        for k in range(count.max()):
            px, py = x + place.dx[cells.region, qy, qx, k], y + place.dy[cells.region, qy, qx, k]
            both = words[w, py, px].astype(np.uint64)
            both |= words[later, py, px].astype(np.uint64) << np.uint64(WORD)
            pattern = (both >> low) & np.uint64((1 << (PART + CONTEXT)) - 1)
            share = place.share[cells.region, qy, qx, k]
            gain = whole[cells.region, phase, part, share, pattern.astype(np.intp)]
            out += np.where((k < count)[:, None], gain, np.float32(0))
    return out


def soft_by_numpy(
    detector: Joint, words: Words, start_tick: int, first_symbol: int, count: int
) -> Soft:
    """Soft values of `Joint.soft`, without its linear approximation."""
    symbols = count + 2 * AROUND
    evidence = [
        _evidence(detector, words, start_tick, first_symbol - AROUND + n) for n in range(symbols)
    ]
    ahead = [np.zeros((2, evidence[0].shape[0]), np.float32)]
    for each in evidence:
        off, on = ahead[-1]
        ahead.append(
            np.stack([
                np.logaddexp(off + each[:, 0], on + each[:, 2]),
                np.logaddexp(off + each[:, 1], on + each[:, 3]),
            ])
        )  # fmt: skip
    off = on = np.zeros(evidence[0].shape[0], np.float32)
    out = np.empty((count, evidence[0].shape[0]), np.float32)
    for n in range(symbols - 1, AROUND - 1, -1):
        if n - AROUND < count:
            out[n - AROUND] = ahead[n + 1][1] + on - ahead[n + 1][0] - off
        each = evidence[n]
        off, on = (
            np.logaddexp(each[:, 0] + off, each[:, 1] + on),
            np.logaddexp(each[:, 2] + off, each[:, 3] + on),
        )
    return np.clip(out, -LIMIT, LIMIT)
