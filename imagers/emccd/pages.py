"""Report sections of the EMCCD: figures 1, 4 and 5 and table 2 of its document, from the run."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from cosim import PS
from cosim.config.amounts import count, number
from cosim.report.drawn import Data, save_figure, write_figure
from cosim.report.figures import INK, MARK, subplots
from cosim.report.parts import plot, table
from cosim.report.png import for_display
from imagers.common.model import FrameFigures
from imagers.common.scenery import Still
from imagers.emccd.device.cooling import run_cooling
from imagers.emccd.device.imager import Emccd
from imagers.emccd.device.timing import Settings, Timing, frame_rate, window_table
from imagers.emccd.electronics import electronics_sections
from imagers.emccd.model import STEP, EmccdModel, cooler_of
from imagers.emccd.pixels import EmccdPixels, excess_noise_squared
from imagers.report.figures import (
    BLUE,
    GREEN,
    read_vcd,
    stretch,
    style_axes,
    waveforms,
)
from imagers.report.page import ImagerRun
from sensor.frame_pixels import Exposed

GAINS = (2.0, 10.0, 100.0, 1000.0)
"""Gains of the photon transfer curves."""


def emccd_sections(model: EmccdModel, run: ImagerRun) -> str:
    """Writes the figures and returns the HTML of the sections."""
    folder = run.folder / "figures"
    modes = _modes(run, folder / "modes.png")
    course = _course(model, run, folder / "course.png")
    gain = _gain(model, folder / "gain.png")
    _sequence(folder / "sequence.png")
    cooling = _cooling(model, folder / "cooling.png")
    timing = Timing()
    rows = [
        [f"{size} x {timing.columns}", f"{number(rate, 4)} frames/s", f"{number(1e3 / rate, 4)} ms"]
        for size, rate in window_table(timing)
    ]
    return (
        "<h2>Modes</h2><p>These are figures 4 and 5 of its source: the first frame with each "
        "setting that the serial line has written. Each frame is stretched to its range, which the "
        "table gives. If the register overflows, charge spills into the columns that follow.</p>"
        + plot(folder / "modes.png", "the first frame with each setting")
        + table(
            ["frame", "exposure", "gain", "rows", "sync", "cycle rate", "range, DN"],
            modes,
        )
        + "<h2>Settings over time</h2><p>Vertical lines are register writes. All writes before the "
        "start of a cycle take effect at this start.</p>"
        + plot(folder / "course.png", "settings and signal over time", course)
        + "<h2>Window and frame rate</h2><p>Table 2 of its source is lost. This table follows "
        "from its sequence at an exposure of 2 ms: two frame transfers of "
        f"{timing.rows} rows, the exposure, a clear of the horizontal register, {timing.rows} - K "
        f"dumped rows, and a shift and {timing.line} pixel clocks for each of K rows.</p>"
        + table(["window", "frame rate", "frame time"], rows)
        + "<h2>One cycle</h2><p>Trace of the sequencer with a window of 8 rows and an exposure of "
        "100 &micro;s. The first transfer clears the image area, the second ends the exposure.</p>"
        + plot(folder / "sequence.png", "drive signals of one cycle")
        + "<h2>Gain and its noise</h2><p>Left: gain at the 256 steps of the high voltage. Right: "
        "photon transfer under uniform light at four gains. The slope of variance over squared "
        "gain against the mean in electrons is the squared excess noise factor. Lines: F&sup2; = "
        "1 + (1 - 1/g)(1 - p)/(1 + p).</p>"
        + plot(folder / "gain.png", "gain at every step, and photon transfer at four gains", gain)
        + electronics_sections(model.drive, model.supplies, folder)
        + "<h2>Cooling</h2><p>Temperature of the chip from power-on. A run begins ten minutes "
        "later.</p>"
        + plot(folder / "cooling.png", "temperature of chip and heat sink over time", cooling)
    )


def _settings(frame: FrameFigures) -> tuple[float, ...]:
    s = frame.state
    return s["exposure_steps"], s["gain_step"], s["first_row"], s["rows"], s["external"]


def _chosen(run: ImagerRun) -> list[int]:
    """Indices of the first frames after each change of the settings, at most 12."""
    taken = run.frames
    first = [0]
    for n in range(1, len(taken)):
        if _settings(taken[n]) != _settings(taken[n - 1]):
            first.append(n)
    return first[:12]


def _modes(run: ImagerRun, path: Path) -> list[list[str]]:
    places, taken = _chosen(run), run.frames
    wide = min(len(places), 4)
    lines = -(-len(places) // wide)
    figure, grid = subplots(
        lines, wide, squeeze=False, figsize=(9.8, 2.75 * lines), layout="constrained"
    )
    rows = []
    for axes in grid.ravel():
        axes.axis("off")
    for axes, n in zip(grid.ravel(), places, strict=False):
        frame, values = taken[n], run.frame(n)
        low, high = float(values.min()), float(values.max())
        state = frame.state
        whole = np.zeros((512, values.shape[1]))
        first = int(state["first_row"])
        whole[first : first + len(values)] = stretch(values, low, high)
        axes.imshow(for_display(whole), cmap="gray", vmin=0, vmax=255, interpolation="nearest")
        exposure = state["exposure_steps"] * STEP
        axes.set_title(
            f"frame {frame.number}: {number(exposure * 1e3)} ms, gain "
            f"{number(state['gain'])}", fontsize=8.5,
            color=INK,
        )  # fmt: skip
        rate = Timing().clock_hz / state["frame_clocks"]
        rows.append(
            [str(frame.number), f"{number(exposure * 1e3)} ms", number(state['gain'], 4),
             f"{first} to {first + int(state['rows']) - 1}",
             "external" if state["external"] else "internal", f"{number(rate, 4)}/s",
             f"{count(low)}, {count(high)}"]
        )  # fmt: skip
    write_figure(figure, path)
    return rows


def _course(model: EmccdModel, run: ImagerRun, path: Path) -> Data:
    taken = run.frames
    time = np.array([t.ready for t in taken]) / 1e9
    named = (
        ("exposure, ms", [t.state["exposure_steps"] * STEP * 1e3 for t in taken]),
        ("gain", [t.state["gain"] for t in taken]),
        ("rows", [t.state["rows"] for t in taken]),
        ("1 / cycle, Hz", [Timing().clock_hz / t.state["frame_clocks"] for t in taken]),
        ("mean, DN", [t.mean for t in taken]),
    )
    figure, places = subplots(len(named), 1, figsize=(9.5, 7.2), sharex=True, layout="constrained")
    for axes, (name, values) in zip(places, named, strict=True):
        axes.plot(time, values, "o-", color=BLUE, markersize=3, linewidth=0.9)
        for seconds in sorted({w[0] for w in model.section.writes}):
            axes.axvline(seconds * 1e3, color=MARK, linewidth=0.7)
        if name.split(",")[0] in ("gain", "mean"):
            axes.set_yscale("log")
        style_axes(axes, y=name)
    places[-1].set_xlabel("end of readout, ms", fontsize=9, color=INK)
    return save_figure(figure, path)


def _gain(model: EmccdModel, path: Path) -> Data:
    figure, (left, right) = subplots(1, 2, figsize=(9.5, 3.8), layout="constrained")
    voltage = model.voltage
    volts = [voltage.volts(step) for step in range(256)]
    left.plot(voltage.table(), color=BLUE, linewidth=1.3)
    left.set_yscale("log")
    style_axes(left, "step of the potentiometer", "gain")
    other = left.twinx()
    other.plot(volts, color=INK, linewidth=0.9, linestyle="--")
    other.set_ylabel("peak of the high-voltage clock, V (dashed)", fontsize=9, color=INK)
    other.tick_params(labelsize=8)
    other.spines[["top"]].set_visible(False)
    for gain, colour in zip(GAINS, (INK, BLUE, GREEN, MARK), strict=True):
        pixels = EmccdPixels(gain=gain)
        electrons = np.array([5.0, 10.0, 20.0, 40.0, 80.0])
        points = np.array([_transfer(pixels, mean) for mean in electrons])
        factor = excess_noise_squared(gain, pixels.stages)
        line = np.array([0.0, 90.0])
        right.plot(line, line * factor, color=colour, linewidth=0.8)
        label = f"gain {number(gain)}: F$^2$ = {factor:.3f}"
        right.plot(points[:, 0], points[:, 1], "o", color=colour, markersize=4, label=label)
    right.legend(fontsize=8, frameon=False)
    style_axes(right, "mean, electrons before multiplication", "variance / gain$^2$, e$^2$")
    return save_figure(figure, path)


def _transfer(pixels: EmccdPixels, electrons: float) -> tuple[float, float]:
    """Mean over gain (e) and variance over squared gain (e^2) of rows under uniform light, without
    read noise and dark signal."""
    rows, frames = 24, 2
    light = np.full((rows, pixels.shape[1]), electrons / pixels.responsivity)
    kept = frozenset(("shot noise", "multiplication noise"))
    electrons_out = []
    for n in range(frames):
        exposed = Exposed(light, np.full(rows, 1e-3), np.zeros(rows), 100, n)
        values = pixels.convert(exposed, 1, kept)[:, 12:-12].astype(float)
        electrons_out.append((values - pixels.offset) * pixels.step / pixels.gain)
    every = np.stack(electrons_out)
    rounding = (pixels.step / pixels.gain) ** 2 / 12
    return float(every.mean()), float(every.var()) - rounding


def _sequence(path: Path) -> None:
    """Draws the drive signals of one cycle, from a trace of a separate camera."""
    camera = Emccd()
    for register, value in (("exposure", 10), ("first_row", 250), ("rows", 8)):
        camera.write(register, value)
    cycle = 1 / frame_rate(camera.timing, Settings(10, 250, 8))
    with tempfile.TemporaryDirectory() as folder:
        trace = Path(folder) / "trace.vcd"
        scene = Still(np.zeros(camera.pixels.shape))
        stop = int(2.1 * cycle * PS)
        for _ in camera.film(scene, stop, seed=1, kept=frozenset(), trace=trace):
            pass
        signals = read_vcd(trace)
    figure, axes = subplots(figsize=(9.5, 3.8), layout="constrained")
    names = ("phase", "image_clock", "store_clock", "register_clock", "dump_gate", "frame_sync",
             "line_sync")  # fmt: skip
    waveforms(axes, signals, names, (0, int(1.02 * cycle * PS)))
    axes.set_xlabel(
        "time, ms; phase: 1 transfer, 2 exposure, 3 transfer, 4 clear, 5 dump, 6 read, 7 dump",
        fontsize=9, color=INK,
    )  # fmt: skip
    write_figure(figure, path)


def _cooling(model: EmccdModel, path: Path) -> Data:
    course = run_cooling(cooler_of(model.section), 600.0)
    figure, (top, low) = subplots(2, 1, figsize=(9.5, 3.8), sharex=True, layout="constrained")
    top.plot(course.seconds, course.chip - 273.15, color=BLUE, linewidth=1.2, label="chip")
    top.plot(course.seconds, course.sink - 273.15, color=MARK, linewidth=0.9, label="heat sink")
    top.axhline(model.section.temperature, color=INK, linewidth=0.7, linestyle=":")
    top.legend(fontsize=8, frameon=False)
    style_axes(top, y="temperature, °C")
    low.plot(course.seconds, course.amps, color=GREEN, linewidth=1.0)
    style_axes(low, "seconds after power-on", "Peltier current, A")
    return save_figure(figure, path)
