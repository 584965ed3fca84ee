"""Figures of the adaptive-exposure sensor: its document's figures 4 to 6, from this run."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from cosim import PS
from cosim.report.figures import INK, MARK, pyplot
from cosim.report.parts import plot, table
from rtl_model.imagers.adaptive.device.imager import AdaptiveExposure
from rtl_model.imagers.adaptive.device.timing import Timing
from rtl_model.imagers.adaptive.model import HALF, AdaptiveModel, changes
from rtl_model.imagers.report.figures import (
    BLUE,
    GREEN,
    VIOLET,
    read_vcd,
    save_figure,
    style_axes,
    waveforms,
)
from rtl_model.imagers.report.imager_run import ImagerRun
from sensor.imagers import Still
from sensor.imagers.cmos import AdaptivePixels

__all__ = ["adaptive_sections"]

SMALL = 16
"""Rows and columns of the sensor that the response curve is filmed with."""
SETTLING = 16
"""Frames it has to find an exposure: more than half a search takes."""


def adaptive_sections(model: AdaptiveModel, run: ImagerRun) -> str:
    """The sections of the page, their figures written."""
    folder = run.folder / "figures"
    _course(run, folder / "exposure.png")
    _response(model, folder / "response.png")
    _timing(run, model, folder / "timing.png")
    return (
        "<h2>Exposure and signal as the light changes</h2><p>The document's figure 6a. Light is "
        "that of the brightest pixel; the exposure is T 2<sup>n</sup>, T = 1 &micro;s; the signal "
        "is the largest unsaturated value of the window, which the exposure selection keeps "
        f"between {HALF} and 255. Filled marks: more pixels were saturated than are allowed.</p>"
        + plot(folder / "exposure.png", "light, exposure and signal over time")
        + _changes(run)
        + "<h2>Response</h2><p>The document's figure 6b, filmed: steady light of each level until "
        "the exposure stands, by a sensor of this kind of "
        f"{SMALL} x {SMALL} pixels. Between two exposures the response is linear. Put together, "
        f"with {HALF} DN for every halving of the exposure, the frames' values follow the "
        "logarithm of the light: light is close to an exponential of the output.</p>"
        + plot(folder / "response.png", "signal and exposure over light")
        + "<h2>Two reset counters</h2><p>The document's figures 4 and 5, from this sensor's own "
        "trace: above, the rows that are reset and read when the exposure changes; below, its "
        "signals over the first rows. Hold is the frame time less the exposure.</p>"
        + plot(folder / "timing.png", "reset and readout of all rows, and the signals")
    )


def _course(run: ImagerRun, path: Path) -> None:
    taken, view = run.frames, run.planned.view
    plt = pyplot()
    figure, (top, middle, low) = plt.subplots(
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
    middle.plot(ready, multiple, "o", markersize=2, color=BLUE)  # one frame makes no step
    middle.set_yscale("log", base=2)
    style_axes(middle, y="exposure, T = 1 µs")
    largest = np.array([t.state["largest"] for t in taken])
    flagged = np.array([t.state["flag"] for t in taken]) > 0
    seen = np.minimum(largest, 255)
    low.axhspan(HALF, 255, color=GREEN, alpha=0.08, linewidth=0)
    low.plot(ready, seen, color=GREEN, linewidth=0.8)
    low.plot(ready[~flagged], seen[~flagged], "o", markersize=3, color=GREEN)
    low.plot(ready[flagged], np.full(flagged.sum(), 255), "s", markersize=4, color=MARK)
    low.set_ylim(0, 265)
    style_axes(low, "time at which a frame has been read, ms", "largest value, DN")
    save_figure(figure, path)


def _changes(run: ImagerRun) -> str:
    rows = []
    jumps = [c for c in changes(run.frames, run.planned.view) if c.ps < run.planned.spec.stop]
    for c in jumps:
        told = "power-on" if c.before == 0 else f"x {c.after / c.before:.4g}"
        until = "the run's end" if c is jumps[-1] else "the next"
        frames = f"not before {until}" if c.frames is None else f"N + {c.frames}"
        delay = "" if c.delay is None else f"{c.delay * 1e-9:.3g} ms"
        rows.append([f"{c.ps * 1e-9:.4g} ms", told, frames, delay])
    if not rows:
        return ""
    return (
        "<p>Jumps of the light, and the first frame whose exposure is right for it, counted from "
        "frame N, which was exposing when it came. A new exposure is recorded in frame N + 3 at "
        "the latest; what one decision does not settle takes two more frames each: a search after "
        "light that rose into saturation, or light that fell so far that the largest value is the "
        "noise of some pixel, which is then lengthened by too little.</p>"
        + table(["at", "light", "right in frame", "and read after"], rows)
    )


def _response(model: AdaptiveModel, path: Path) -> None:
    """Largest value and exposure once settled, over seven decades of light."""
    section = model.section
    lux = np.geomspace(0.1, 1e6, 57)
    setting = model.setting
    found = []
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
                found.append((frame.state["multiplier"], float(frame.values.mean())))
                break
    multiple, value = np.array(found).T
    plt = pyplot()
    figure, (top, low, last) = plt.subplots(
        3, 1, figsize=(9.5, 7), sharex=True, layout="constrained"
    )
    top.plot(lux, value, "o-", color=GREEN, markersize=3.5, linewidth=0.9, label="signal, DN")
    combined = value / multiple
    top.set_xscale("log")
    top.set_ylim(0, 265)
    style_axes(top, y="mean value, DN")
    low.step(lux, multiple, where="mid", color=BLUE, linewidth=1.3, label="exposure, us")
    low.plot(lux, combined, "o", color=VIOLET, markersize=3.5, label="value / exposure, DN/us")
    low.plot(lux, lux * 256e-6 * section.gain, color=INK, linewidth=0.7, label="A S E / LSB")
    low.set_yscale("log")
    low.legend(fontsize=8, frameon=False)
    style_axes(low)
    together = value + HALF * (section.longest - np.log2(multiple))
    last.plot(lux, together, "o-", color=GREEN, markersize=3.5, linewidth=0.9)
    style_axes(last, "light on the sensor, lux", "frames put together, DN")
    save_figure(figure, path)


def _timing(run: ImagerRun, model: AdaptiveModel, path: Path) -> None:
    taken = run.frames
    timing = model.timing
    steps = [
        n for n in range(1, len(taken))
        if taken[n].state["multiplier"] != taken[n - 1].state["multiplier"] and n > 1
    ]  # fmt: skip
    longest = max(range(len(taken)), key=lambda n: taken[n].seconds)
    at = min(steps, key=lambda n: abs(n - longest)) if steps else 1
    plt = pyplot()
    figure, (top, low) = plt.subplots(
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
            f"frame {frame.number}: {frame.seconds * 1e3:.4g} ms", (end, 0), fontsize=8, color=INK,
            xytext=(2, 3), textcoords="offset points", rotation=90, ha="right", va="bottom",
        )  # fmt: skip
    top.plot([], [], color=BLUE, label="reset by counter 1")
    top.plot([], [], color=VIOLET, label="reset by counter 2")
    top.plot([], [], color=INK, label="sampled and read")
    top.legend(fontsize=8, frameon=False, loc="upper right")
    top.invert_yaxis()
    style_axes(top, "time, ms", "row")
    _signals(model, low)
    save_figure(figure, path)


def _signals(model: AdaptiveModel, axes: Any) -> None:
    """Signals of the first rows of a frame, from a trace of a sensor of its own, exposed for 40
    us."""
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
        f"time, us; {SMALL} rows of {line * 1e-6:.3g} us, exposed for 40 us", fontsize=9, color=INK
    )
