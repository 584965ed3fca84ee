"""Error rates of all detectors with the sensor's own pixel.

The panel stands directly before the pixels: every panel pixel is one camera pixel, in step with its
clock, without crosstalk and with a uniform background. The results then differ only by the
decision.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.error import CONFIDENCE
from link.detect.catalogue import make_detector
from link.detect.detector import Detector
from link.detect.pixel import PixelLaw, Rule
from link.layout import TRAINING, Layout, pilots, training
from link.mode import Mode
from link.timing import Registration, Timing
from sensor import EFFECTS, make_pixels
from sensor.latched.pixel.charge import Span, to_fixed
from sensor.latched.pixel.model import ExactModel

_FIRST: Final = 8
"""Tick of first light."""
_SLOW: Final = 40
"""Symbols decided at once; the memory of forward-backward grows with them."""
_FEW: Final = 64
"""Largest number of symbols for forward-backward, which is slow."""


@dataclass(frozen=True)
class Compared:
    """Errors of a detector.

    Attributes:
        what: detector and cell, in words.
        bits, errors: decided bits, and wrong ones.
        rate: error rate.
        low, high: Clopper-Pearson limits of the rate.
        gain: rate of the plain receiver over this rate; None if unknown.
        gain_low: lower limit of the gain: the plain receiver's lower limit over this upper limit.
    """

    what: str
    bits: int
    errors: int
    rate: float
    low: float
    high: float
    gain: float | None = None
    gain_low: float | None = None


def _bits(layout: Layout, symbols: int, seed: int) -> npt.NDArray[np.bool_]:
    """Training symbols, then random data; in Manchester pairs if the mode asks for them."""
    rng = np.random.Generator(np.random.Philox(key=seed))
    bits = rng.integers(0, 2, (symbols, layout.cells), np.uint8).astype(np.bool_)
    if layout.mode.line == "manchester":
        bits[1::2] = ~bits[: symbols // 2 * 2 : 2]
    bits[:TRAINING] = training(layout)
    return bits


def _spikes(
    layout: Layout, bits: npt.NDArray[np.bool_], pixel: PixelLaw, seed: int
) -> npt.NDArray[np.uint32]:
    """Words of the exact tier's pixels under these symbols."""
    mode, known = layout.mode, pilots()
    shape = mode.height, mode.width
    assert pixel.reset is not None and pixel.off is not None and pixel.on is not None
    model = ExactModel(
        pixel.threshold, seed, tuple(EFFECTS.values()), pixel.noise, reset=pixel.reset
    )
    camera = make_pixels(model, np.arange(shape[0] * shape[1], dtype=np.uint32), None)
    off, on = (np.int64(to_fixed(level * pixel.threshold)) for level in (pixel.off, pixel.on))
    ticks = _FIRST + len(bits) * mode.ticks + 1
    dark = np.full(shape[0] * shape[1], off)
    spans = [Span(0, _FIRST, dark)]
    for n, symbol_bits in enumerate(bits):
        cells = np.zeros(layout.shape[0] * layout.shape[1], np.bool_)
        cells[layout.data] = symbol_bits
        cells[layout.pilot.ravel()] = known[n % len(known)]
        lit = np.zeros(shape, np.bool_)
        wide = np.kron(cells.reshape(layout.shape), np.ones((mode.cell, mode.cell), np.bool_))
        lit[: wide.shape[0], : wide.shape[1]] = wide
        spans.append(Span(_FIRST + n * mode.ticks, mode.ticks, np.where(lit.ravel(), on, off)))
    spans.append(Span(ticks - 1, 1, dark))
    return camera.expose(spans, ticks).reshape(-1, *shape)


def _count(
    detector: Detector, words: npt.NDArray[np.uint32], bits: npt.NDArray[np.bool_]
) -> tuple[int, int]:
    """Number of bits after the training, and how many of them are decided wrongly."""
    detector.learn(words, 0, bits[:TRAINING], 0)
    wrong = 0
    for n in range(TRAINING, len(bits), _SLOW):
        part = bits[n : n + _SLOW]
        wrong += int(((detector.soft(words, 0, n, len(part)) > 0) != part).sum())
    return (len(bits) - TRAINING) * bits.shape[1], wrong


def comparison(
    *,
    threshold: float = 100.0,
    background: float = 0.1,
    on_level: float = 1.4,
    reset: Rule = "residual",
    size: int = 256,
    symbols: int = 96,
    seed: int = 1,
    confidence: float = CONFIDENCE,
) -> list[Compared]:
    """Error rates of random on-off keying.

    In this order: one pixel and one tick by threshold and by forward-backward, both again in
    Manchester, then joint over 2 x 2 pixels and over two ticks.

    Args:
        threshold: electrons.
        background: light of an OFF tick, thresholds.
        on_level: light of the panel alone in an ON tick, thresholds.
        reset: reset rule.
        size: panel pixels along a side, a multiple of 32; at most 128 for forward-backward.
        symbols: more than the training's 48; at most 64 for forward-backward.
        seed: seed of data and noise.
        confidence: level of the limits.
    """
    from scipy.stats import binomtest

    pixel = PixelLaw(threshold, reset, background, background + on_level)
    out: list[Compared] = []

    def put(what: str, name: str, side: int, cell: int, ticks: int, line: str) -> None:
        layout = Layout(Mode(side, side, cell, ticks, line, 32))
        place = Registration(np.eye(3), np.zeros((0, 3)))
        timing = Timing(float(_FIRST), float(ticks), 0.0, side)
        bits = _bits(layout, min(symbols, _FEW) if name == "forward-backward" else symbols, seed)
        words = _spikes(layout, bits, pixel, seed)
        detector = make_detector(name, layout, place, timing, pixel=pixel)
        total, wrong = _count(detector, words, bits)
        limits = binomtest(wrong, total).proportion_ci(confidence, "exact")
        rate, low, high = wrong / total, float(limits.low), float(limits.high)
        plain = out[0] if out else None
        out.append(
            Compared(
                what, total, wrong, rate, low, high,
                plain.rate / rate if plain and wrong else None,
                plain.low / high if plain else None,
            )
        )  # fmt: skip

    slow = min(size, 128)
    put("threshold, one pixel, one tick", "threshold", size, 1, 1, "none")
    put("forward-backward, one pixel, one tick", "forward-backward", slow, 1, 1, "none")
    put("threshold, Manchester", "threshold", size, 1, 1, "manchester")
    put("forward-backward, Manchester", "forward-backward", slow, 1, 1, "manchester")
    put("joint, 2 x 2 pixels", "joint", size, 2, 1, "none")
    put("joint, two ticks", "joint", size, 1, 2, "none")
    return out
