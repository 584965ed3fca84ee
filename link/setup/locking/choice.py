"""The mode of a link and the lock of its camera's clock, which depend on each other."""

from __future__ import annotations

from cosim.compute.kept import kept_value
from cosim.compute.opencl import Device
from cosim.run.progress import Progress
from link.mode import Mode, Modem
from link.setting import LinkSetting
from link.setup.choosing import Choice
from link.setup.locking.loop import SOURCES, Locking
from link.setup.locking.model import at_lock
from link.setup.modes import check_reach, choose_mode
from link.setup.spent import Spent
from link.setup.truth import panel_in_view
from sensor.device.chips import ClockSteering


def choose_and_lock(
    modem: Modem, setting: LinkSetting, steering: ClockSteering | None, size: int,
    device: Device | None, progress: Progress, spent: Spent, adaptive: bool = False,
    keeps: bool = False,
) -> tuple[Mode, Choice | None, Locking | None]:  # fmt: skip
    """Mode as `choose_mode`, and the loop that has locked the camera's clock; None if the clock
    cannot be steered or no lock is found. A mode is tried at the phase that it will have.

    Args:
        modem, setting, size, device, progress, adaptive: modem, setting, size, device, progress and
            adaptive as in `choose_mode`.
        steering: Steering of its clock; None for ticks that keep their length.
        spent: time spent in each stage; that of the pilots and of the loop is added.
        keeps: whether the choice and the measurements of the loop are kept between runs.

    Raises:
        InputError: for a panel that is too far away.
    """

    def chosen(setting: LinkSetting) -> tuple[Mode, Choice | None]:
        arguments = repr(modem), setting, size, adaptive, None if device is None else device.name

        def choose() -> tuple[Mode, Choice | None]:
            return choose_mode(modem, setting, size, device, progress, adaptive)

        with spent.on("pilots"):
            mode, choice = (
                kept_value("pilots", arguments, SOURCES, tuple[Mode, Choice | None], choose)
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
