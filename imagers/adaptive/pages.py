"""Report sections of the adaptive-exposure sensor: figures 4 to 6 of its document, from the run."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from cosim import PS
from cosim.config.amounts import number
from cosim.report.drawn import Data, save_figure
from cosim.report.figures import INK, MARK, subplots
from cosim.report.parts import plot, table
from imagers.adaptive.coupling import coupling_section
from imagers.adaptive.device.imager import AdaptiveExposure
from imagers.adaptive.device.timing import Timing
from imagers.adaptive.model import HALF, AdaptiveModel, changes
from imagers.adaptive.pixels import AdaptivePixels
from imagers.common.scenery import Still
from imagers.report.figures import (
    BLUE,
    GREEN,
    VIOLET,
    read_vcd,
    style_axes,
    waveforms,
)
from imagers.report.page import ImagerRun

SMALL = 16
"""Rows and columns of the sensor that films the response curve."""
SETTLING = 16
"""Frames that it has to find an exposure; the slowest search by roots takes fewer."""


def adaptive_sections(model: AdaptiveModel, run: ImagerRun) -> str:
    """Writes the figures and returns the HTML of the sections."""
    folder = run.folder / "figures"
    course = _course(run, folder / "exposure.png")
    response = _response(model, folder / "response.png")
    timing = _timing(run, model, folder / "timing.png")
    return (
        "<h2>Exposure and signal as the light changes</h2><p>This is figure 6a of its source. "
        "The light is that of the brightest pixel. The exposure is T 2<sup>n</sup> with T = 1 "
        "&micro;s. The signal is the largest unsaturated value of the window, which the exposure "
        f"selection keeps between {HALF} and 255. Square marks: more pixels are saturated than "
        "allowed.</p>"
        + plot(folder / "exposure.png", "light, exposure and signal over time", course)
        + _changes(run)
        + "<h2>Response</h2><p>This is figure 6b of its source. A sensor of this kind with "
        f"{SMALL} x {SMALL} pixels films constant light of each level until its exposure settles. "
        f"At each exposure the response is linear. With {HALF} DN added for every halving of the "
        "exposure, the values join to one curve that is close to the logarithm of the light.</p>"
        + plot(folder / "response.png", "signal and exposure over light", response)
        + "<h2>Two reset counters</h2><p>These are figures 4 and 5 of its source, from the trace "
        "of this sensor. Above: the rows that are reset and read around a change of exposure. "
        "Below: its signals during the first rows. Hold is the frame time minus the exposure.</p>"
        + plot(folder / "timing.png", "reset and readout of all rows, and the signals", timing)
        + coupling_section(run.imager, folder / "coupling.png")
    )


def _course(run: ImagerRun, path: Path) -> Data:
    taken, view = run.frames, run.planned.view
    figure, (top, middle, low) = subplots(
        3, 1, figsize=(9.5, 6.6), sharex=True, layout="constrained"
    )
    if isinstance(view.scenery, Still):
        peak, course = float(view.scenery.lux.max()), view.scenery.course
        times = np.linspace(0, run.planned.spec.stop, 1400)
        times = np.union1d(times, [t + d for t, _ in course.knots for d in (-1, 0)])
        times = times[(times >= 0) & (times <= run.planned.spec.stop)]
        top.plot(times / 1e9, [peak * course.at(int(t)) for t in times], color=MARK, linewidth=1.4)
    top.set_yscale("log")
    style_axes(top, y="light, lux")
    ready = np.array([t.ready for t in taken]) / 1e9
    multiple = np.array([t.state["multiplier"] for t in taken])
    middle.step(ready, multiple, where="post", color=BLUE, linewidth=1.3)
    middle.plot(
        ready, multiple, "o", markersize=2, color=BLUE, label="_nolegend_"
    )  # one frame makes no step
    middle.set_yscale("log", base=2)
    style_axes(middle, y="exposure, T = 1 µs")
    largest = np.array([t.state["largest"] for t in taken])
    flagged = np.array([t.state["flag"] for t in taken]) > 0
    signal = np.minimum(largest, 255)
    low.axhspan(HALF, 255, color=GREEN, alpha=0.08, linewidth=0)
    low.plot(ready, signal, color=GREEN, linewidth=0.8, label="_nolegend_")
    low.plot(ready[~flagged], signal[~flagged], "o", markersize=3, color=GREEN,
             label="not flagged")  # fmt: skip
    low.plot(ready[flagged], np.full(flagged.sum(), 255), "s", markersize=4, color=MARK,
             label="too many saturated")  # fmt: skip
    low.set_ylim(0, 265)
    style_axes(low, "end of readout, ms", "largest value, DN")
    return save_figure(figure, path)


def _changes(run: ImagerRun) -> str:
    rows = []
    steps = [c for c in changes(run.frames, run.planned.view) if c.ps < run.planned.spec.stop]
    for c in steps:
        step = "power-on" if c.before == 0 else f"x {number(c.after / c.before, 4)}"
        until = "the end of the run" if c is steps[-1] else "the next step"
        frames = f"not before {until}" if c.frames is None else f"N + {c.frames}"
        delay = "" if c.delay is None else f"{number(c.delay * 1e-9)} ms"
        rows.append([f"{number(c.ps * 1e-9, 4)} ms", step, frames, delay])
    if not rows:
        return ""
    return (
        "<p>Steps of the light, and the first frame with a settled exposure. Frame N was exposed "
        "when the light stepped. A new exposure is recorded in frame N + 3 at the latest. Each "
        "further decision takes two more frames: in a search after the light has risen into "
        "saturation, or after it has fallen so far that the largest value is noise and the first "
        "factor is too small.</p>"
        + table(["time", "light", "settled frame", "delay to its readout"], rows)
    )


def _response(model: AdaptiveModel, path: Path) -> Data:
    """Draws the settled value and exposure over seven decades of light."""
    section = model.section
    lux = np.geomspace(0.1, 1e6, 57)
    setting = model.setting
    points = []
    for level in lux:
        imager = AdaptiveExposure(
            AdaptivePixels((SMALL, SMALL), setting), Timing.of(SMALL, SMALL, section.frame_rate)
        )
        imager.write("adaptive_longest", section.longest)
        imager.write("adaptive_search", 2)
        scene = Still(np.full((SMALL, SMALL), level))
        kept = frozenset(imager.pixels.effects)
        frames = imager.film(scene, 100 * PS, seed=1, kept=kept)
        for frame in frames:
            if frame.number >= SETTLING:
                points.append((frame.state["multiplier"], float(frame.values.mean())))
                break
    multiple, value = np.array(points).T
    figure, (top, low, last) = subplots(3, 1, figsize=(9.5, 7), sharex=True, layout="constrained")
    top.plot(lux, value, "o-", color=GREEN, markersize=3.5, linewidth=0.9, label="signal, DN")
    combined = value / multiple
    top.set_xscale("log")
    top.set_ylim(0, 265)
    style_axes(top, y="mean value, DN")
    low.step(lux, multiple, where="mid", color=BLUE, linewidth=1.3, label="exposure, µs")
    low.plot(lux, combined, "o", color=VIOLET, markersize=3.5, label="value / exposure, DN/µs")
    low.plot(lux, lux * 256e-6 * section.gain, color=INK, linewidth=0.7, label="A S E / LSB")
    low.set_yscale("log")
    low.legend(fontsize=8, frameon=False)
    style_axes(low)
    together = value + HALF * (section.longest - np.log2(multiple))
    last.plot(lux, together, "o-", color=GREEN, markersize=3.5, linewidth=0.9)
    style_axes(last, "light on the sensor, lux", "joined values, DN")
    return save_figure(figure, path)


def _timing(run: ImagerRun, model: AdaptiveModel, path: Path) -> Data:
    taken = run.frames
    timing = model.timing
    steps = [
        n for n in range(1, len(taken))
        if taken[n].state["multiplier"] != taken[n - 1].state["multiplier"] and n > 1
    ]  # fmt: skip
    longest = max(range(len(taken)), key=lambda n: taken[n].seconds)
    at = min(steps, key=lambda n: abs(n - longest)) if steps else 1
    figure, (top, low) = subplots(
        2, 1, figsize=(9.5, 6.6), height_ratios=(1.1, 1), layout="constrained"
    )
    rows, line = timing.rows, timing.line / timing.clock.hz * 1e3
    for frame in taken[max(at - 2, 0) : at + 3]:
        begin, end, colour = (
            frame.begin / 1e9,
            frame.end / 1e9,
            (BLUE if frame.state["counter"] == 1 else VIOLET),
        )
        top.plot([begin, begin + rows * line], [0, rows], color=colour, linewidth=1.4)
        top.plot([end, end + rows * line], [0, rows], color=INK, linewidth=1.4)
        top.fill_betweenx(
            [0, rows], [begin, begin + rows * line], [end, end + rows * line], color=colour,
            alpha=0.15, linewidth=0,
        )  # fmt: skip
        top.annotate(
            f"frame {frame.number}: {number(frame.seconds * 1e3, 4)} "
            "ms", (end, 0), fontsize=8, color=INK,
            xytext=(2, 3), textcoords="offset points", rotation=90, ha="right", va="bottom",
        )  # fmt: skip
    top.plot([], [], color=BLUE, label="reset by counter 1")
    top.plot([], [], color=VIOLET, label="reset by counter 2")
    top.plot([], [], color=INK, label="sampled and read")
    top.legend(fontsize=8, frameon=False, loc="upper right")
    top.invert_yaxis()
    style_axes(top, "time, ms", "row")
    _signals(model, low)
    return save_figure(figure, path)


def _signals(model: AdaptiveModel, axes: Any) -> None:
    """Draws the signals of the first rows of a frame, from a trace of a separate sensor with an
    exposure of 40 us."""
    imager = AdaptiveExposure(AdaptivePixels((SMALL, SMALL)), Timing.of(SMALL, SMALL, 1000.0))
    imager.write("adaptive_automatic", 0)
    imager.write("adaptive_user", 40)
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.vcd"
        scene = Still(np.full((SMALL, SMALL), 1.0))
        frames = list(imager.film(scene, PS // 200, seed=1, kept=frozenset(), trace=trace))
        signals = read_vcd(trace)
    end = frames[1].end
    line = int(end[1] - end[0])
    names = ("Vout", "Hout", "Hrst1", "Hrst2", "sampling", "Pout", "select", "row")
    span = (int(end[0]) - line, int(end[0]) + 4 * line)
    waveforms(axes, signals, names, span, 1e6)
    axes.set_xlabel(
        f"time, µs; {SMALL} rows of {number(line * 1e-6)} µs, exposed for 40 µs",
        fontsize=9,
        color=INK,
    )
