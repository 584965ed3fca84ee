"""A run of a link made ready: everything that can be refused is, before anything is written."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from cosim import InputError, seconds_to_ps
from cosim.compute.opencl import Device, choose_device
from cosim.run.progress import Progress
from link.air import Air, image_of
from link.air.geometry import panel_corners
from link.evaluation.light import cell_scene
from link.evaluation.reach import LEAST_CELL
from link.layout import TRAINING, Layout
from link.mode import CELLS, LINE_CODES, PARITIES, TICKS, Mode
from link.receiving.tags import LEAST_MODULE
from link.section import LinkScenario, ModemSection
from link.sending import Transmission
from link.setting import LEAD, TAIL, LinkSetting, Payload, link_setting, payload_of
from link.trial.check import LinkCheck, check_link
from link.trial.plan import LinkPlan, plan_link
from sensor import SpikeCamera
from sensor.latched.tiers import Tier

if TYPE_CHECKING:
    from link.choosing import Choice

__all__ = [
    "PreparedLink", "ReadyLink", "choose_mode", "in_view", "prepare_link", "ready_link",
    "tags_told",
]  # fmt: skip

_PILOTS = 8
"""At most."""
_HOPELESS_PLANES = 600
"""Filmed at most where no mode is foreseen to work: enough for a receiver to say why."""
_NEVER = 0.8
"""Share of the camera pixels that a tag's module needs, below which tags were never found."""
_HOPELESS_BLUR = 2.0
"""Sides of a cell, of blur from which no patch is looked at: nothing would be decided right."""


@dataclass(frozen=True)
class ReadyLink:
    """A run before it is planned. cycles: of the camera. choice: how the mode was chosen, None
    where it was given. seconds: what the stages took."""

    scenario: LinkScenario
    payload: Payload
    setting: LinkSetting
    mode: Mode
    choice: Choice | None
    sent: Transmission
    cycles: int
    device: Device | None
    seconds: dict[str, float]

    @property
    def hopeless(self) -> bool:
        """Whether no mode was foreseen to work, so that only a part is filmed."""
        foreseen = self.choice is None or self.choice.holds or self.scenario.duration is not None
        return not foreseen and self.sent.groups < self.sent.outbox.groups

    def hopeless_told(self) -> str:
        """Why, and how much of it is filmed."""
        assert self.choice is not None
        mine = [
            row.errors for row in self.choice.rows
            if row.errors is not None and _alike(row.mode, self.mode)
        ]  # fmt: skip
        wrong = f" ({mine[0]:.2g} of a pilot's bits were wrong in the surest)" if mine else ""
        hz = self.setting.panel.clock.hz
        whole = self.sent.whole * self.mode.ticks / hz
        return (
            f"no mode is foreseen to work{wrong}, so only {self.sent.planes / hz:.3g} s of the "
            f"{whole:.3g} s that the file takes are filmed; to film all, "
            "give link.modem.cell, ticks, line and parity"
        )


@dataclass(frozen=True)
class PreparedLink(ReadyLink):
    """A ready run that is planned and checked. plan: what is kept; check: what of the plan was
    measured on patches of the link. short: promises that do not hold with everything kept."""

    name: str
    plan: LinkPlan
    check: LinkCheck
    notes: list[str]
    short: list[str]

    def make_air(self) -> Air:
        """The stage that shines."""
        s = self.setting
        return Air(
            self.sent, s.panel, s.optics, s.aim, s.air, s.camera, first_light=s.first_light,
            planes=self.sent.planes, kept=self.plan.run_air,
        )  # fmt: skip

    def make_camera(self, late: npt.NDArray[np.int64]) -> SpikeCamera:
        """The stage that sees."""
        return SpikeCamera(self.plan.camera, self.device, tier=self.plan.tier, late=late)


def _planned(
    scenario: LinkScenario, setting: LinkSetting, sent: Transmission, cycles: int,
    device: Device | None, progress: Progress,
) -> tuple[LinkPlan, LinkCheck, list[str], list[str]]:  # fmt: skip
    """The plan, checked on patches; an effect is put back as long as they show that the run would
    be off by more than was asked for. Then notes, and what is short with everything kept."""
    tolerance = scenario.tolerance
    forced: list[str] = []
    told: list[str] = []
    tier: Tier | None = None
    while True:
        plan = plan_link(
            setting, sent.mode, sent.symbols, cycles, tolerance, device, forced=forced, tier=tier
        )
        blurred = cell_scene(setting).blur > _HOPELESS_BLUR * sent.mode.cell * setting.scale
        if blurred or not in_view(setting):
            return plan, LinkCheck(None, dict.fromkeys(plan.left_out), None, 0, None), told, []
        check = check_link(
            setting, sent, plan, detector=scenario.link.modem.detector, seed=scenario.seed,
            device=device, progress=progress,
        )  # fmt: skip
        if not check.beyond(tolerance):
            return plan, check, told, []
        assert check.paired is not None
        off = f"off by {check.paired.value:.2g} where {tolerance:g} was asked for"
        if plan.left_out:
            worst = max(plan.left_out, key=lambda name: check.measured.get(name) or 0.0)
            forced.append(worst)
            told.append(f"{worst} was put back: patches without it were {off}")
        elif plan.tier == "fast":
            tier = "exact"
            told.append(f"the exact tier was taken: patches in the fast one were {off}")
        else:
            return plan, check, told, [f"with every effect kept the run is {off}"]


def in_view(setting: LinkSetting) -> bool:
    """Whether the whole panel's image, its tags with it, lies on the sensor."""
    chip = setting.camera.chip
    home = image_of(setting.optics, setting.aim, setting.air, (chip.height, chip.width))
    u, v, w = home @ panel_corners(setting.optics).T
    x, y = u / w, v / w
    inside = (x > -1) & (x < chip.width) & (y > -1) & (y < chip.height)
    return bool(inside.all())


def _tags_share(setting: LinkSetting, mode: Mode) -> float:
    """Camera pixels of a tag's module over those that it needs to be found in a sharp image: of one
    that is not, blur is the cause."""
    return setting.scale * Layout(mode).module / LEAST_MODULE


def tags_told(setting: LinkSetting, mode: Mode) -> str | None:
    """That the tags are too small to be found, None where they are not."""
    share = _tags_share(setting, mode)
    if share >= 1:
        return None
    module = setting.scale * Layout(mode).module
    return (
        f"tags too small: a module of theirs has {module:.2g} camera pixels and is found from "
        f"{LEAST_MODULE:g} on; step nearer, or take a longer lens or a larger panel"
    )


def given_mode(scenario: LinkScenario) -> Mode | None:
    """The mode that the scenario names, None where a part of it is to be chosen."""
    modem, panel = scenario.link.modem, scenario.link.panel
    cell, ticks, line, parity = modem.cell, modem.ticks, modem.line, modem.parity
    if cell == "auto" or ticks == "auto" or line == "auto" or parity == "auto":
        return None
    return Mode(panel.width, panel.height, cell, ticks, line, parity)


def _candidates(modem: ModemSection, size: tuple[int, int], setting: LinkSetting) -> list[Mode]:
    """Modes that the scenario leaves open. Cells are somewhat larger than a camera pixel. Taken
    only where they are asked for: symbols of one tick, which share it with a neighbour unless the
    phase is 0, and the line code `none`, which limits no run."""
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
    """The mode, and how it was chosen. size: of the file, bytes; an empty one is
    weighed as one byte."""
    mode = given_mode(scenario)
    if mode is not None:
        return mode, None
    from link.choosing import Trial, choose
    from link.trial.pilot import film_pilot, strip_of

    modem = scenario.link.modem
    modes = _candidates(modem, (scenario.link.panel.width, scenario.link.panel.height), setting)
    unread = _tags_share(setting, modes[0]) < _NEVER
    if unread or not in_view(setting):  # nothing arrives in any of them: that which is soonest over
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


def _alike(one: Mode, other: Mode) -> bool:
    """Whether one pilot stands for both: parity is not in it."""
    return replace(one, parity=other.parity) == other


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


def ready_link(scenario: LinkScenario, device: str | None, progress: Progress) -> ReadyLink:
    """Everything of the run but its plan, checked. Raises InputError."""
    payload, setting = payload_of(scenario), link_setting(scenario)
    opened, seconds = choose_device(device), {}
    begin = time.perf_counter()
    mode, choice = choose_mode(scenario, setting, len(payload.data), opened, progress)
    if choice is not None:
        seconds["pilots"] = time.perf_counter() - begin
    modem = scenario.link.modem
    most = _symbols_in(scenario, setting, mode)
    if most is None and choice is not None and not choice.holds:
        least = TRAINING + 2 * Layout(mode).group
        most = max(_HOPELESS_PLANES // mode.ticks, least)
    begin = time.perf_counter()
    try:
        sent = Transmission(
            mode, payload.data, payload.name, interleave=modem.interleave,
            overhead=modem.overhead, most_symbols=most,
        )  # fmt: skip
    except ValueError as exc:
        raise InputError(
            "link.modem", "a mode that the panel has room for", str(exc),
            "take smaller cells or a larger panel",
        ) from exc  # fmt: skip
    seconds["sender"] = time.perf_counter() - begin
    clock = setting.camera.clock
    dark = setting.first_light + setting.panel.clock.edge(sent.planes)
    cycles = clock.cycle_at(dark) + 1 + TAIL
    return ReadyLink(scenario, payload, setting, mode, choice, sent, cycles, opened, seconds)


def prepare_link(
    name: str, scenario: LinkScenario, device: str | None, progress: Progress
) -> PreparedLink:
    """Everything of the run, checked. Raises InputError."""
    run = ready_link(scenario, device, progress)
    begin = time.perf_counter()
    plan, check, told, short = _planned(
        scenario, run.setting, run.sent, run.cycles, run.device, progress
    )
    run.seconds["plan and check"] = time.perf_counter() - begin
    notes = [*_notes(run), *told]
    return PreparedLink(**vars(run), name=name, plan=plan, check=check, notes=notes, short=short)


def _notes(run: ReadyLink) -> list[str]:
    """What a user must know before the run."""
    setting, choice = run.setting, run.choice
    notes: list[str] = []
    if setting.chosen_f_number:
        notes.append(f"f/{setting.optics.f_number:.3g} chosen by link.aim.on_level")
    if choice is not None:
        mode = choice.mode
        told = (
            f"cells of {mode.cell} x {mode.cell}, symbols of {mode.ticks} ticks, {mode.line} and "
            f"Reed-Solomon (255, {255 - mode.parity})"
        )
        notes.append(
            f"{told}: chosen from pilots" if choice.holds
            else f"no mode is foreseen to work; taken, as the surest: {told}"
        )  # fmt: skip
    if run.hopeless:
        notes.append(run.hopeless_told())
    small = tags_told(setting, run.mode)
    return notes if small is None else [*notes, small]
