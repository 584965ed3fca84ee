"""Assembles the machine of a link, with the board that loops back the panel's planes."""

from __future__ import annotations

from contextlib import ExitStack

from cosim.run.progress import Progress
from link.machine import LinkMachine
from link.section import LinkScenario
from link.setting import check_receiver
from link.setup.setup import set_up_link
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.link_loop import open_loop
from sensor import CameraSetting


def link_camera(scenario: LinkScenario) -> CameraSetting:
    """The camera at the receiver. Raises InputError for a camera that cannot receive a link."""
    check_receiver(scenario.sensor)
    return camera_setting(scenario)


def assemble_link(
    name: str, scenario: LinkScenario, device: str | None, progress: Progress
) -> LinkMachine:
    """The machine of a link. Raises InputError for a link that cannot be simulated, and for a board
    that does not answer."""
    with ExitStack() as stack:
        loop = open_loop(scenario)
        if loop is not None:
            stack.callback(loop.close)
        setup = set_up_link(scenario, link_camera(scenario), device, progress)
        machine = LinkMachine(name, setup, loop)
        stack.pop_all()  # the machine closes the board from here on
    return machine
