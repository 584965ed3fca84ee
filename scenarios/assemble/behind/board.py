"""A board that displays the planes of a stream in the place of a display (`display.sink`).

`rtl_model.stand_in` is imported only for scenarios with a board.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from cosim import Block, InputError, Viform
from cosim.run.machine import Outcome
from cosim.run.result import Metric
from cosim.spikes.viform import unpack_planes
from display import fit_words
from display.section import DisplaySection

if TYPE_CHECKING:
    from rtl_model.stand_in import BoardDisplay


class BoardPanel:
    """A board as the display stage of the chain. The stage passes the stream on unchanged.

    Attributes:
        name: name of the board, for messages.
        planes: number of planes displayed so far.
        wrong: number of bursts with a wrong CRC-32.
    """

    def __init__(self, board: BoardDisplay, name: str, fit: str, shape: tuple[int, int]) -> None:
        self._board, self.name = board, name
        try:
            self._fit = fit_words(fit, shape, board.shape)  # type: ignore[arg-type]  # the schema's
        except ValueError as exc:
            raise InputError(
                "the stream for display.sink", f"of {board.shape[1]} x {board.shape[0]} pixels, "
                f"the size of {name}", f"of {shape[1]} x {shape[0]}",
                "set display.fit=nearest or centre, or sensor.source to a board of that size",
            ) from exc  # fmt: skip
        self.planes = self.wrong = 0

    def step(self, data: Viform, block: Block) -> Viform:
        """Displays the planes of one block."""
        words = self._fit(data.words)
        burst = self._board.show(unpack_planes(words, 0, block.cycles).astype(bool))
        self.planes += burst.planes
        self.wrong += burst.wrong_crc
        return data

    @property
    def note(self) -> str:
        """A note for the user before the run."""
        return f"{self.name} displays the planes; no light is rendered"

    def judge(self, outcome: Outcome) -> Outcome:
        """The outcome of a source with that of the board, which fails it where planes differ."""
        told = f"the planes that {self.name} displayed differ from those sent: CRC-32"
        return replace(
            outcome,
            outcome="failed" if self.wrong else outcome.outcome,
            metrics={
                **outcome.metrics,
                "sink_planes": Metric(self.planes, "planes"),
                "sink_crc_wrong": Metric(self.wrong, "bursts"),
            },
            notes=[*outcome.notes, *([told] if self.wrong else [])],
        )


@contextmanager
def open_panel(section: DisplaySection, shape: tuple[int, int]) -> Iterator[BoardPanel | None]:
    """Opens the board of `display.sink` as a stage, None without one, and closes it at the end of
    the context. Raises InputError if it does not answer or does not hold the stream.

    shape: (height, width) of the stream.
    """
    if section.sink is None:
        yield None
        return
    from rtl_model.stand_in import BoardDisplay, open_board

    with open_board(section.sink, "display.sink") as board:
        yield BoardPanel(BoardDisplay(board), board.name, section.fit, shape)
