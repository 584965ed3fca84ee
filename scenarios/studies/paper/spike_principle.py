"""Document 000 (Huang), sections 3 to 5.1: the principle of spiking continuous photographing."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from cosim import PS, Clock, Events, Light, Piece
from cosim.run.printed import Row, listed, number, unprinted
from sensor import CHIPS, interval_rate
from sensor.asynchronous import AsynchronousPixels, EventModel
from sensor.codec import first_spikes, without_transitions
from sensor.dynamic_range import (
    decibels,
    filling_time,
    interval_rsd,
    level_step,
    levels_for,
    longest_width,
    photons_per_second,
    spike_dynamic_range,
    threshold_for,
)

__all__ = ["principle_rows"]

# Assumptions of section 4: lux, um2, quantum efficiency, e; s; e/s.
SUN, AREA, EFFICIENCY, THRESHOLD = 1e5, 100.0, 0.7, 100
SHORTEST = 1e-8
DARK = 100.0


def principle_rows() -> list[Row]:
    """The rows of all numbers, in order."""
    return [*_figure_1(), *_images(), *_light(), *_threshold(), *_chance()]


def _figure_1() -> list[Row]:
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


def _images() -> list[Row]:
    rate = interval_rate(np.array([1, 2, 3, 4, 256])).astype(float)
    step = float(rate[2] - rate[3])
    return [
        number("000 §3.3.2", "light at tau = 1 over that at tau = 256", "256", rate[0] / rate[4],
               by="formula"),
        number("000 §3.3.2", "light at tau = 1 over that at tau = 2", "2", rate[0] / rate[1],
               by="formula"),
        number("000 §3.3.2", "light at tau = 1 over that at tau = 3", "3",
               round(rate[0] / rate[2], 6), by="formula"),
        number("000 §3.3.2", "light between tau = 3 and 4 over 1/(tau (tau + 1))", "1",
               round(step / level_step(3), 6), note="1/ISI of the reconstruction: 1/12 of white",
               by="formula"),
    ]  # fmt: skip


def _light() -> list[Row]:
    """Sections 4.3 and 4.4."""
    photons = photons_per_second(SUN, AREA)
    electrons = photons * EFFICIENCY
    ns = filling_time(THRESHOLD, electrons) * 1e9
    least = threshold_for(electrons, SHORTEST)
    chip = CHIPS["spiketwo"]
    on_chip = SUN * chip.electrons_per_lux(photons / (SUN * AREA * 1e-12))
    return [
        number("000 §4.3", "photons a second on 100 um2 at 1e5 lux", "4.09e10", photons, "1/s",
               note="555 nm: 683 lm/W, 4.09e15 photons/(s m2 lx)", by="formula"),
        number("000 §4.3", "time in which 100 electrons gather", "0.35e-8", ns * 1e-9, "s",
               by="formula"),
        number("000 §4.3", "time in which 100 electrons gather", "3.5", ns, "ns", by="formula"),
        number("000 §4.3", "the same on the SpikeTwo preset's pixel", "3.5",
               filling_time(THRESHOLD, on_chip) * 1e9, "ns",
               note="10 um pitch, QE 0.7: its preset", by="formula"),
        unprinted("000 §4.3", "least Q for a readout of 10 ns at 1e5 lux", least, "e",
                  holds=abs(filling_time(least, electrons) / SHORTEST - 1) < 1e-9,
                  note="the charge that the light of section 4.3 generates in the 10 ns of "
                  "section 4.4", by="formula"),
        number("000 §4.4", "time in which a dark current of 100 e/s makes one electron", "10",
               longest_width(1, DARK) * 1e3, "ms", by="formula"),
        number("000 §4.4", "longest width at Q = 100 and that dark current", "1",
               longest_width(THRESHOLD, DARK), "s", by="formula"),
        number("000 §4.4", "dynamic range of 10 ns to 1 s", "160",
               spike_dynamic_range(longest_width(THRESHOLD, DARK), SHORTEST), "dB", by="formula"),
        number("000 §4.4", "the same in powers of ten", "8",
               spike_dynamic_range(1.0, SHORTEST) / decibels(10), by="formula"),
    ]  # fmt: skip


def _threshold() -> list[Row]:
    """Section 4.5; its last example has an error."""
    wanted = spike_dynamic_range(10.0, SHORTEST)
    second, tenth = (levels_for(wanted, longest, SHORTEST) for longest in (1.0, 0.1))
    with_ten = spike_dynamic_range(0.1, SHORTEST, 10)
    return [
        number("000 §4.5", "dynamic range of 10 ns to 10 ms with N = 100", "160",
               spike_dynamic_range(0.01, SHORTEST, 100), "dB", by="formula"),
        number("000 §4.5", "the same in powers of ten", "8",
               spike_dynamic_range(0.01, SHORTEST, 100) / decibels(10), by="formula"),
        number("000 §4.5", "light from 1e-4 to 1e5 lux in powers of ten", "9",
               decibels(SUN / 1e-4) / decibels(10), by="formula"),
        number("000 §4.5", "dynamic range of 10 ns to 10 s", "180", wanted, "dB", by="formula"),
        number("000 abstract", "dynamic range that is reached", "180", wanted, "dB", by="formula"),
        number("000 §4.5", "N for 180 dB at 1 s", "10", second, by="formula"),
        number("000 §4.5", "N for 180 dB at 0.1 s", "10", tenth,
               proof=round(tenth) == 100 and abs(with_ten - 160) < 1e-9
               and abs(spike_dynamic_range(0.1, SHORTEST, 100) - wanted) < 1e-9,
               note="the document's error: with N = 10 its own formula gives "
               f"{with_ten:.0f} dB; 180 dB takes N = {tenth:.0f}, which is used", by="formula"),
    ]  # fmt: skip


def _chance() -> list[Row]:
    rows = [
        number("000 §5.1", f"standard deviation of a width over the width, Q = {q}", printed,
               100 * interval_rsd(q), "%", by="formula")
        for q, printed in ((1, "100"), (100, "10"), (1000, "3.16"))
    ]  # fmt: skip
    last = number("000 §5.1", "the same from Q = 10 000 on", "1", 100 * interval_rsd(10_000), "%",
                  relation="<=", by="formula")  # fmt: skip
    return [*rows, last, _drawn()]


def _drawn(q: int = 100, spikes: int = 40_000) -> Row:
    """The same for simulated widths of a pixel with shot noise."""
    clock = Clock(10**12 // 100)
    width = 1e-6
    stop = round(spikes * width * PS)
    model = EventModel(q, 1, clock, PS // clock.num)
    plane = np.ones((1, 1), np.float32)
    pixels = AsynchronousPixels(model, (1, 1), q / width)
    widths = pixels.step(Light((Piece(0, stop, plane, plane),)), 0, stop).exact[1:]
    rsd = 100 * float(widths.std() / widths.mean())
    return number("000 §5.1", "the same of 40 000 simulated widths at Q = 100", "10", rsd, "%",
                  note="shot noise of the asynchronous pixel", by="component")  # fmt: skip
