"""The numbers of a camera from its [sensor] section: the parameters of its effects, and the rows of
a report's table of the machine, which say where each number is from.
"""

from __future__ import annotations

from typing import Any

from cosim.config.amounts import number
from cosim.errors import InputError
from sensor.device.chips import GIVEN
from sensor.latched.effects.catalogue import CATALOGUE, all_keys
from sensor.latched.effects.effect import Operation
from sensor.latched.setting import CameraSetting
from sensor.sections.preset_file import BUILT_IN
from sensor.sections.sensor import SensorSection


def optics_rows(setting: CameraSetting) -> list[list[str]]:
    """A row for each number of the pixel's optics."""
    chip = setting.chip
    provenance = chip.provenance()
    return [
        ["pixel pitch", f"{number(chip.pitch)} µm", provenance["pitch"]],
        ["fill factor", number(chip.fill_factor), provenance["fill_factor"]],
        ["quantum efficiency", number(chip.quantum_efficiency), provenance["quantum_efficiency"]],
        ["lux counted as photons at", f"{number(setting.wavelength_nm)} nm", "scenario"],
    ]


def fault_rows(section: SensorSection) -> list[list[str]]:
    """A row for each imperfection of the device: its size, and what the preset assumes it from."""

    def sizes(of: SensorSection) -> dict[str, object]:
        values = of.model_dump(mode="json")
        return values | (values["pattern"] or {})

    same = ("chip", "pixel", "threshold", "threshold_level")
    asked = sizes(section)
    silicon = {name: asked[name] for name in same} | {"preset": "silicon"}
    preset = sizes(SensorSection.model_validate(silicon))
    own = "scenario" if section.preset in BUILT_IN else f"scenario or {section.preset}"
    rows = []
    if section.row_time is not None:
        size = f"{number(section.row_time * 1e9)} ns, all rows in {number(section.skew)} of a cycle"
        rows.append(["row time", size, GIVEN])
    for name, key in all_keys():
        value = asked.get(name)
        if not key.reported or value is None or not float(str(value).split()[0]):
            continue
        assumed = key.silicon
        of_preset = assumed and section.preset == "silicon" and value == preset[name]
        origin = f"{assumed.provenance}: {assumed.source}" if assumed and of_preset else own
        rows.append([name.replace("_", " "), str(value), origin])
    return rows


def effect_parameters(section: SensorSection, operation: Operation) -> dict[str, Any]:
    """Parameters of every effect, by name. Raises InputError for what cannot be simulated."""
    parameters: dict[str, Any] = {}
    for effect in CATALOGUE:
        for place, keys, given in (
            ("sensor", effect.keys, section),
            ("sensor.pattern", effect.pattern_keys if section.pattern else {}, section.pattern),
        ):
            for name, key in keys.items():
                value, default = getattr(given, name), key.field.get_default()
                if section.pixel not in key.pixels and value != default:
                    raise InputError(
                        f"{place}.{name}", f"absent with pixel = {section.pixel}", f"{value:g}",
                        "leave it out: these pixels have no such effect",
                    )  # fmt: skip
        parameters |= effect.configure(section, operation)
    return parameters
