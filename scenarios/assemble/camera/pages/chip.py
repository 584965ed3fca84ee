"""The section of a report with the parameters of the simulated machine and their sources."""

from __future__ import annotations

from cosim.report.parts import table
from scenarios.assemble.camera.judged import LatchedRun
from sensor.sections.provenance import fault_rows, optics_rows
from sensor.sections.writes import write_rows

__all__ = ["machine"]


def machine(run: LatchedRun) -> str:
    """HTML of the section: a table of the camera's parameters."""
    setting, scenario = run.setting, run.scenario
    chip = setting.chip
    provenance = chip.provenance()
    numbers = [
        ["pixels", f"{chip.width} x {chip.height}", chip.size_origin],
        ["latch clock", f"{setting.clock.hz / 1e3:g} kHz",
         provenance["clocks"] if setting.clock.hz in chip.clocks else "not one of this chip's"],
        ["charge threshold Q", f"{setting.threshold:g} e", "scenario"],
        ["reset rule", scenario.sensor.reset, "scenario"],
        *optics_rows(setting),
        ["lens", f"f/{run.lens.f_number:.3g}, T {run.lens.transmission:g}, "
         f"m {run.lens.magnification:g}, PSF {run.lens.psf}",
         "scenario" if scenario.sensor.lens.f_number else "f-number chosen"],
        ["white on the sensor", f"{scenario.scene.illuminance * run.lens.gain:.3g} lux, "
         f"{run.white_rate:.3g} spikes a cycle", "computed"],
    ]  # fmt: skip
    if scenario.sensor.threshold_level < chip.threshold_levels:
        level = f"{scenario.sensor.threshold_level} of {chip.threshold_levels}"
        numbers.insert(3, ["threshold level", f"{level}, assumed linear", "scenario"])
    numbers += fault_rows(scenario.sensor) + write_rows(scenario.sensor, setting.clock)
    if scenario.sensor.pattern is not None and setting.pattern is not None:
        celsius = scenario.sensor.pattern.temperature
        dark = f"{setting.pattern.dark:.3g} e/s at {celsius:g} °C"
        numbers.append(["dark current at that temperature", dark, "computed"])
    return "<h2>The machine</h2>" + table(["what", "value", "from"], numbers)
