"""Input of the capacity of a link, from its scenario."""

from __future__ import annotations

from typing import Any, Final

from link.mode import CELLS, Mode
from link.prediction.capacity import CapacityInput
from link.prediction.error_bound import LEAST_CELL, CellScene
from link.prediction.light import cell_scene
from link.section import LinkScenario
from link.setting import LinkSetting, link_setting
from sensor import CameraSetting

DEFAULT_MODE: Final[dict[str, Any]] = {"cell": 2, "ticks": 1, "line": "scrambled", "parity": 32}
"""Parts of a mode that are assumed if the scenario leaves them to the pilots of a run; larger cells
where these are smaller than LEAST_CELL in the image."""


def scenario_input(
    scenario: LinkScenario, camera: CameraSetting
) -> tuple[CapacityInput, Mode, list[str]]:
    """Input of a scenario, its mode, and the names of the assumed parts of the mode.

    Raises:
        InputError: if the scenario cannot be simulated.
    """
    setting = link_setting(scenario, camera)
    modem, panel = scenario.link.modem, scenario.link.panel
    soft = modem.rate != "auto"
    assumed = [
        name for name in DEFAULT_MODE
        if getattr(modem, name) == "auto" and not (soft and name == "parity")
    ]  # fmt: skip
    parts = {
        name: default if name in assumed else getattr(modem, name)
        for name, default in DEFAULT_MODE.items()
    }
    if "cell" in assumed:  # as a run: none smaller than the camera resolves
        parts["cell"] = next(
            (c for c in CELLS if c >= parts["cell"] and c * setting.scale >= LEAST_CELL), CELLS[-1]
        )
    if soft:
        parts |= {"parity": None, "rate": modem.rate}
    mode = Mode(panel.width, panel.height, **parts)
    return capacity_input(setting, cell_scene(setting), mode), mode, assumed


def capacity_input(setting: LinkSetting, scene: CellScene, mode: Mode) -> CapacityInput:
    """Input of a link that is set up.

    Args:
        setting: the link.
        scene: light of its cells.
        mode: mode of the transmission.
    """
    camera, panel = setting.camera, setting.optics
    sensor = camera.chip.width * camera.chip.height
    on_panel = panel.width * panel.height * setting.scale**2 * (1 - setting.aim.occluded)
    whole = max(1, int(mode.cell * setting.scale))
    return CapacityInput(
        (scene.on + scene.background) * scene.threshold, scene.background * scene.threshold,
        scene.threshold, camera.reset, camera.clock.hz, sensor, min(on_panel, sensor),
        whole * whole,
    )  # fmt: skip
