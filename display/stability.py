"""Cases 22 to 27: a spike-continuous panel at extremes of time, light and motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import product
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import PS, Clock
from cosim.compute.opencl import Device
from cosim.run.case import Case
from cosim.spikes.viform import pack_planes
from display.observe.observers import CameraPlane, PursuingEye
from display.observe.views import Views
from display.panels.panel import SpikePanel
from display.render.golden import GoldenRenderer

Renderers = Callable[[SpikePanel, int, int], Any]
"""(panel, planes in a span, images) -> a renderer with the interface of `GoldenRenderer`."""
Values = npt.NDArray[np.float64]
CLOCK: Final = Clock(40_000)
DRIVES: Final = ("impulse", "hold", "causal")
"""Drives whose exact light `_levels` computes."""
MOST: Final = 2**32 - 1
"""The largest age, which does not increase."""


def _shipped(device: Device | None) -> Renderers:
    return GoldenRenderer


def _panel(width: int = 1, **more: Any) -> SpikePanel:
    return SpikePanel((1, width), CLOCK, 1.0, row_scan=0.0, **more)


def _sum_of(planes: int) -> Views:
    """Views of one image that is the sum of all light."""
    none = np.zeros((1, planes))
    return Views(none + 1, none, none, none, none, none)


def _spikes(at: Sequence[int], planes: int) -> npt.NDArray[np.uint32]:
    """Words of one pixel that spikes in these planes."""
    bits = np.zeros((planes, 1, 1), np.uint8)
    bits[list(at)] = 1
    return pack_planes(bits)


def _light(renderer: Any, words: npt.NDArray[np.uint32], planes: int) -> float:
    renderer.step(words, planes, _sum_of(planes))
    return float(renderer.take(0)[0, 0])


def _levels(at: Sequence[int], planes: int, drive: str, age: int | None = None) -> list[Fraction]:
    """Light of each plane, packets, in exact arithmetic. The limits and the share of the balance
    are those of `display/drives/drive.py`.

    Args:
        at: planes with a spike.
        planes: number of planes.
        drive: name of the drive.
        age: age at the start, None before the first spike.
    """
    tau, levels = 0, []
    balance = emitted = Fraction(0)
    for n in range(planes):
        if n in at:
            if age is not None:
                tau = min(age + 1, MOST)
                balance = min(max(balance + 1 - emitted, Fraction(-3)), Fraction(1))
            age, emitted = 0, Fraction(0)
        elif age is not None:
            age = min(age + 1, MOST)
        span = tau if drive == "hold" else max(tau, age or 0)
        level = min((1 + balance / 4) / span, Fraction(1)) if tau else Fraction(0)
        emitted += level
        levels.append(Fraction(int(n in at)) if drive == "impulse" else level)
    return levels


# 22 ------------------------------------------------------------------------------------------


def hours(make: Renderers, planes: int = 2048) -> float:
    """Relative error of the light that 64 planes add to sums over seven hours and over a month."""
    worst = 0.0
    for tau, before in product((3, 7, 1000), (10**9, 10**11)):
        at = range(0, planes, tau)
        renderer = make(_panel(drive="hold"), 1, 1)
        _light(renderer, _spikes(at, planes), planes)
        state = renderer.state()
        total = before // tau
        state["images"] = np.full_like(state["images"], total)
        renderer.restore(state)
        # The renderer continues with its current interval.
        added = _light(renderer, _spikes([], 64), 64) - float(state["images"][0, 0, 0])
        due = float(sum(_levels(at, planes + 64, "hold")[planes:]))
        worst = max(worst, abs(added - due) / due)
    return worst


# 23 ------------------------------------------------------------------------------------------


def ages(make: Renderers) -> float:
    """Largest error of a plane's light, packets: with a spike in each plane; with none from an age
    of 2^32 - 5 on, and then two; dark from the start."""
    worst = 0.0
    planes = 64
    for drive, age in product(DRIVES, (None, 0, MOST - 5)):
        for at in ([], [40, 45], list(range(planes)), [0, 1, 63]):
            renderer = make(_panel(drive=drive), 1, 1)
            if age is not None:
                state = renderer.state()
                state["age"] = np.full_like(state["age"], age)
                state["started"] = np.ones_like(state["started"])
                renderer.restore(state)
            renderer.step(_spikes(at, planes), planes, None)
            due = _levels(at, planes, drive, age)
            light = np.asarray(renderer.light, np.float64)[:, 0, 0]
            error = np.abs(light - np.array([float(d) for d in due]))
            worst = max(worst, float(np.max(np.where(np.isfinite(error), error, np.inf))))
    return worst


# 24, 25 --------------------------------------------------------------------------------------

EMITTERS: Final = ((1.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.2, 3e-6, 3e-6), (1.0, 1e-4, 1e-4))
"""(pulse, rise, decay): with equal rise and decay, the total light is that of the drive."""


def one_spike(make: Renderers, planes: int = 800) -> float:
    """Error of the total light of one spike, packets: one packet with the impulse drive, none with
    the others."""
    worst = 0.0
    for drive, (pulse, rise, decay), at in product(DRIVES, EMITTERS, (0, 100, planes // 2)):
        renderer = make(_panel(drive=drive, pulse=pulse, rise=rise, decay=decay), 1, 1)
        light = _light(renderer, _spikes([at], planes), planes)
        worst = max(worst, abs(light - (drive == "impulse")))
    return worst


def every_spike(make: Renderers, planes: int = 1024) -> float:
    """Relative error of the total light with a spike in every plane: a packet in each plane, from
    the second on for hold and causal, less the light that the emitter has not emitted yet."""
    worst = 0.0
    for drive, (pulse, rise, decay) in product(DRIVES, EMITTERS):
        renderer = make(_panel(drive=drive, pulse=pulse, rise=rise, decay=decay), 8, 1)
        words = _spikes(range(planes), planes)
        light = 0.0
        for first in range(0, planes, 128):
            renderer.step(words[first // 32 : (first + 128) // 32], 128, _spans(128, 8))
            light += float(renderer.take(0)[0, 0])
        left = rise * CLOCK.hz * float(renderer.state()["level"][0, 0])
        due = planes - (drive != "impulse")
        worst = max(worst, abs((light + left) / due - 1))
    return worst


def _spans(planes: int, batch: int) -> Views:
    return _sum_of(planes // batch)


# 26 ------------------------------------------------------------------------------------------


def stiff_emitter(make: Renderers, planes: int = 64) -> float:
    """Largest error of a plane's light, packets, for time constants from 1e-9 to 1e9 planes."""
    worst = 0.0
    at = [3, 4, 9, 10, 11, 40]
    for rise, decay in product((1e-9, 1e-3, 1.0, 1e3, 1e9), repeat=2):
        panel = _panel(drive="impulse", pulse=0.25, rise=rise / CLOCK.hz, decay=decay / CLOCK.hz)
        renderer = make(panel, 1, 1)
        renderer.step(_spikes(at, planes), planes, None)
        light = np.asarray(renderer.light, np.float64)[:, 0, 0]
        due = _relaxed(at, planes, panel.pulse, panel.rise, panel.decay)
        error = np.abs(light - due)
        worst = max(worst, float(np.max(np.where(np.isfinite(error), error, np.inf))))
    return worst


def _relaxed(at: Sequence[int], planes: int, pulse: float, rise: float, decay: float) -> Values:
    """The light of each plane in fifty digits: y' = (x - y) / c, integrated over each part of a
    plane."""
    with localcontext() as context:
        context.prec = 50
        y, out, lit = Decimal(0), [], Decimal(pulse)
        for n in range(planes):
            light = Decimal(0)
            for x, part in ((1 / lit if n in at else Decimal(0), lit), (Decimal(0), 1 - lit)):
                c = Decimal(rise if x > y else decay) * CLOCK.num / CLOCK.den
                end = x + (y - x) * (-part / c).exp()
                light += x * part + (y - end) * c
                y = end
            out.append(float(light))
    return np.array(out)


# 27 ------------------------------------------------------------------------------------------


def fast_pursuit(make: Renderers, width: int = 24, planes: int = 64) -> float:
    """Error of the image of a white panel, white = 1, for an eye that moves at 1e3 to 1e15
    pixels/s. The surroundings of the panel are dark."""
    worst = 0.0
    words = np.full((planes // 32, 1, width), 2**32 - 1, np.uint32)
    instant = CLOCK.edge(planes // 2) + 12_345
    for speed, sign in product((1e3, 1e6, 1e9, 1e15), (1, -1)):
        eye = PursuingEye(CameraPlane((instant,), PS // 1000), (0.0, sign * speed))
        panel = _panel(width, drive="impulse")
        renderer = make(panel, 1, 1)
        edges = np.array([panel.start(n) for n in range(planes + 1)])
        middle = (edges[:-1] + edges[1:]) // 2
        weight, none = eye.weights(edges[:-1], edges[1:]), np.zeros((1, planes))
        dx = eye.shifts(middle)[1]
        renderer.step(words, planes, Views(weight, none, none, dx, none, none))
        image = np.asarray(renderer.take(0), np.float64)[0]
        for x in range(width):
            due = Fraction(0)
            for w, m in zip(weight[0].tolist(), middle.tolist(), strict=True):
                place = x + Fraction(sign * speed) * (m - instant) / PS
                # Bilinear: white from -1 to the width of the panel, with edges one pixel wide.
                lit = max(min(place + 1, width - place, Fraction(1)), Fraction(0))
                due += Fraction(w) * lit
            error = abs(float(image[x]) - float(due))
            worst = max(worst, error if np.isfinite(error) else np.inf)
    return worst


SHOWING: Final = (
    Case(
        22, "holds summed for hours",
        "64 planes of about 1/3, 1/7 and 1/1000 packet add up right to sums of 1e9 and 1e11 planes",
        "fractions", "float32 running sum", "relative", 1e-4, hours, _shipped,
    ),
    Case(
        23, "ages of zero and without end",
        "light of each plane, with a spike in each, at ages about 2^32, without an interval",
        "Python integers", "32-bit age that wraps; 1 / tau without a tau", "packets", 1e-15, ages,
        _shipped,
    ),
    Case(
        24, "one spike ever",
        "impulse gives its packet, whatever the emitter; hold and causal without an interval none",
        "1 and 0", "the run's start taken for a spike", "packets", 1e-12, one_spike, _shipped,
        {"planes": 320},
    ),
    Case(
        25, "a spike in every cycle",
        "a packet a plane in every drive, whatever the emitter",
        "counts", "interval counted in dark planes", "relative", 1e-12, every_spike, _shipped,
        {"planes": 256},
    ),
    Case(
        26, "emitters of 1e-9 to 1e9 planes",
        "light of each plane, time constants from 1e-9 planes to 1e9, any two",
        "50 digits", "explicit Euler", "packets", 1e-12, stiff_emitter, _shipped,
    ),
    Case(
        27, "pursuit out of the panel",
        "a white panel seen at 1e3 to 1e15 pixels/s is white where the eye is on it, else dark",
        "fractions", "positions held at the panel's edge; positions that go round",
        "white", 1e-9, fast_pursuit, _shipped,
    ),
)  # fmt: skip
