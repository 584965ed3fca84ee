"""A link set up from its scenario: checked, with its mode, not yet planned."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from cosim import InputError, seconds_to_ps
from cosim.compute.opencl import Device, choose_device
from cosim.config.amounts import at_least
from cosim.run.progress import Progress
from link.layout import TRAINING, Layout
from link.mode import EVERY_RATE, Mode
from link.section import LinkScenario
from link.sending import FileTransmission, Transmission
from link.setting import (
    LEAD,
    TAIL,
    LinkSetting,
    Payload,
    link_setting,
    payload_of,
    steering_of,
)
from link.setup.choosing import Choice
from link.setup.locking.choice import choose_and_lock
from link.setup.locking.loop import ClockLock
from link.setup.modes import fixed_mode, tag_warning
from link.setup.spent import Spent
from link.setup.truth import panel_in_view
from sensor import CameraSetting

__all__ = ["FileLinkSetup", "LinkSetup", "set_up_link"]

_SHORTENED_PLANES = 600
"""Largest number of planes if no mode is expected to work: enough for the receiver to find the
cause."""


@dataclass(frozen=True)
class LinkSetup:
    """A link before it is planned.

    Attributes:
        scenario: the scenario.
        setting: panel, lens, air and camera with every effect.
        mode, choice: the mode, and how it was chosen; None if the scenario gives it.
        sent: the transmission.
        cycles: of the camera.
        device: OpenCL device, None for the compiled form on the processor.
        times: of each stage so far.
        lock: of the camera's clock; None if its ticks are of one length.
    """

    scenario: LinkScenario
    setting: LinkSetting
    mode: Mode
    choice: Choice | None
    sent: Transmission
    cycles: int
    device: Device | None
    times: Spent
    lock: ClockLock | None

    @property
    def device_name(self) -> str:
        return "numba on this processor" if self.device is None else self.device.name

    @property
    def symbols(self) -> int:
        """Symbols of the whole transmission, training and closing included."""
        return self.sent.symbols

    @property
    def pixel_cycles(self) -> int:
        """Pixel-cycles of the whole run."""
        chip = self.setting.camera.chip
        return chip.width * chip.height * self.cycles

    def notes(self) -> list[str]:
        """Returns the notes for the user before the run."""
        setting, choice = self.setting, self.choice
        notes: list[str] = []
        if setting.chosen_f_number:
            notes.append(f"f/{setting.optics.f_number:.3g} chosen by link.aim.on_level")
        if choice is not None:
            mode = choice.mode
            text = (
                f"cells of {mode.cell} x {mode.cell}, symbols of {mode.ticks} "
                f"{'tick' if mode.ticks == 1 else 'ticks'}, {mode.line} "
                f"and {mode.word_code}"
            )
            notes.append(
                f"{text}: chosen from pilots" if choice.holds
                else f"no mode is foreseen to work; taken, as the surest: {text}"
            )  # fmt: skip
        if self.lock is not None:
            notes.append(
                f"camera's clock locked to the panel in {self.lock.acquired} ticks before the run"
            )
        elif steering_of(self.scenario.sensor) is not None and panel_in_view(self.setting):
            notes.append("no lock of the camera's clock to the panel was found: it runs freely")
        return notes + self.warnings()

    def warnings(self) -> list[str]:
        """Returns why the data will not arrive, as far as that is known before the run."""
        small = tag_warning(self.setting, self.mode)
        return [] if small is None else [small]


@dataclass(frozen=True)
class FileLinkSetup(LinkSetup):
    """A link that sends a file.

    Attributes:
        payload: the file.
    """

    sent: FileTransmission
    payload: Payload

    @property
    def shortened(self) -> bool:
        """Whether only a part is recorded, because no mode is expected to work."""
        timed = self.scenario.duration is not None
        hopeful = timed or _hopeful(self.scenario, self.setting, self.mode, self.choice)
        return not hopeful and self.sent.groups < self.sent.outbox.groups

    def mode_document(self) -> dict[str, Any]:
        """Returns the mode, for documents. rates: of the blocks in turn, each with the number of
        blocks in a row that have it; empty for one code."""
        return {**asdict(self.mode), "rates": [list(run) for run in self.sent.outbox.runs]}

    def shortened_message(self) -> str:
        """Returns why only a part is recorded, and how long it is."""
        rows = () if self.choice is None else self.choice.rows
        mine = [
            row.errors for row in rows
            if row.errors is not None and row.mode.symbols == self.mode.symbols
        ]  # fmt: skip
        wrong = f" ({mine[0]:.2g} of a pilot's bits were wrong in the surest)" if mine else ""
        hz = self.setting.panel.clock.hz
        whole = self.sent.whole * self.mode.ticks / hz
        foreseen = f"no mode is foreseen to work{wrong}"
        if self.choice is not None and self.choice.holds:
            foreseen = "the tags are foreseen to be too small"
        return (
            f"{foreseen}, so only {self.sent.planes / hz:.3g} s of the "
            f"{whole:.3g} s that the file takes are filmed; to film all, "
            "give link.modem.cell, ticks, line and parity or rate"
        )

    def warnings(self) -> list[str]:
        """Returns why the file will not arrive, as far as that is known before the run."""
        return ([self.shortened_message()] if self.shortened else []) + super().warnings()


def _hopeful(
    scenario: LinkScenario, setting: LinkSetting, mode: Mode, choice: Choice | None
) -> bool:
    """Whether a mode is expected to work, or the scenario gives it. Pilots need no tags, so a mode
    that carries them does not yet work."""
    if choice is None:
        return fixed_mode(scenario) is not None
    return choice.holds and tag_warning(setting, mode) is None


def _symbols_in(scenario: LinkScenario, setting: LinkSetting, mode: Mode) -> int | None:
    """Returns the number of symbols in the scenario's duration; None without a duration."""
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
            "duration", f"at least {at_least(need, 3)} s, the training and a group of symbols",
            f"{scenario.duration:g} s", "lengthen it, or leave it out",
        )  # fmt: skip
    return symbols


def set_up_link(
    scenario: LinkScenario, camera: CameraSetting, device: str | None, progress: Progress
) -> FileLinkSetup:
    """Checks a scenario and chooses its mode.

    Args:
        scenario: the scenario.
        camera: that of [sensor], with every effect.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        progress: of the pilots.

    Raises:
        InputError: if the scenario cannot be simulated.
    """
    payload, setting = payload_of(scenario), link_setting(scenario, camera)
    opened = choose_device(device)
    spent = Spent()
    mode, choice, locking = choose_and_lock(
        scenario, setting, len(payload.data), opened, progress, spent, adaptive=True
    )
    setting = setting if locking is None else locking.setting
    modem, rates = scenario.link.modem, () if choice is None else choice.rates
    if mode.adaptive and not rates:  # nothing is expected to arrive
        rates = (EVERY_RATE.index(min(EVERY_RATE)),)
    most = _symbols_in(scenario, setting, mode)
    if most is None and not _hopeful(scenario, setting, mode, choice):
        least = TRAINING + 2 * Layout(mode).group
        most = max(_SHORTENED_PLANES // mode.ticks, least)
    try:
        with spent.on("sender"):
            sent = FileTransmission(
                mode, payload.data, payload.name, interleave=modem.interleave,
                overhead=modem.overhead, most_symbols=most, rates=rates,
            )  # fmt: skip
    except ValueError as exc:
        raise InputError(
            "link.modem", "a mode that the panel has room for", str(exc),
            "take smaller cells or a larger panel",
        ) from exc  # fmt: skip
    lock = None
    if locking is not None:
        with spent.on("phase lock"):
            setting, lock = locking.hold(setting, sent.planes, progress)
    clock = setting.camera.clock
    dark = setting.first_light + setting.panel.clock.edge(sent.planes)
    cycles = clock.cycle_at(dark) + 1 + TAIL
    return FileLinkSetup(
        scenario, setting, mode, choice, sent, cycles, opened, spent, lock, payload
    )
