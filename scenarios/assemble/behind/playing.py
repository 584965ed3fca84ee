"""Plays a stream over the link and into the display or the board of a scenario: one chain of stages
for every source."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from cosim import Clock, run_blocks
from cosim.files import Recorder
from cosim.light.source import Source
from cosim.run.chain import STREAM
from cosim.run.folder import how_to_resume, room_for
from cosim.run.progress import Progress
from scenarios.assemble.behind.display.screen import Screen
from scenarios.assemble.behind.link.carrier import RECEIVED, Carrier
from scenarios.assemble.camera.boards import BoardPanel
from scenarios.assemble.source.feeds import Planes
from sensor.latched.stages import SceneStage

SHOWN: Final = "shown.zarr"
"""The planes that the source has given, in the folder of a run whose recording are no planes."""


@dataclass(frozen=True, eq=False)
class Played:
    """A stream that has been played.

    Attributes:
        stages: the stages of the chain, after their last block.
        spent: wall time of each, s.
        given: recording of the planes that the source has given.
        shown: recording of those that came to the display: the same without a link.
    """

    stages: dict[str, Any]
    spent: dict[str, float]
    given: Path
    shown: Path


@dataclass(frozen=True, eq=False)
class Playing:
    """A link, a display or board, or both, which wait for a stream.

    Attributes:
        scene: the scene for the reference displays and the truth; None without one.
        screen: the display; None without one.
        board: the board that displays the planes; None without one.
        carrier: the link; None without one.
        clock, cycles, shape: clock, cycles and shape of the stream.
        opened: stack that closes display and board.
    """

    scene: Source | None
    screen: Screen | None
    board: BoardPanel | None
    carrier: Carrier | None
    clock: Clock
    cycles: int
    shape: tuple[int, int]
    opened: ExitStack

    @property
    def notes(self) -> list[str]:
        return [
            *([] if self.screen is None else self.screen.notes),
            *([] if self.board is None else [self.board.note]),
            *([] if self.carrier is None else self.carrier.notes),
        ]

    @property
    def pixel_cycles(self) -> int:
        """Upper limit of what is recorded, bits."""
        height, width = self.shape
        sent = 0 if self.carrier is None else self.carrier.pixel_cycles
        return self.cycles * height * width + sent

    def play(
        self, planes: Planes, folder: Path, seconds: dict[str, float], progress: Progress
    ) -> Played:
        """Sends and shows the planes, and records them if they are not in the folder yet. An
        interrupted run plays them from the start again.

        Args:
            planes: the planes.
            folder: folder of the run.
            seconds: wall time of each stage, s; that of the stages here is added.
            progress: receives the progress.

        Raises:
            Interrupted, InputError: the user stopped it; the disk is full.
        """
        linked = self.carrier is not None
        what = "the display" if self.screen or self.board else "the link"
        given = folder / (STREAM if planes.stored else SHOWN)
        stages, cycles = self.behind(self._stages(planes, given), folder)
        progress.start(what, cycles)
        with room_for(f"the planes of {what}", folder):
            spent = run_blocks(
                stages, cycles, progress=progress.advance, remedy=how_to_resume(folder),
                parallel=linked,
            )  # fmt: skip
        # The scene and the recording of the source have times of their own.
        seconds |= {f"{what[4:]}: {name}" if name in seconds else name: s
                    for name, s in spent.items()}  # fmt: skip
        return Played(stages, spent, given, self.shown(given))

    def _stages(self, planes: Planes, given: Path) -> dict[str, Any]:
        """The stages that make the planes and record them, by name."""
        stages: dict[str, Any] = {}
        if self.screen is not None and self.scene is not None:
            stages["scene"] = SceneStage(self.scene, (0, 0))
        stages["planes"] = planes.stage
        if not planes.stored:
            stages["planes to disk"] = Recorder(given, self.shape, self.cycles, self.clock)
        return stages

    def behind(self, stages: dict[str, Any], folder: Path) -> tuple[dict[str, Any], int]:
        """The whole chain: stages that make planes, then those of the link and the display; and its
        length, cycles."""
        if self.board is not None:
            stages = stages | {"sink": self.board}
        if self.screen is not None:
            stages = self.screen.stages(stages, folder)
        if self.carrier is not None:
            return self.carrier.join(stages, folder), self.carrier.cycles
        return stages, self.cycles

    def shown(self, given: Path) -> Path:
        """Recording of the planes that come to the display, of those that the source gives."""
        return given if self.carrier is None else given.with_name(RECEIVED)
