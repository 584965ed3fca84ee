"""A link's scenario as the figures that its capacity hangs on."""

from __future__ import annotations

from typing import Any, Final

from link.prediction.capacity import Given
from link.prediction.light import cell_scene
from link.prediction.reach import CellScene
from link.mode import Mode
from link.section import LinkScenario
from link.setting import LinkSetting, link_setting

__all__ = ["PLAIN", "given_by", "given_of"]

PLAIN: Final[dict[str, Any]] = {"cell": 2, "ticks": 2, "line": "8b10b", "parity": 32}
"""Parts of a mode that are looked at where the scenario leaves them to a run's pilot."""


def given_of(scenario: LinkScenario) -> tuple[Given, Mode, list[str]]:
    """The figures, the mode, and which parts of it are `PLAIN`. Raises InputError."""
    setting = link_setting(scenario)
    modem, panel = scenario.link.modem, scenario.link.panel
    open_parts = [name for name in PLAIN if getattr(modem, name) == "auto"]
    parts = {name: PLAIN[name] if name in open_parts else getattr(modem, name) for name in PLAIN}
    mode = Mode(panel.width, panel.height, **parts)
    return given_by(setting, cell_scene(setting), mode), mode, open_parts


def given_by(setting: LinkSetting, scene: CellScene, mode: Mode) -> Given:
    """The same of a link that is set up. scene: of its light."""
    camera, panel = setting.camera, setting.optics
    sensor = camera.chip.width * camera.chip.height
    seen = panel.width * panel.height * setting.scale**2 * (1 - setting.aim.occluded)
    whole = max(1, int(mode.cell * setting.scale))
    return Given(
        (scene.on + scene.background) * scene.threshold, scene.background * scene.threshold,
        scene.threshold, camera.reset, camera.clock.hz, sensor, min(seen, sensor), whole * whole,
    )  # fmt: skip
