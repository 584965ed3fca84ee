"""A chain of stages that runs block by block into a run's folder, with a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from typing import Any, Final

from cosim.errors import InputError
from cosim.run.folder import how_to_resume, room_for
from cosim.run.loop import Checkpoint, run_blocks
from cosim.run.progress import Progress

__all__ = ["CHECKPOINT", "STREAM", "BlockChain"]

CHECKPOINT: Final = "checkpoint.npz"
"""In a run's folder while it is not finished."""
STREAM: Final = "stream.zarr"
"""The recording of spikes in a run's folder."""


@dataclass
class BlockChain:
    """The stages of a machine with a clock.

    Attributes:
        title: what runs, for the progress bar.
        stages: by name, from source to sink.
        cycles: of the run.
        identity: text that depends on all inputs of the run; a checkpoint of another is refused.
        folder: of the run.
        every_s: wall time between checkpoints, s.
        recording: name of what the sink writes into the folder.
    """

    title: str
    stages: Mapping[str, Any]
    cycles: int
    identity: str
    folder: Path
    every_s: float = 30.0
    recording: str = STREAM
    begin: int = 0

    @property
    def checkpoint(self) -> Path:
        return self.folder / CHECKPOINT

    def load(self) -> None:
        """Restores the stages. Raises InputError for a checkpoint of another run, or one without
        its recording."""
        self.begin = Checkpoint(self.checkpoint, self.identity).load(self.stages)
        if self.begin and not (self.folder / self.recording).exists():
            raise InputError(
                "--resume", f"given with the run's {self.recording}", "without", "leave it out"
            )

    def run(self, progress: Progress) -> dict[str, float]:
        """Runs to the end; the wall time of each stage, s."""
        progress.start(self.title, self.cycles)
        with room_for("the stream", self.folder):
            return run_blocks(
                self.stages, self.cycles, checkpoint=Checkpoint(self.checkpoint, self.identity),
                begin=self.begin, progress=progress.advance, every_s=self.every_s,
                remedy=how_to_resume(self.folder),
            )  # fmt: skip

    def save(self) -> None:
        """Writes the checkpoint of the end."""
        Checkpoint(self.checkpoint, self.identity).save(self.cycles, self.stages)

    def discard(self) -> None:
        """Removes the recording and the checkpoint."""
        self.checkpoint.unlink(missing_ok=True)
        place = self.folder / self.recording
        if place.is_dir():
            rmtree(place, ignore_errors=True)
        else:
            place.unlink(missing_ok=True)
