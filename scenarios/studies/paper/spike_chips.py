"""Document 000, sections 5.2 and 6: spike rates, the two chips, the windows of the figures."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from cosim import PS, Block, Clock, Light, Piece, Viform
from cosim.run.printed import Row, listed, number
from cosim.spikes.viform import count_spikes
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.latched.setup import set_up_camera
from sensor import CHIPS, CameraSetting, SpikeCamera, isi, tau_image
from sensor.asynchronous import AsynchronousPixels, EventModel

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


def _filmed(chip: str, hertz: float) -> Viform:
    """The stream of a chip that films light far above one spike a cycle, 32 cycles."""
    sets = [
        f"sensor.chip={chip}", f"sensor.clock={hertz:g} Hz", "scene.before=1", "duration=2 ms",
        "scene.at=0 s", "scene.illuminance=1e5 lux", "sensor.lens.f_number=1", "image.at=[20]",
        "image.window=21",
    ]  # fmt: skip
    scenario = cast(Scenario, load("step", sets)[1])
    setup = set_up_camera(scenario, "numba")
    scene, lens = setup.stages(setup.source()).values()
    block = Block(0, 32)
    return (
        setup.plan(scenario.tolerance)
        .camera(None)
        .step(lens.step(scene.step(None, block), block), block)
    )


def _chips() -> list[Row]:
    two = CHIPS["spiketwo"]
    fast, slow = two.clocks
    one, at_20_khz = _filmed("spikeone", fast), _filmed("spiketwo", slow)
    widths = [int(isi(stream, 31).max()) for stream in (one, at_20_khz)]
    micros = [
        n * float(s.clock.period) * 1e6 for n, s in zip(widths, (one, at_20_khz), strict=True)
    ]
    printed = CHIPS["spikeone-450x200"]
    product = printed.width * printed.height
    rows, columns = one.shape
    where = "the stream of a run in far too much light"
    return [
        number("000 §6", "pixels of SpikeOne", "100000", rows * columns, "pixels",
               note=f"{columns} x {rows}, as every public recording has it", by="constant"),
        number("000 §6", "450 x 200", "100000", product, "pixels",
               proof=product != 100_000 and rows * columns == 100_000,
               note=f"the document's error: the product is {product}; the size that is used, "
               f"{columns} x {rows}, has the 100 000", by="constant"),
        number("000 §6", "pixels of SpikeTwo", "1000000", two.width * two.height, "pixels",
               by="constant"),
        number("000 §6", "shortest width at 40 kHz", "25", micros[0], "us", note=where, by="run"),
        number("000 §6", "bits a second of a pixel", "40000", 1e6 / micros[0], "bit/s",
               note="one a width, in that stream", by="run"),
        number("000 §6", "shortest width at 20 kHz", "50", micros[1], "us", note=where, by="run"),
        number("000 §6", "levels of the threshold", "16", two.threshold_levels, by="constant"),
    ]  # fmt: skip


def _figures() -> list[Row]:
    """Figures 3 and 4 at 20 kHz: two pixels without noise. One has light for two spikes a cycle,
    the other for a spike in every fifth."""
    clock = Clock.from_hz(CHIPS["spiketwo"].clocks[1])
    last = max(WINDOWS)
    setting = CameraSetting(replace(CHIPS["spiketwo"], height=1, width=2), clock, 1000.0, 0)
    lux = (np.array([[2.0, 0.2001]]) / setting.rate(1.0)).astype(np.float32)
    light = Light((Piece(0, clock.edge(last + 5), lux, lux),))
    pixels = SpikeCamera(setting.without(["shot noise", "random initial charge"]), None)
    stream = pixels.step(light, Block(0, last + 5))
    counts = [int(count_spikes(stream, last - n, last)[0, 0]) for n in WINDOWS]
    spans = [(clock.edge(last) - clock.edge(last - n)) * 1e-9 for n in WINDOWS]
    brightness = int(tau_image(stream, last - 1)[0, 1])
    return [
        listed("000 fig. 3", "spikes counted in each window of the brightest pixel", WINDOWS,
               counts, "spikes", note="it fires in every cycle", by="component"),
        number("000 §6", "exposure of the fifth picture, 200 cycles", "10", spans[4], "ms",
               by="formula"),
        number("000 §6", "exposure of the sixth picture, 800 cycles", "40", spans[5], "ms",
               by="formula"),
        number("000 fig. 4", "brightness 255 - tau at cycle 800 for tau = 5", "250", brightness,
               "DN", by="component"),
    ]  # fmt: skip
