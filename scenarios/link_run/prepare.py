"""A run of a link made ready: everything that can be refused is, before anything is written."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from cosim import InputError, seconds_to_ps
from cosim.opencl import Device
from link.air import Air
from link.layout import TRAINING, Layout
from link.mode import CELLS, LINE_CODES, PARITIES, TICKS, Mode
from link.sending import Transmission
from scenarios.linking import LEAD, TAIL, LinkSetting, Payload, link_setting, payload_of
from scenarios.prepare import choose_device
from scenarios.progress import Progress
from scenarios.schema import LinkScenario, ModemSection
from sensor import SpikeCamera

if TYPE_CHECKING:
    from scenarios.link_run.pilot import Pilot

__all__ = ["PreparedLink", "choose_mode", "prepare_link"]

_LEAST_CELL = 1.2
"""Camera pixels to a cell's side, at least: nearer to 1 the grids' beat leaves cells without a
pixel of their own."""


@dataclass(frozen=True)
class PreparedLink:
    """A checked run. cycles: of the camera. kept: effects of the air that are simulated. tier: of
    the camera's pixels. choice: how the mode was chosen, None where it was given."""

    name: str
    scenario: LinkScenario
    payload: Payload
    setting: LinkSetting
    mode: Mode
    choice: Any
    sent: Transmission
    cycles: int
    device: Device | None
    kept: Collection[str]
    tier: str
    notes: list[str]

    def make_air(self) -> Air:
        """The stage that shines."""
        s = self.setting
        return Air(
            self.sent, s.panel, s.optics, s.aim, s.air, s.camera, first_light=s.first_light,
            planes=self.sent.planes, kept=None,
        )  # fmt: skip

    def make_camera(self, late: npt.NDArray[np.int64]) -> SpikeCamera:
        """The stage that sees."""
        return SpikeCamera(self.setting.camera, self.device, late=late)

    def checks(self, air: Air) -> dict[str, Any]:
        """Stages that measure the error of what was left out."""
        return {}


def given_mode(scenario: LinkScenario) -> Mode | None:
    """The mode that the scenario names, None where a part of it is to be chosen."""
    modem, panel = scenario.link.modem, scenario.link.panel
    parts = (modem.cell, modem.ticks, modem.line, modem.parity)
    if "auto" in parts:
        return None
    return Mode(panel.width, panel.height, *parts)


def _candidates(modem: ModemSection, size: tuple[int, int], scale: float) -> list[Mode]:
    """Modes that the scenario leaves open, of any parity. A cell is not much smaller than a camera
    pixel; `none`, which limits no run, is taken only where it is asked for."""
    cells = [c for c in CELLS if c * scale >= _LEAST_CELL] or [CELLS[-1]]
    return [
        Mode(*size, cell, ticks, line, PARITIES[0])
        for cell in (cells if modem.cell == "auto" else [modem.cell])
        for ticks in (TICKS[:4] if modem.ticks == "auto" else [modem.ticks])
        for line in (LINE_CODES[1:] if modem.line == "auto" else [modem.line])
    ]


def choose_mode(
    scenario: LinkScenario, setting: LinkSetting, device: Device | None, progress: Progress
) -> tuple[Mode, Any]:
    """The mode, and how it was chosen."""
    mode = given_mode(scenario)
    if mode is not None:
        return mode, None
    from scenarios.link_run.choosing import choose
    from scenarios.link_run.pilot import film_pilot, strip_of

    modem, strip = scenario.link.modem, strip_of(setting)
    whole = scenario.link.panel.width, scenario.link.panel.height
    modes = _candidates(modem, whole, setting.scale)
    parities = PARITIES if modem.parity == "auto" else (modem.parity,)
    progress.start("pilots", len(modes))

    def trial(mode: Mode) -> Pilot:
        narrow = replace(mode, width=strip.width)
        pilot = film_pilot(strip, narrow, modem.detector, scenario.seed, device)
        progress.advance(modes.index(mode) + 1)
        return pilot

    choice = choose(trial, modes, parities, setting.panel.clock.hz)
    progress.advance(len(modes))
    return choice.mode, choice


def _symbols_in(scenario: LinkScenario, setting: LinkSetting, mode: Mode) -> int | None:
    """Symbols that the given duration has room for; None where it is not given."""
    if scenario.duration is None:
        return None
    clock, panel = setting.camera.clock, setting.panel.clock
    cycles = clock.cycles_in(seconds_to_ps(scenario.duration))
    room = clock.edge(cycles - TAIL) - setting.first_light
    symbols = panel.cycle_at(max(room, 0)) // mode.ticks
    least = TRAINING + Layout(mode).group
    if symbols < least:
        need = (least * mode.ticks + 1) / panel.hz + (LEAD + TAIL + 1) / clock.hz
        raise InputError(
            "duration", f"at least {need:.3g} s, the training and a group of symbols",
            f"{scenario.duration:g} s", "lengthen it, or leave it out",
        )  # fmt: skip
    return symbols


def prepare_link(
    name: str, scenario: LinkScenario, device: str | None, progress: Progress
) -> PreparedLink:
    """Everything of the run, checked. Raises InputError."""
    payload, setting = payload_of(scenario), link_setting(scenario)
    opened = choose_device(device)
    mode, choice = choose_mode(scenario, setting, opened, progress)
    modem = scenario.link.modem
    sent = Transmission(
        mode, payload.data, payload.name, interleave=modem.interleave, overhead=modem.overhead,
        most_symbols=_symbols_in(scenario, setting, mode),
    )  # fmt: skip
    clock = setting.camera.clock
    dark = setting.first_light + setting.panel.clock.edge(sent.planes)
    cycles = clock.cycle_at(dark) + 1 + TAIL
    return PreparedLink(
        name, scenario, payload, setting, mode, choice, sent, cycles, opened, (), "exact", []
    )  # fmt: skip
