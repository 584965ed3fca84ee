"""Document 000, sections 5.2 and 6: spike rates, the two chips, the windows of the figures."""

from __future__ import annotations

import numpy as np

from cosim import PS, Clock, Light, Piece, Viform
from cosim.run.printed import Row, listed, number
from cosim.spikes.viform import count_spikes
from sensor import CHIPS, tau_image
from sensor.asynchronous import AsynchronousPixels, EventModel

__all__ = ["chip_rows"]

WINDOWS = (1, 2, 5, 50, 200, 800)
"""Windows of the six images in figure 3, cycles."""


def chip_rows() -> list[Row]:
    """The rows of all numbers, in order."""
    return [*_rates(), *_chips(), *_figures()]


def _rates() -> list[Row]:
    """A saturated pixel, whose shortest width is 1 us, for 1 ms."""
    clock, stop = Clock(1_000_000), PS // 1000
    plane = np.ones((1, 1), np.float32)
    light = Light((Piece(0, stop, plane, plane),))
    pixels = AsynchronousPixels(EventModel(100, 1, clock, PS // clock.num), (1, 1), 1e12)
    rate = len(pixels.step(light, 0, stop)) * PS / stop
    two = CHIPS["spiketwo"]
    return [
        number("000 §5.2", "most spikes a second of a pixel whose shortest width is 1 us", "1e6",
               rate, "1/s", note="an asynchronous pixel that the light fills in a shorter time",
               by="component"),
        number("000 §5.2", "of a million such pixels", "1e12", rate * two.width * two.height,
               "1/s", by="component"),
    ]  # fmt: skip


def _chips() -> list[Row]:
    one, two = CHIPS["spikeone"], CHIPS["spiketwo"]
    fast, slow = (Clock.from_hz(hz) for hz in two.clocks)
    printed_sides = (450, 200)
    product = printed_sides[0] * printed_sides[1]
    pixels = one.width * one.height
    return [
        number("000 §6", "pixels of SpikeOne", "100000", pixels, "pixels",
               note=f"{one.width} x {one.height}, as every public recording has it", by="constant"),
        number("000 §6", "450 x 200", "100000", product, "pixels",
               proof=product != 100_000 and pixels == 100_000,
               note=f"the document's error: the product is {product}; the size that is used, "
               f"{one.width} x {one.height}, has the 100 000", by="constant"),
        number("000 §6", "pixels of SpikeTwo", "1000000", two.width * two.height, "pixels",
               by="constant"),
        number("000 §6", "shortest width at 40 kHz", "25", fast.edge(1) * 1e-6, "us",
               by="constant"),
        number("000 §6", "bits a second of a pixel", "40000", fast.cycles_in(PS), "bit/s",
               by="constant"),
        number("000 §6", "shortest width at 20 kHz", "50", slow.edge(1) * 1e-6, "us",
               by="constant"),
        number("000 §6", "levels of the threshold", "16", two.threshold_levels, by="constant"),
    ]  # fmt: skip


def _figures() -> list[Row]:
    """Figures 3 and 4 at 20 kHz: one pixel fires in every cycle, another in every fifth."""
    clock = Clock.from_hz(CHIPS["spiketwo"].clocks[1])
    last = max(WINDOWS)
    planes = np.zeros((last + 5, 1, 2), bool)
    planes[:, 0, 0] = True
    planes[::5, 0, 1] = True
    stream = Viform.from_planes(planes, clock)
    counts = [int(count_spikes(stream, last - n, last)[0, 0]) for n in WINDOWS]
    spans = [(clock.edge(last) - clock.edge(last - n)) * 1e-9 for n in WINDOWS]
    brightness = int(tau_image(stream, last - 1)[0, 1])
    return [
        listed("000 fig. 3", "spikes counted in each window of the brightest pixel", WINDOWS,
               counts, "cycles", by="component"),
        number("000 §6", "exposure of the fifth picture, 200 cycles", "10", spans[4], "ms",
               by="formula"),
        number("000 §6", "exposure of the sixth picture, 800 cycles", "40", spans[5], "ms",
               by="formula"),
        number("000 fig. 4", "brightness 255 - tau at cycle 800 for tau = 5", "250", brightness,
               "DN", by="component"),
    ]  # fmt: skip
