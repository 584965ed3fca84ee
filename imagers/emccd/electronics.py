"""High-voltage drive, potentiometer and supplies: metrics, and sections of the report."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim import PS
from cosim.config.amounts import amount, number
from cosim.report.drawn import Data, Value, save_figure, write_figure
from cosim.report.figures import INK, LINE, MARK, subplots
from cosim.report.parts import plot
from cosim.run.result import Metric
from imagers.emccd.device.sine_drive import (
    SPI_SIGNALS,
    Potentiometer,
    SineDrive,
    word_clocks,
    word_edges,
)
from imagers.emccd.device.supplies import INTERLOCKS, RAILS, Course, Supplies
from imagers.emccd.pixels import HighVoltage
from imagers.emccd.pixels.multiplication import GAIN_RANGE, GAIN_STEPS
from imagers.report.figures import BLUE, GREEN, style_axes, waveforms

SETTLED = 0.01
"""Share of its end within which a gain counts as settled."""
_LAST = GAIN_STEPS - 1
_WORD = 218
"""Code of the word that is drawn: the gain of figure 4c of the document, 200."""


def ageing_codes(voltage: HighVoltage, step: int) -> int:
    """Codes that the gain at a step of an aged chip is higher than on the curve of a new one: what
    its gain calibration adds."""
    gain = min(voltage.gain(step), GAIN_RANGE[1])
    return step - replace(voltage, ageing=0.0).step_for(gain)


def drive_metrics(drive: SineDrive, peak: float, potentiometer: Potentiometer) -> dict[str, Metric]:
    """Metrics of the drive at the end of a run.

    Args:
        drive: drive of the camera.
        peak: mean of the last frame, V.
        potentiometer: potentiometer after the run.
    """
    voltage, step, last = drive.voltage, potentiometer.wiper, GAIN_STEPS - 1
    slope = voltage.slope(drive.at_transfer(peak))
    lost = 1 - voltage.gain_at(drive.at_transfer(peak)) / voltage.gain_at(peak)
    code = voltage.gain(min(step + 1, last)) / voltage.gain(min(step, last - 1)) - 1
    ripple, settled = drive.ripple(step), drive.settled(0, last, SETTLED)
    held = peak * drive.efficiency
    return {
        "high_voltage": Metric(peak, "V"),
        "high_voltage_error": Metric(drive.steady(step) - voltage.volts(step), "V"),
        "high_voltage_ripple": Metric(ripple, "V"),
        "detector_droop": Metric(held * (1 - drive.droop), "V"),
        "transfer_voltage": Metric(drive.transfer_mean(peak), "V"),
        "transfer_field": Metric(drive.field(peak), "V/um"),
        "gain_lost_by_phase": Metric(lost, "1"),
        "gain_slope": Metric(slope, "1/V"),
        "gain_ripple": Metric(math.expm1(slope * ripple), "1"),
        "gain_of_a_code": Metric(code, "1"),
        "loop_gain": Metric(drive.loop_gain(step), "1"),
        "high_voltage_settling": Metric(
            None if settled is None else settled * 1e6, "us", "the voltage does not settle"
        ),
        "potentiometer_code": Metric(step, "1"),
        "potentiometer_words": Metric(potentiometer.words, "1"),
        "potentiometer_word": Metric(word_clocks() / drive.hertz * 1e6, "us"),
        "ageing_codes": Metric(ageing_codes(voltage, step), "1"),
    }


def supply_metrics(course: Course, begin: int, switched: float | None) -> dict[str, Metric]:
    """Metrics of the power-up.

    Args:
        course: course of the supplies from their switch-on.
        begin: first exposure's beginning, ps.
        switched: instant of the switch-on in the run, s; None before the run.
    """
    good = course.good
    made = {
        "power_up": Metric(
            None if good is None else good * 1e3,
            "ms",
            "the supplies are not good within the power-up",
        )
    }
    if switched is not None:
        made["power_up_to_exposure"] = Metric((begin / PS - switched) * 1e3, "ms")
    return made


def electronics_sections(drive: SineDrive, supplies: Supplies, folder: Path) -> str:
    """Writes the figures and returns the HTML of the sections."""
    figure, grid = subplots(2, 2, figsize=(9.8, 6.4), layout="constrained")
    _pixel(grid[0, 0], drive)
    _loop(grid[0, 1], drive)
    _phase(grid[1, 0], drive)
    _word(grid[1, 1], drive)
    drawn = save_figure(figure, folder / "drive.png")
    rails = _supplies(supplies, folder / "supplies.png")
    up = drive.settled(0, _LAST, SETTLED)
    closed = drive.settling(drive.steady(0), _LAST, SETTLED / drive.voltage.slope(
        drive.steady(_LAST)))  # fmt: skip
    settled = (
        "does not settle"
        if up is None
        else f"settles within 1 % of the gain in {amount(up, 's', 4)}"
    )
    rules = "; ".join(f"{first} before {second}" for first, second in INTERLOCKS)
    return (
        "<h2>High-voltage drive</h2><p>Top left: the sine and the register clocks in a pixel; the "
        "charge drops in the band, and the gain follows the mean of the sine there. Top right: the "
        "peak after the potentiometer has moved from one end to the other, up (blue) and down "
        "(green); dotted: the slowest pole of the loop; level lines: 1 % of the gain; dashed: with "
        "a detector of ten times the droop time, which holds the old peak while the loop turns the "
        f"sine off. From 37 to 45 V it {settled} (closed form: {amount(closed, 's', 4)}). Bottom "
        "left: gain lost where the crest is early or late. Bottom right: the word of "
        f"step {_WORD} on the wires of the potentiometer.</p>"
        + plot(
            folder / "drive.png",
            "high-voltage drive: sine, settling of the loop, phase, word of the potentiometer",
            drawn,
        )
        + "<h2>Supplies</h2><p>The rails come up in the order of the scenario, each after the one "
        "before is good, and go down in reverse. The first cycle begins when all are good, after "
        f"{amount(supplies.switch_time, 's', 4)}. Interlocks: {rules}. The document prints that "
        "the order is controlled, and no order: all values are assumed.</p>"
        + plot(folder / "supplies.png", "rails over time", rails)
    )


def _pixel(axes: Any, drive: SineDrive) -> None:
    """Sine, R1 and R2 over two periods; R1 falls at 0."""
    period = 1e9 / drive.hertz
    time = np.linspace(-period, period, 801)
    s, peak = drive.settings, drive.steady(_LAST)
    angle = 2 * np.pi * time / period - np.radians(s.phase)
    axes.plot(time, s.trough + (peak - s.trough) * (1 + np.cos(angle)) / 2, color=BLUE)
    axes.axhline(drive.transfer_mean(peak), color=BLUE, linewidth=0.7, linestyle=":")
    high = np.asarray(time % period >= period / 2, float)
    for name, base, level in (("R1", -12, high), ("R2", -24, 1 - high)):
        axes.step(time, base + 8 * level, where="post", color=INK, linewidth=0.9,
                  label="_nolegend_")  # fmt: skip
        axes.text(-1.06 * period, base + 1, name, fontsize=8, color=INK, ha="right")
    half = s.transfer * 1e9 / 2
    for middle in (-period, 0.0, period):
        axes.axvspan(middle - half, middle + half, color=MARK, alpha=0.2, linewidth=0)
    axes.set_xlim(-1.25 * period, 1.06 * period)
    style_axes(axes, "ns after the fall of R1", "RΦ2HV, V")


def _loop(axes: Any, drive: SineDrive) -> None:
    """Distance of the peak from its end."""
    slow = replace(drive, settings=replace(drive.settings, droop=10 * drive.settings.droop))
    for of, start, step, colour, line, name in (
        (drive, 0, _LAST, BLUE, "-", "up"), (drive, _LAST, 0, GREEN, "-", "down"),
        (slow, _LAST, 0, GREEN, "--", "down, ten times the droop time"),
    ):  # fmt: skip
        count = int(drive.hertz * 15 * drive.settings.response)
        micros = np.arange(1, count + 1) / drive.hertz * 1e6
        begin, end = of.steady(start), of.steady(step)
        apart = np.abs(of.course(start, step, count)[:, 1] - end)
        axes.plot(micros, apart, color=colour, linewidth=1.2, linestyle=line, label=name)
        if of is drive:
            pole = float(abs(of.poles(step)).max())
            axes.plot(micros, abs(begin - end) * pole ** (micros * drive.hertz / 1e6), color=INK,
                      linewidth=0.9, linestyle=":")  # fmt: skip
            axes.axhline(SETTLED / of.voltage.slope(end), color=colour, linewidth=0.6)
    axes.plot([], [], color=INK, linewidth=0.9, linestyle=":", label="slowest pole")
    axes.plot([], [], color=INK, linewidth=0.6, label="1 % of the gain, of each colour")
    axes.legend(fontsize=7.5, frameon=False, loc="center right", bbox_to_anchor=(1.0, 0.48))
    axes.set_yscale("log")
    axes.set_ylim(1e-4, 50)
    style_axes(axes, "µs after the step", "peak from its end, V")


def _phase(axes: Any, drive: SineDrive) -> None:
    degrees = np.linspace(-10, 10, 81)
    for step, colour in ((_LAST, BLUE), (_WORD, GREEN), (_WORD // 2, INK)):
        gains = [
            replace(drive, settings=replace(drive.settings, phase=float(phase))).gain(step)
            for phase in degrees
        ]
        axes.plot(degrees, gains, color=colour, label=f"step {step}")
    axes.axvline(drive.settings.phase, color=MARK, linewidth=0.8)
    axes.set_yscale("log")
    axes.legend(fontsize=8, frameon=False, loc="center right", bbox_to_anchor=(1.0, 0.3))
    style_axes(axes, "phase of the crest, degrees", "gain")


def _word(axes: Any, drive: SineDrive) -> None:
    clock = PS // drive.hertz
    changes: dict[str, list[tuple[int, int]]] = {
        s.name: [(-100 * clock, s.before)] for s in SPI_SIGNALS
    }
    for edge, signal, value in word_edges(0, _WORD):
        changes[signal].append((edge * clock, value))
    last = max(edge for edge, _, _ in word_edges(0, _WORD))
    names = [s.name for s in SPI_SIGNALS]
    waveforms(axes, changes, names, (-10 * clock, (last + 10) * clock), 1e6)
    axes.set_xlabel("µs", fontsize=9, color=INK)


def _supplies(supplies: Supplies, path: Path) -> Data:
    good = supplies.run().good
    off = supplies.switch_time + 5e-3
    course = supplies.run(off=off)
    figure, axes = subplots(figsize=(9.5, 3.8), layout="constrained")
    millis = 1e3 * np.array(course.seconds)
    names = list(supplies.order)[::-1]
    rows: list[tuple[Value, ...]] = []
    for row, name in enumerate(names):
        level = row + 0.75 * np.array(course.volts[name]) / RAILS[name].volts
        axes.plot(millis, level, color=INK, linewidth=0.9)
        pairs = zip(millis, course.volts[name], strict=True)
        rows += [(name, float(at), float(volts)) for at, volts in pairs]
        axes.fill_between(millis, row, level, color=BLUE, alpha=0.18, linewidth=0)
    if good is not None:
        for instant in (good, off):
            axes.axvline(instant * 1e3, color=MARK, linewidth=0.8)
    labels = [f"{name}, {number(RAILS[name].volts)} V" for name in names]
    axes.set_yticks([n + 0.35 for n in range(len(names))], labels, fontsize=8)
    axes.grid(axis="x", color=LINE, linewidth=0.5)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.set_xlabel("ms after the switch; lines: all good, switch-off", fontsize=9, color=INK)
    write_figure(figure, path)
    return Data(("rail", "ms after the switch", "V"), rows)
