"""A link's scenario as the figures that its capacity hangs on."""

from __future__ import annotations

from itertools import product

from link.layout import GROUP_BITS, GROUP_SYMBOLS, Layout
from link.mode import CELLS, LINE_CODES, PARITIES, TICKS, Mode
from link.theory import byte_error, rs_word_error
from scenarios.link_capacity import Given
from scenarios.link_run.light import cell_scene
from scenarios.link_run.reach import CellScene, predict_errors
from scenarios.linking import link_setting
from scenarios.schema import LinkScenario

__all__ = ["given_of"]

_LOST = 0.03
"""Frames that the default overhead makes good."""
_LEAST = 0.9
"""Camera pixels to a cell's side, at least."""


def _coded(mode: Mode) -> float:
    """Bits a tick."""
    layout = Layout(mode)
    line = GROUP_BITS[mode.line] / layout.group
    return layout.cells / mode.ticks * line * (255 - mode.parity) / 255


def _predicted(scenario: LinkScenario, scene: CellScene) -> Mode:
    """The fastest mode that closed forms allow, its named parts as they are; the most careful one
    where none is allowed."""
    modem, panel = scenario.link.modem, scenario.link.panel
    known = (CELLS, TICKS[:4], LINE_CODES, PARITIES)
    parts = (modem.cell, modem.ticks, modem.line, modem.parity)
    open_to = [of if part == "auto" else (part,) for part, of in zip(parts, known, strict=True)]
    modes = [Mode(panel.width, panel.height, *p) for p in product(*open_to)]  # type: ignore[arg-type]
    errors: dict[tuple[int, int, str], float] = {}
    for mode in sorted(modes, key=_coded, reverse=True):
        if mode.cell * scene.pixel < _LEAST:
            continue
        key = (mode.cell, mode.ticks, mode.line)
        if key not in errors:
            errors[key] = predict_errors(scene, mode)
        bits = round(8 * GROUP_SYMBOLS[mode.line] / GROUP_BITS[mode.line])
        wrong = byte_error(min(errors[key], 0.5), bits)
        if rs_word_error(255, 255 - mode.parity, wrong) < _LOST:
            return mode
    return min(modes, key=_coded)


def given_of(scenario: LinkScenario) -> tuple[Given, Mode, list[str]]:
    """The figures, the mode, and which parts of it are predicted. Raises InputError."""
    setting = link_setting(scenario)
    scene = cell_scene(setting)
    mode = _predicted(scenario, scene)
    modem, camera = scenario.link.modem, setting.camera
    names = ("cell", "ticks", "line", "parity")
    sensor = camera.chip.width * camera.chip.height
    seen = setting.optics.width * setting.optics.height * setting.scale**2
    whole = max(1, int(mode.cell * setting.scale))
    given = Given(
        (scene.on + scene.background) * scene.threshold, scene.background * scene.threshold,
        scene.threshold, camera.reset, camera.clock.hz, sensor,
        min(seen * (1 - setting.aim.occluded), sensor), whole * whole,
    )  # fmt: skip
    return given, mode, [name for name in names if getattr(modem, name) == "auto"]
