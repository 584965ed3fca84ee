"""Assembles the machine of a link, with the board that loops back the panel's planes."""

from __future__ import annotations

from contextlib import ExitStack

from cosim import InputError
from cosim.run.progress import Progress
from cosim.run.result import Metric
from cosim.spikes.viform import WORD, unpack_planes
from link.machine import LinkMachine
from link.section import LinkScenario
from link.sending import Transmission
from link.setting import check_receiver
from link.setup.setup import set_up_link
from rtl_model.geometry import Geometry
from rtl_model.stand_in import BoardDisplay, open_board
from scenarios.assemble.chip import camera_setting
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


class Loop:
    """An open board of the panel's size; implements `PanelLoop`.

    Attributes:
        name: name of the board, for messages.
        planes: number of planes sent so far.
        wrong_bits: number of bits that returned with a different value.
    """

    def __init__(self, board: BoardDisplay, name: str, opened: ExitStack) -> None:
        self._board, self.name, self._opened = board, name, opened
        self.planes = self.wrong_bits = 0
        self._wrong_crc = False

    def send(self, sent: Transmission, progress: Progress) -> None:
        """Sends all planes, in order."""
        progress.start(f"planes through {self.name}", sent.planes)
        for first in range(0, sent.planes, WORD):
            count = min(WORD, sent.planes - first)
            planes = unpack_planes(sent.words(first, count), 0, count).astype(bool)
            burst = self._board.show(planes)
            self.planes += count
            self.wrong_bits += burst.wrong_bits
            self._wrong_crc |= burst.wrong_crc
            progress.advance(first + count)

    def metrics(self) -> dict[str, Metric]:
        return {
            "loop_planes": Metric(self.planes, "planes"),
            "loop_bits_wrong": Metric(self.wrong_bits, "bits"),
        }

    @property
    def fault(self) -> str | None:
        """The reason for a failed run; None if all bits returned unchanged."""
        if self.wrong_bits:
            return f"{self.name} returned {self.wrong_bits} bits with a different value"
        if self._wrong_crc:
            return f"the planes that {self.name} displayed differ from those sent: CRC-32"
        return None

    def close(self) -> None:
        self._opened.close()


def open_loop(scenario: LinkScenario) -> Loop | None:
    """Opens the board of `link.loop`; None without one. Raises InputError if it does not answer, or
    if its size differs from the panel's."""
    place, panel = scenario.link.loop, scenario.link.panel
    if place is None:
        return None
    plane = panel.width // 32 * panel.height  # widths are multiples of 32
    room = 1 << (WORD * (plane + 3 * panel.height)).bit_length()  # buffer of a virtual board, words
    virtual = Geometry(panel.height, panel.width, capture_words=room, sink_words=room)
    with ExitStack() as stack:
        board = stack.enter_context(open_board(place, "link.loop", virtual))
        if (board.info.rows, board.info.columns) != (panel.height, panel.width):
            raise InputError(
                "link.panel", f"of {board.info.columns} x {board.info.rows} pixels, which "
                f"{board.name} has", f"of {panel.width} x {panel.height}",
                "choose a board of that size, or leave link.loop out",
            )  # fmt: skip
        return Loop(BoardDisplay(board, back=True), board.name, stack.pop_all())
