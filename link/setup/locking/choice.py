"""The mode of a link and the lock of its camera's clock, which depend on each other, and the time
that the stages of this took.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from cosim.compute.opencl import Device
from cosim.compute.table_cache import cached_value
from cosim.run.progress import Progress
from link.mode import Mode, Modem
from link.setting import LinkSetting
from link.setup.choosing import Choice
from link.setup.locking.loop import SOURCES, Locking
from link.setup.locking.model import at_lock
from link.setup.modes import check_reach, choose_mode
from link.setup.truth import panel_in_view
from sensor.device.chips import ClockSteering


def choose_and_lock(
    modem: Modem, setting: LinkSetting, steering: ClockSteering | None, size: int,
    device: Device | None, progress: Progress, spent: Spent, adaptive: bool = False,
    keeps: bool = False, most_lost: float = 1.0,
) -> tuple[Mode, Choice | None, Locking | None]:  # fmt: skip
    """Mode as `choose_mode`, and the loop that has locked the camera's clock; None if the clock
    cannot be steered or no lock is found. A mode is tried at the phase that it will have.

    Args:
        modem, setting, size, device, progress, adaptive, most_lost: arguments of `choose_mode`.
        steering: Steering of its clock; None for ticks that keep their length.
        spent: time spent in each stage; that of the pilots and of the loop is added.
        keeps: whether the choice and the measurements of the loop are kept between runs.

    Raises:
        InputError: for a panel that is too far away.
    """

    def chosen(setting: LinkSetting) -> tuple[Mode, Choice | None]:
        name = None if device is None else device.name
        arguments = repr(modem), setting, size, adaptive, most_lost, name

        def choose() -> tuple[Mode, Choice | None]:
            return choose_mode(modem, setting, size, device, progress, adaptive, most_lost)

        with spent.on("pilots"):
            mode, choice = (
                cached_value("pilots", arguments, SOURCES, tuple[Mode, Choice | None], choose)
                if keeps
                else choose()
            )
        if choice is None:  # there were none
            spent.forget("pilots")
        return mode, choice

    check_reach(setting)
    if steering is None or not panel_in_view(setting):
        return *chosen(setting), None
    mode, choice = chosen(at_lock(setting))
    locking = None
    if choice is None or choice.holds:
        with spent.on("phase lock"):
            try:
                locking = Locking(setting, mode, steering, modem.detector, device, keeps)
            except ValueError:  # a strip without room for a frame
                locking = None
            if locking is not None and not locking.acquire():
                locking = None
    if locking is None and choice is not None:
        mode, choice = chosen(setting)
    return mode, choice, locking


@dataclass(frozen=True)
class Spent:
    """Time by stage, s; a stage that comes again adds to its time.

    Attributes:
        wall: time on the clock.
        processor: time of all threads of the program. Other programs do not lengthen it.
    """

    wall: dict[str, float] = field(default_factory=dict)
    processor: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def on(self, stage: str) -> Iterator[None]:
        """Adds the time of the block to a stage."""
        wall, processor = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            self.wall[stage] = self.wall.get(stage, 0.0) + time.perf_counter() - wall
            self.processor[stage] = self.processor.get(stage, 0.0) + time.process_time() - processor

    def forget(self, stage: str) -> None:
        """Takes a stage out."""
        self.wall.pop(stage, None)
        self.processor.pop(stage, None)
