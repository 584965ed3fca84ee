"""A link set up: checked, its mode chosen and its clock locked; then with what it sends.

`choose_link` does what a link needs once; `ChosenLink.file` gives a transmission of it. A run, and
a link that is called (`link.core`), are set up by both.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from cosim import InputError, seconds_to_ps
from cosim.compute.opencl import Device, choose_device
from cosim.config.amounts import at_least
from cosim.config.quantity import DAY
from cosim.run.progress import Progress
from link.layout import TRAINING, Layout
from link.mode import EVERY_RATE, Mode, Modem
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
from link.setup.locking.choice import Spent, choose_and_lock
from link.setup.locking.loop import ClockLock, Locking
from link.setup.modes import fixed_mode, tag_warning
from link.setup.truth import panel_in_view
from sensor import CameraSetting
from sensor.device.chips import ClockSteering

_SHORTENED_PLANES = 600
"""Largest number of planes if no mode is expected to work: enough for the receiver to find the
cause."""


@dataclass(frozen=True)
class ChosenLink:
    """A link without data: its mode is chosen, and its camera's clock locked where it can be.

    Attributes:
        modem: how bytes become planes, as asked for.
        tolerance: Limit of the change of the bit error rate, half-widths of its interval.
        steering: Steering of its clock; None for ticks that keep their length.
        setting: panel, lens, air and camera with every effect.
        mode, choice: the mode, and how it was chosen; None if the modem gives it.
        device: OpenCL device, None for the compiled form on the processor.
        times: times of each stage so far.
        locking: the loop that has locked the clock; None without a lock.
    """

    modem: Modem
    tolerance: float
    steering: ClockSteering | None
    setting: LinkSetting
    mode: Mode
    choice: Choice | None
    device: Device | None
    times: Spent
    locking: Locking | None

    @property
    def mode_given(self) -> bool:
        """Whether the modem gives the mode, so that it is not chosen by pilots."""
        return fixed_mode(self.modem, self.setting.panel.shape) is not None

    @property
    def hopeful(self) -> bool:
        """Whether the mode is expected to work, or given. Pilots need no tags, so a mode that
        carries them does not yet work."""
        if self.choice is None:
            return self.mode_given
        return self.choice.holds and tag_warning(self.setting, self.mode) is None

    def held(
        self,
        planes: int,
        progress: Progress,
        setting: LinkSetting | None = None,
        measured: bool = True,
    ) -> tuple[LinkSetting, ClockLock | None]:
        """Link with the ticks of its clock over a transmission, and how they were held. Raises
        InputError if the transmission takes more than a day.

        Args:
            planes: number of planes of the transmission.
            progress: progress of the ticks.
            setting: setting with other hidden spans, or the noise of another seed; that of the link
                if None.
            measured: measurement of the lock, as in `Locking.hold`.
        """
        setting = setting or self.setting
        clock, days = setting.camera.clock, planes / setting.panel.clock.hz / DAY
        if days > 1:
            raise InputError(
                "sensor.clock",
                f"at least {at_least(clock.hz * days, 3)} Hz, for a transmission of a day",
                f"{clock.hz:g} Hz, of {days:.3g} days", "raise it",
            )  # fmt: skip
        if self.locking is None:
            return setting, None
        with self.times.on("phase lock"):
            return self.locking.hold(setting, planes, progress, measured)

    def file(
        self, payload: Payload, progress: Progress, most_symbols: int | None = None,
        seed: int | None = None,
    ) -> FileSetup:  # fmt: skip
        """Link with a file to send.

        Args:
            payload: the file.
            progress: progress of the ticks of a locked clock.
            most_symbols: number of symbols after which the transmission is cut; None for the whole
                file, or for as many as show the cause if it is not expected to arrive.
            seed: seed of the noise of a call; None for a run with the noise of the link, whose lock
                is measured to its end.

        Raises:
            InputError: the panel has no room for a frame.
        """
        mode, rates = self.mode, () if self.choice is None else self.choice.rates
        if mode.adaptive and not rates:  # nothing is expected to arrive
            rates = (EVERY_RATE.index(min(EVERY_RATE)),)
        most = most_symbols
        if most is None and not self.hopeful:
            least = TRAINING + 2 * Layout(mode).group
            most = max(_SHORTENED_PLANES // mode.ticks, least)
        try:
            with self.times.on("sender"):
                sent = FileTransmission(
                    mode, payload.data, payload.name, interleave=self.modem.interleave,
                    overhead=self.modem.overhead, most_symbols=most, rates=rates,
                )  # fmt: skip
        except ValueError as exc:
            raise InputError(
                "link.modem", "a mode that the panel has room for", str(exc),
                "take smaller cells or a larger panel",
            ) from exc  # fmt: skip
        setting = self.setting
        if seed is not None:
            setting = replace(
                setting, camera=replace(setting.camera, seed=seed),
                air=replace(setting.air, seed=seed),
            )  # fmt: skip
        setting, lock = self.held(sent.planes, progress, setting, seed is None)
        clock = setting.camera.clock
        dark = setting.first_light + setting.panel.clock.edge(sent.planes)
        cycles = clock.cycle_at(dark) + 1 + TAIL
        return FileSetup(self, setting, sent, cycles, lock, payload, most_symbols is not None)


def choose_link(
    modem: Modem, setting: LinkSetting, steering: ClockSteering | None, tolerance: float, size: int,
    device: Device | None, progress: Progress, adaptive: bool = True, keeps: bool = False,
    most_lost: float = 1.0,
) -> ChosenLink:  # fmt: skip
    """Chooses the mode of a link and locks its clock.

    Args:
        modem, setting, steering, tolerance, device: see `ChosenLink`.
        size: size of the file for which the mode is chosen, bytes.
        progress: progress of the pilots.
        adaptive: whether blocks can have a rate each.
        keeps: whether what is found is kept for the next run of the same link.
        most_lost: largest share of frames lost, as in `choosing.foresee`.

    Raises:
        InputError: if the link cannot be simulated.
    """
    spent = Spent()
    mode, choice, locking = choose_and_lock(
        modem, setting, steering, size, device, progress, spent, adaptive, keeps, most_lost
    )
    setting = setting if locking is None else locking.setting
    return ChosenLink(modem, tolerance, steering, setting, mode, choice, device, spent, locking)


@dataclass(frozen=True)
class LinkSetup:
    """A link before it is planned.

    Attributes:
        chosen: the link without data.
        setting: panel, lens, air and camera with every effect, in this transmission.
        sent: the transmission.
        cycles: number of cycles of the camera.
        lock: lock of the camera's clock; None if its ticks are of one length.
    """

    chosen: ChosenLink
    setting: LinkSetting
    sent: Transmission
    cycles: int
    lock: ClockLock | None

    @property
    def modem(self) -> Modem:
        return self.chosen.modem

    @property
    def mode(self) -> Mode:
        return self.chosen.mode

    @property
    def choice(self) -> Choice | None:
        return self.chosen.choice

    @property
    def device(self) -> Device | None:
        return self.chosen.device

    @property
    def times(self) -> Spent:
        return self.chosen.times

    @property
    def tolerance(self) -> float:
        return self.chosen.tolerance

    @property
    def seed(self) -> int:
        """Seed of the link: that of its first transmission."""
        return self.chosen.setting.air.seed

    @property
    def mode_given(self) -> bool:
        return self.chosen.mode_given

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
        """Notes for the user before the run."""
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
        elif self.chosen.steering is not None and panel_in_view(self.setting):
            notes.append("no lock of the camera's clock to the panel was found: it runs freely")
        return notes + self.warnings()

    def warnings(self) -> list[str]:
        """Why the data will not arrive, as far as that is known before the run."""
        small = tag_warning(self.setting, self.mode)
        return [] if small is None else [small]


@dataclass(frozen=True)
class FileSetup(LinkSetup):
    """A link that sends a file.

    Attributes:
        payload: the file.
        limited: whether the length of the transmission is given.
    """

    sent: FileTransmission
    payload: Payload
    limited: bool

    @property
    def shortened(self) -> bool:
        """Whether only a part is recorded, because no mode is expected to work."""
        hopeful = self.limited or self.chosen.hopeful
        return not hopeful and self.sent.groups < self.sent.outbox.groups

    def mode_document(self) -> dict[str, Any]:
        """Mode, for documents. rates: of the blocks in turn, each with the number of blocks in a
        row that have it; empty for one code."""
        return {**asdict(self.mode), "rates": [list(run) for run in self.sent.outbox.runs]}

    def shortened_message(self) -> str:
        """Why only a part is recorded, and how long it is."""
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
        """Why the file will not arrive, as far as that is known before the run."""
        return ([self.shortened_message()] if self.shortened else []) + super().warnings()


@dataclass(frozen=True)
class FileLinkSetup(FileSetup):
    """A link that sends the file of a scenario.

    Attributes:
        scenario: the scenario.
    """

    scenario: LinkScenario


def _symbols_in(scenario: LinkScenario, setting: LinkSetting, mode: Mode) -> int | None:
    """Number of symbols in the scenario's duration; None without a duration."""
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
        camera: camera of [sensor], with every effect.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        progress: progress of the pilots.

    Raises:
        InputError: if the scenario cannot be simulated.
    """
    payload, setting = payload_of(scenario), link_setting(scenario, camera)
    chosen = choose_link(
        scenario.link.modem, setting, steering_of(scenario.sensor), scenario.tolerance,
        len(payload.data), choose_device(device), progress, keeps=True,
    )  # fmt: skip
    most = _symbols_in(scenario, chosen.setting, chosen.mode)
    made = chosen.file(payload, progress, most)
    return FileLinkSetup(
        chosen, made.setting, made.sent, made.cycles, made.lock, payload, made.limited, scenario
    )
