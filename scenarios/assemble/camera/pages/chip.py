"""The section of a report with the parameters of the simulated machine and their sources."""

from __future__ import annotations

from cosim.config.amounts import amount, number
from cosim.report.parts import table
from scenarios.assemble.camera.judged import LatchedRun
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
