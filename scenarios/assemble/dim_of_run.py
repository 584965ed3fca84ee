"""How the images of a run that is on disk have dim pixels."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

from cosim.config.toml import read_toml
from sensor.reconstruct.readings import READINGS, DimLight, read_readings

_SCENARIO: Final = "scenario.toml"


def dim_of_run(folder: Path) -> DimLight | None:
    """The readings and the dark limit of the run in a folder; None without either, and for what is
    no folder of a run. Raises InputError for files that the run did not write so."""
    readings = read_readings(folder / READINGS) if (folder / READINGS).exists() else None
    dark = _dark_cycles(folder / _SCENARIO)
    if readings is None and math.isinf(dark):
        return None
    return DimLight(readings, dark)


def _dark_cycles(path: Path) -> float:
    """Width in cycles from which on the run rejects an interval; infinite for none."""
    try:
        data = read_toml(path)
    except (OSError, ValueError):  # a stream may lie in any folder
        return math.inf
    if "dark_limit" not in data.get("sensor", {}):
        return math.inf
    from scenarios.assemble.camera.dim_limits import dark_cycles
    from scenarios.assemble.chip import camera_setting
    from scenarios.assemble.schema.loading import filmed, load

    scenario = filmed(load(str(path))[1], "image")
    return dark_cycles(scenario.sensor, camera_setting(scenario))
