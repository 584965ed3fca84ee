"""The parts of a page that every latched camera has: what was simulated, the parameters of the
machine with their sources, and the motion between the frames of a clip."""

from __future__ import annotations

import numpy as np

from cosim.config.amounts import amount, count, number, percent
from cosim.light.source import Source
from cosim.report.parts import figure, table
from cosim.report.pictures import busiest_box, crop
from cosim.report.png import for_display, to_linear_bytes
from cosim.run.machine import Page
from scenarios.assemble.source.latched.judged import LatchedRun
from scenarios.assemble.source.latched.pages.plan import board_error, plan_section
from scenarios.scenes.clips.motion_film import MotionFilm
from sensor.sections.own_chip import write_rows
from sensor.sections.provenance import fault_rows, optics_rows


def machine(run: LatchedRun) -> str:
    """HTML of the section: a table of the camera's parameters."""
    setting, scenario = run.setting, run.scenario
    chip = setting.chip
    provenance = chip.provenance()
    numbers = [
        ["pixels", f"{chip.width} x {chip.height}", chip.size_origin],
        ["latch clock", f"{number(setting.clock.hz / 1e3)} kHz",
         provenance["clocks"] if setting.clock.hz in chip.clocks else "not one of this chip's"],
        ["charge threshold Q", f"{number(setting.threshold)} e", "scenario"],
        ["reset rule", scenario.sensor.reset, "scenario"],
        *optics_rows(setting),
        ["lens", f"f/{number(run.lens.f_number)}, T {number(run.lens.transmission)}, "
         f"m {number(run.lens.magnification)}, PSF {run.lens.psf}",
         "scenario" if scenario.sensor.lens.f_number else "f-number chosen"],
        ["white on the sensor", f"{amount(scenario.scene.illuminance * run.lens.gain, 'lux')}, "
         f"{number(run.white_rate)} spikes a cycle", "computed"],
    ]  # fmt: skip
    if scenario.sensor.threshold_level < chip.threshold_levels:
        level = f"{scenario.sensor.threshold_level} of {chip.threshold_levels}"
        numbers.insert(3, ["threshold level", f"{level}, assumed linear", "scenario"])
    numbers += fault_rows(scenario.sensor) + write_rows(scenario.sensor, setting.clock)
    if scenario.sensor.pattern is not None and setting.pattern is not None:
        celsius = scenario.sensor.pattern.temperature
        dark = f"{amount(setting.pattern.dark, 'e/s')} at {number(celsius)} °C"
        numbers.append(["dark current at that temperature", dark, "computed"])
    return "<h2>The machine</h2>" + table(["what", "value", "from"], numbers)


def motion_section(source: Source) -> str:
    """HTML of the section: both kinds of interpolation between the two frames for which they differ
    most, where they differ most. "" for any other scene, and for a clip without motion."""
    example = source.example() if isinstance(source, MotionFilm) else None
    if not isinstance(source, MotionFilm) or example is None:
        return ""
    difference = np.abs(example.motion - example.linear)
    box = busiest_box(difference, max(64, min(source.shape) // 2))
    top = max(float(difference.max()), 1e-6)
    linear, motion = (crop(for_display(plane), box) for plane in (example.linear, example.motion))
    share, rms = (source.metrics[f"motion_{name}"].value for name in ("linear", "difference"))
    pictures = (
        figure(linear, "linear interpolation", exact=True)
        + figure(motion, "motion", exact=True)
        + figure(
            crop(to_linear_bytes(difference / np.float32(top)), box),
            f"their difference, 0 to {number(top, 2)} mapped to black to white",
            exact=True,
        )
    )
    return (
        "<h2>Motion between frames</h2><p>The light midway between the two frames of the clip for "
        f"which motion matters most, {number(example.seconds * 1e3, 4)} ms into the run, in the "
        f"square in which it matters most. In this run the flows forward and backward disagree for "
        f"{percent(share)} of the pixels, which are interpolated linearly; midway between frames "
        f"the light differs from linear interpolation by {number(rms, 2)} RMS, white = 1.</p>"
        f'<div class="grid by3">{pictures}</div>'
    )


def simulated(run: LatchedRun) -> str:
    """What was simulated, for a newcomer."""
    height, width = run.stream.shape
    clock, chip = run.stream.clock, run.setting.chip
    length = amount(run.result.simulated_s, "s", 4)
    if run.scenario.sensor.source is not None:
        return (
            f"A test board gave the spikes of {width} x {height} pixels for {length}: "
            f"{count(run.stream.cycles)} cycles at {amount(clock.hz / 1e3, 'kHz')}. The images "
            "below are computed from them."
        )
    return (
        f"A spike camera with {width} x {height} pixels, the {chip.title}, watches the scene "
        f"“{run.scenario.title}” for {length}. In each of {count(run.stream.cycles)} cycles, "
        f"{count(clock.hz)} a second, every pixel gives one bit: whether it has collected "
        f"{number(run.setting.threshold)} more electrons of light. Images are computed from these "
        "bits, the spikes."
    )


def subtitle(run: LatchedRun) -> str:
    """The camera in one line."""
    what = "a test board" if run.scenario.sensor.source else run.setting.chip.title
    return f"{what}, {number(run.setting.clock.hz / 1e3)} kHz, {count(run.stream.cycles)} cycles"


def unmeasured(run: LatchedRun) -> str:
    """Why the error of the run is not known, where it is not."""
    return board_error(run.result.metrics) if run.scenario.sensor.source else Page.unmeasured


def plan_files(run: LatchedRun) -> list[str]:
    """Files of the section on the plan; a board has none."""
    return [] if run.scenario.sensor.source else ["figures/plan.png"]


def plan_page(run: LatchedRun) -> Page:
    """The page of a camera whose images the observers of a display have: its plan and the machine;
    writes its figure."""
    return Page(
        run.scenario.title, subtitle(run), simulated(run), [],
        [motion_section(run.source), plan_section(run), machine(run)],
        unmeasured=unmeasured(run), files=plan_files(run),
    )  # fmt: skip
