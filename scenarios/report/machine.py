"""The machine that a run simulated: its numbers and where they are from."""

from __future__ import annotations

from cosim.report.parts import table
from scenarios.report.latched_run import LatchedRun
from sensor import SILICON, CameraSetting
from sensor.sections.sensor import SensorSection

__all__ = ["faults", "machine", "optics"]


def optics(setting: CameraSetting) -> list[list[str]]:
    """A row for each number of the pixel's optics."""
    chip = setting.chip
    provenance = chip.provenance()
    return [
        ["pixel pitch", f"{chip.pitch:g} µm", provenance["pitch"]],
        ["fill factor", f"{chip.fill_factor:g}", provenance["fill_factor"]],
        ["quantum efficiency", f"{chip.quantum_efficiency:g}", provenance["quantum_efficiency"]],
        ["lux counted as photons at", f"{setting.wavelength_nm:g} nm", "scenario"],
    ]


def faults(section: SensorSection) -> list[list[str]]:
    """A row for each fault of the device: its size, and on what ground the preset assumes it."""

    def sizes(of: SensorSection) -> dict[str, object]:
        told = of.model_dump(mode="json")
        return told | (told["pattern"] or {})

    same = ("chip", "readout", "threshold", "threshold_level")
    given = sizes(section)
    silicon = {name: given[name] for name in same} | {"preset": "silicon"}
    preset = sizes(SensorSection.model_validate(silicon))
    rows = []
    for name, sized in SILICON.rows():
        value = given.get(name)
        if value is None or not float(str(value).split()[0]):
            continue
        of_preset = section.preset == "silicon" and value == preset[name]
        said = f"{sized.provenance}: {sized.source}" if of_preset else "scenario"
        rows.append([name.replace("_", " "), str(value), said])
    return rows


def machine(run: LatchedRun) -> str:
    """A table of the chip's numbers."""
    setting, scenario = run.setting, run.scenario
    chip = setting.chip
    provenance = chip.provenance()
    numbers = [
        ["pixels", f"{chip.width} x {chip.height}", provenance["width"]],
        ["latch clock", f"{setting.clock.hz / 1e3:g} kHz",
         provenance["clocks"] if setting.clock.hz in chip.clocks else "not one of this chip's"],
        ["charge threshold Q", f"{setting.threshold:g} e", "scenario"],
        ["reset rule", scenario.sensor.reset, "scenario"],
        *optics(setting),
        ["lens", f"f/{run.lens.f_number:.3g}, T {run.lens.transmission:g}, "
         f"m {run.lens.magnification:g}, PSF {run.lens.psf}",
         "scenario" if scenario.sensor.lens.f_number else "f-number chosen"],
        ["white on the sensor", f"{scenario.scene.illuminance * run.lens.gain:.3g} lux, "
         f"{run.white_rate:.3g} spikes a cycle", "computed"],
    ]  # fmt: skip
    if scenario.sensor.threshold_level < chip.threshold_levels:
        level = f"{scenario.sensor.threshold_level} of {chip.threshold_levels}"
        numbers.insert(3, ["threshold level", f"{level}, taken to be linear", "scenario"])
    numbers += faults(scenario.sensor)
    if scenario.sensor.pattern is not None and setting.pattern is not None:
        celsius = scenario.sensor.pattern.temperature
        dark = f"{setting.pattern.dark:.3g} e/s at {celsius:g} °C"
        numbers.append(["dark current at that temperature", dark, "computed"])
    return "<h2>The machine</h2>" + table(["what", "value", "from"], numbers)
