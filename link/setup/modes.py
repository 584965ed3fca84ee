"""The mode of a run: given by the scenario, or the best of those that it leaves open."""

from __future__ import annotations

from dataclasses import replace

from cosim.compute.opencl import Device
from cosim.run.progress import Progress
from link.layout import Layout
from link.mode import CELLS, LINE_CODES, PARITIES, TICKS, Mode
from link.prediction.light import cell_scene
from link.prediction.reach import LEAST_CELL
from link.receiving.tags import LEAST_MODULE
from link.section import LinkScenario, ModemSection
from link.setting import LinkSetting
from link.setup.choosing import Choice, Trial, choose
from link.setup.pilot import film_pilot, strip_of
from link.setup.truth import panel_in_view

__all__ = ["choose_mode", "tag_warning"]

_PILOTS = 8
"""Largest number of pilots."""
_NEVER = 0.8
"""Share of the required size of a tag's module below which tags were never detected."""


def _tag_share(setting: LinkSetting, mode: Mode) -> float:
    """Returns the size of a tag's module over the size required for detection in a sharp image."""
    return setting.scale * Layout(mode).module / LEAST_MODULE


def tag_warning(setting: LinkSetting, mode: Mode) -> str | None:
    """Returns a warning if the tags are too small to be detected, else None."""
    if _tag_share(setting, mode) >= 1:
        return None
    module = setting.scale * Layout(mode).module
    return (
        f"tags too small: a module of theirs has {module:.2g} camera pixels and is found from "
        f"{LEAST_MODULE:g} on; step nearer, or take a longer lens or a larger panel"
    )


def _fixed_mode(scenario: LinkScenario) -> Mode | None:
    """Returns the mode of the scenario; None if a part of it is to be chosen."""
    modem, panel = scenario.link.modem, scenario.link.panel
    parts = modem.cell, modem.ticks, modem.line, modem.parity
    return None if "auto" in parts else Mode(panel.width, panel.height, *parts)


def _candidates(modem: ModemSection, size: tuple[int, int], setting: LinkSetting) -> list[Mode]:
    """Returns the modes that the scenario leaves open, with cells somewhat larger than a camera
    pixel.

    Two choices are only made on request: symbols of one tick, which is shared with a neighbour
    unless the phase is 0, and the line code `none`, which does not limit runs.
    """
    cells = [c for c in CELLS if c * setting.scale >= LEAST_CELL] or [CELLS[-1]]
    return [
        Mode(*size, cell, ticks, line, parity)
        for cell in (cells if modem.cell == "auto" else [modem.cell])
        for ticks in (TICKS[1:4] if modem.ticks == "auto" else [modem.ticks])
        for line in (LINE_CODES[1:] if modem.line == "auto" else [modem.line])
        for parity in (PARITIES if modem.parity == "auto" else [modem.parity])
    ]


def choose_mode(
    scenario: LinkScenario, setting: LinkSetting, size: int, device: Device | None,
    progress: Progress,
) -> tuple[Mode, Choice | None]:  # fmt: skip
    """Returns the mode, and how it was chosen; None if the scenario gives it, or nothing can
    arrive.

    Args:
        scenario, setting: the link.
        size: of the file, bytes; an empty file counts as one byte.
        device: OpenCL device, None for numba.
        progress: of the pilots.
    """
    mode = _fixed_mode(scenario)
    if mode is not None:
        return mode, None
    modem = scenario.link.modem
    modes = _candidates(modem, (scenario.link.panel.width, scenario.link.panel.height), setting)
    # If nothing can arrive in any mode, take the first one, which takes the shortest time.
    if _tag_share(setting, modes[0]) < _NEVER or not panel_in_view(setting):
        return modes[0], None
    strip = strip_of(setting)
    progress.start("pilots", _PILOTS)
    tried = 0

    def trial(mode: Mode) -> Trial:
        nonlocal tried
        narrow = replace(mode, width=strip.optics.width)
        pilot = film_pilot(strip, narrow, modem.detector, scenario.seed, device)
        tried += 1
        progress.advance(tried)
        return Trial.of(narrow, pilot.sent, pilot.soft)

    camera = setting.camera
    choice = choose(
        trial, modes, size=max(size, 1), hz=setting.panel.clock.hz, most_trials=_PILOTS,
        threshold=camera.threshold if camera.reset == "hard" else None,
        background=cell_scene(setting).background,
        most_overhead=modem.overhead,
    )  # fmt: skip
    progress.advance(_PILOTS)
    return choice.mode, choice
