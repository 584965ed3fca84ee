"""Document 000 (Huang): sections 3 to 5.1, the principle of spiking continuous photographing;
sections 5.2 and 6, spike rates, the two chips, and the windows of the figures."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import cast

import numpy as np

from cosim import PS, Block, Clock, Events, Light, Piece, Viform
from cosim.run.printed import PrintedRow, listed, number, turning_point, unprinted
from cosim.spikes.viform import count_spikes
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.latched.setup import set_up_camera
from sensor import CHIPS, CameraSetting, SpikeCamera, interval_rate, isi, tau_image
from sensor.asynchronous import AsynchronousPixels, EventModel
from sensor.codec import first_spikes, without_transitions
from sensor.device.pattern import DevicePattern
from sensor.dynamic_range import (
    decibels,
    interval_rsd,
    level_step,
    levels_for,
    photons_per_second,
    spike_dynamic_range,
    threshold_for,
)
from sensor.latched.pixel.charge import Span, to_fixed
from sensor.latched.pixel.compiled import CompiledPixels
from sensor.latched.pixel.model import ExactModel

# Assumptions of section 4: lux, um2, quantum efficiency, e; s; e/s.
SUN, AREA, EFFICIENCY, THRESHOLD = 1e5, 100.0, 0.7, 100
SHORTEST = 1e-8
DARK = 100.0
WINDOWS = (1, 2, 5, 50, 200, 800)
"""Windows of the six images in figure 3, cycles."""


def principle_rows() -> list[PrintedRow]:
    """The rows of all numbers, in order."""
    return [*_figure_1(), *_images(), *_light(), *_threshold(), *_chance()]


def _figure_1() -> list[PrintedRow]:
    """The light of fig. 1 on an asynchronous pixel: one level, which doubles during the fifth spike
    and falls to a half during the twelfth."""
    q, level, ms = 1000, 1e6, PS // 1000
    ends = (0, 4 * ms + ms // 2, 8 * ms, 13 * ms)
    planes = [np.full((1, 1), factor, np.float32) for factor in (1.0, 2.0, 0.5)]
    spans = zip(pairwise(ends), planes, strict=True)
    light = Light(tuple(Piece(a, b, plane, plane) for (a, b), plane in spans))
    clock = Clock(1_000_000)

    def fire(change: float) -> tuple[list[int], list[int]]:
        model = EventModel(q, 1, clock, PS // clock.num, change=change, shot=False)
        fired = AsynchronousPixels(model, (1, 1), level).step(light, 0, ends[-1])
        return fired.width.tolist(), fired.instant.tolist()

    widths, instants = fire(0.0)
    _, sent = fire(1.0)
    place = np.zeros(len(widths), np.uint16)
    times = np.cumsum(widths) - 1
    train = Events(place, place, times, np.array(widths), (1, 1), int(times[-1]) + 1, clock)
    coded = first_spikes(train)
    bare = without_transitions(coded)
    first, steady = (np.searchsorted(times, t.time) + 1 for t in (coded, bare))
    where = "an asynchronous pixel under the light of the figure"
    return [
        number("000 fig. 1", "spikes under light of one, two and half a level", "14", len(widths),
               note=where, by="component"),
        number("000 §3.2", "width of spikes 6 to 11 over that of 1 to 4", "0.5",
               widths[5] / widths[0], by="component"),
        number("000 §3.2", "width of spikes 13 and 14 over that of 1 to 4", "2",
               widths[12] / widths[0], by="component"),
        listed("000 §5.2", "first spikes of figure 1", [1, 5, 6, 12, 13], first.tolist(),
               note="the first-spike coder", by="component"),
        listed("000 §5.2", "spikes that a pixel with comparison of widths sends",
               [1, 5, 6, 12, 13], [instants.index(t) + 1 for t in sent],
               note="the comparison in the pixel", by="component"),
        listed("000 §5.2", "first spikes without the instants of change", [1, 6, 13],
               steady.tolist(), note="the first-spike coder", by="component"),
    ]  # fmt: skip


def _images() -> list[PrintedRow]:
    """Latched pixels that receive a threshold in 1, 2, 3, 4 and 256 cycles."""
    q, wanted, cycles = 1000, (1, 2, 3, 4, 256), 600
    charge = to_fixed(q / np.array(wanted)) + 1  # a unit more, so that rounding loses no threshold
    pixels = CompiledPixels(ExactModel(q, 1, ()), np.arange(len(wanted), dtype=np.uint32))
    words = pixels.expose([Span(0, cycles, charge)], cycles).reshape(-1, 1, len(wanted))
    stream = Viform(words, cycles, Clock.from_hz(CHIPS["spiketwo"].clocks[0]))
    widths = isi(stream, cycles - 1)[0]
    rate = interval_rate(widths).astype(float)
    step = float(rate[2] - rate[3]) / level_step(3)
    where = "intervals of a latched pixel under that light"
    return [
        *(
            number("000 §3.3.2", f"light at tau = 1 over that at tau = {tau}", str(tau),
                   round(rate[0] / max(rate[wanted.index(tau)], 1e-9), 6), note=where,
                   by="component")
            for tau in (256, 2, 3)
        ),
        unprinted("000 §3.3.2", "light between tau = 3 and 4 over 1/(tau (tau + 1))", step,
                  holds=abs(step - 1) < 1e-6, note="1/ISI of the reconstruction: 1/12 of white",
                  by="component"),
    ]  # fmt: skip


def _width(
    threshold: int, electrons_per_second: float, dark: float = 0.0, spikes: int = 3
) -> float:
    """Width of the spikes of an asynchronous pixel without noise, seconds. The circuit reads widths
    of a picosecond."""
    clock = Clock(PS)
    model = EventModel(threshold, 1, clock, 1, shot=False)
    plane = np.ones((1, 1), np.float32)
    pattern = DevicePattern(dark=dark) if dark else None
    stop = math.ceil(spikes * threshold / (electrons_per_second + dark) * PS) + spikes
    pixels = AsynchronousPixels(model, (1, 1), electrons_per_second, pattern)
    return float(pixels.step(Light((Piece(0, stop, plane, plane),)), 0, stop).exact[-1]) / PS


def _light() -> list[PrintedRow]:
    """Sections 4.3 and 4.4."""
    photons = photons_per_second(SUN, AREA)
    electrons = photons * EFFICIENCY
    width = _width(THRESHOLD, electrons)
    least = threshold_for(electrons, SHORTEST)
    follows = [_width(q, electrons) >= SHORTEST for q in (math.floor(least), math.ceil(least))]
    chip = CHIPS["spiketwo"]
    on_chip = SUN * chip.electrons_per_lux(photons / (SUN * AREA * 1e-12))
    longest = _width(THRESHOLD, 0.0, DARK)
    shortest = _width(math.ceil(least), electrons)
    where = "width of an asynchronous pixel's spikes"
    return [
        number("000 §4.3", "photons a second on 100 um2 at 1e5 lux", "4.09e10", photons, "1/s",
               note="555 nm: 683 lm/W, 4.09e15 photons/(s m2 lx)", by="formula"),
        number("000 §4.3", "time in which 100 electrons gather", "0.35e-8", width, "s", note=where,
               by="component"),
        number("000 §4.3", "the same on the SpikeTwo preset's pixel", "3.5",
               _width(THRESHOLD, on_chip) * 1e9, "ns", note="10 um pitch, QE 0.7: its preset",
               by="component"),
        unprinted("000 §4.3", "least Q for a readout of 10 ns at 1e5 lux", math.ceil(least), "e",
                  holds=follows == [False, True],
                  note="with one electron less the pixel is full before the 10 ns of section 4.4",
                  by="component"),
        number("000 §4.4", "time in which a dark current of 100 e/s makes one electron", "10",
               _width(1, 0.0, DARK) * 1e3, "ms", note=where, by="component"),
        number("000 §4.4", "longest width at Q = 100 and that dark current", "1", longest, "s",
               note=where, by="component"),
        number("000 §4.4", "dynamic range of 10 ns to 1 s", "160",
               spike_dynamic_range(longest, shortest), "dB", note="of the two widths above",
               by="component"),
        number("000 §4.4", "the same in powers of ten", "8",
               spike_dynamic_range(longest, shortest) / decibels(10), by="component"),
    ]  # fmt: skip


def _measured_range(longest: float, levels: int) -> float:
    """Dynamic range of an asynchronous pixel of Q = 100 in dB, found by changing its light: from
    the least that gives a reading of one level after the longest width to the most that fills the
    pixel no sooner than the shortest.

    Args:
        longest: seconds after which a pixel that is not full is read.
        levels: number of levels of that reading, N.
    """
    clock, shortest, end = Clock(PS), round(SHORTEST * PS), round(longest * PS)
    model = EventModel(THRESHOLD, 1, clock, shortest, end, levels, shot=False)
    plane = np.ones((1, 1), np.float32)

    def reads(electrons_per_second: float) -> bool:
        light = Light((Piece(0, end + 1, plane, plane),))
        found = AsynchronousPixels(model, (1, 1), electrons_per_second).step(light, 0, end + 1)
        return bool(found.level.any())

    def follows(electrons_per_second: float) -> bool:
        stop = 4 * shortest
        light = Light((Piece(0, stop, plane, plane),))
        found = AsynchronousPixels(model, (1, 1), electrons_per_second).step(light, 0, stop)
        return not len(found) or bool(found.exact[0] > shortest)

    nominal = THRESHOLD / longest / levels, THRESHOLD / SHORTEST
    least = turning_point(reads, nominal[0] / 3, nominal[0] * 3)
    most = turning_point(lambda light: not follows(light), nominal[1] / 3, nominal[1] * 3)
    return decibels(most / least)


def _threshold() -> list[PrintedRow]:
    """Section 4.5; its last example has an error."""
    hundred, wanted = _measured_range(0.01, 100), _measured_range(10.0, 1)
    second, tenth = (levels_for(wanted, longest, SHORTEST) for longest in (1.0, 0.1))
    with_ten, with_hundred = (_measured_range(0.1, levels) for levels in (10, 100))
    where = "least and most light that an asynchronous pixel tells apart"
    return [
        number("000 §4.5", "dynamic range of 10 ns to 10 ms with N = 100", "160", hundred, "dB",
               note=where, by="component"),
        number("000 §4.5", "the same in powers of ten", "8", hundred / decibels(10),
               by="component"),
        number("000 §4.5", "dynamic range of 10 ns to 10 s", "180", wanted, "dB", note=where,
               by="component"),
        number("000 abstract", "dynamic range that is reached", "180", wanted, "dB", note=where,
               by="component"),
        number("000 §4.5", "N for 180 dB at 1 s", "10", second, by="formula"),
        number("000 §4.5", "N for 180 dB at 0.1 s", "10", tenth,
               proof=round(tenth) == 100 and abs(with_ten - 160) < 1e-4
               and abs(with_hundred - wanted) < 1e-4,
               note="the document's error: with N = 10 a pixel has "
               f"{with_ten:.0f} dB; 180 dB takes N = {tenth:.0f}, which is used", by="formula"),
    ]  # fmt: skip


def _chance() -> list[PrintedRow]:
    """Widths of asynchronous pixels with shot noise."""
    return [
        number("000 §5.1", f"standard deviation of a width over the width, Q = {q}", printed,
               100 * _deviation(q, spikes), "%", note=f"of {spikes} simulated widths; the law is "
               f"{100 * interval_rsd(q):.3g} %", by="component")
        for q, printed, spikes in ((1, "100", 1_000_000), (100, "10", 40_000),
                                   (1000, "3.16", 2_000_000), (10_000, "1", 40_000))
    ]  # fmt: skip


def _deviation(q: int, spikes: int) -> float:
    """Standard deviation of simulated widths over their mean. Each of 64 pixels has its share."""
    clock, width, pixels = Clock(10**12 // 100), 1e-6, 64
    stop = round(spikes / pixels * width * PS)
    model = EventModel(q, 1, clock, PS // clock.num)
    plane = np.ones((1, pixels), np.float32)
    fired = AsynchronousPixels(model, (1, pixels), q / width).step(
        Light((Piece(0, stop, plane, plane),)), 0, stop
    )
    widths = fired.exact[fired.instant > 100 * width * PS]
    return float(widths.std() / widths.mean())


def chip_rows() -> list[PrintedRow]:
    """The rows of all numbers, in order."""
    return [*_rates(), *_chips(), *_figures()]


def _rates() -> list[PrintedRow]:
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


def _chips() -> list[PrintedRow]:
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


def _figures() -> list[PrintedRow]:
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
