"""A chain of stages that runs block by block into a run's folder, with a checkpoint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from shutil import rmtree
from typing import Any, Final

from cosim.run.folder import how_to_resume, room_for
from cosim.run.loop import (
    Checkpoint,
    Gate,
    LostRecording,
    discard_checkpoints,
    open_gate,
    run_blocks,
)
from cosim.run.progress import Progress

CHECKPOINT: Final = "checkpoint.npz"
"""File in the folder of a run that is not finished."""
STREAM: Final = "stream.zarr"
"""Recording of spikes in the folder of a run."""


@dataclass
class BlockChain:
    """The stages of a machine with a clock.

    Attributes:
        title: text of the progress bar.
        stages: stages by name, from source to sink.
        cycles: length of the run.
        identity: text that depends on all inputs of the run. A checkpoint with another identity is
            refused.
        folder: folder of the run.
        every_s: wall time between checkpoints, s.
        recording: file or folder that the sink writes, within the folder of the run.
        parallel: whether the stages work at the same time; the recording is the same.
        begin: first cycle of `run`; after `load`, that of the checkpoint.
        gate: see `run_blocks`.
    """

    title: str
    stages: Mapping[str, Any]
    cycles: int
    identity: str
    folder: Path
    every_s: float = 30.0
    recording: str = STREAM
    parallel: bool = True
    begin: int = 0
    gate: Gate = open_gate

    @property
    def checkpoint(self) -> Path:
        """File of the checkpoint."""
        return self.folder / CHECKPOINT

    def load(self, progress: Progress) -> bool:
        """See `Chain`. Without a part of its recording a checkpoint is worth nothing."""
        checkpoint, begun = Checkpoint(self.checkpoint, self.identity), False

        def checked(done: int, total: int) -> None:
            nonlocal begun
            if not begun:
                progress.start("check of the recording", total)
                begun = True
            progress.advance(done)

        try:
            self.begin = checkpoint.load(self.stages, self.cycles, checked, progress.note)
        except LostRecording as lost:
            progress.note(f"{lost}; the run begins again at its first cycle")
            BlockChain.discard(self)  # what else a run has made, such as bands, is sound
            return False
        return True

    def run(self, progress: Progress) -> dict[str, float]:
        """Runs to the end; returns the wall time of each stage, s."""
        progress.start(self.title, self.cycles)
        with room_for("the stream", self.folder):
            return run_blocks(
                self.stages, self.cycles, checkpoint=Checkpoint(self.checkpoint, self.identity),
                begin=self.begin, progress=progress.advance, every_s=self.every_s,
                remedy=how_to_resume(self.folder), parallel=self.parallel, gate=self.gate,
            )  # fmt: skip

    def save(self) -> None:
        """Writes a checkpoint at the end of the run."""
        Checkpoint(self.checkpoint, self.identity).save(self.cycles, self.stages)

    def discard(self) -> None:
        """Removes the recording and the checkpoints."""
        discard_checkpoints(self.checkpoint)
        place = self.folder / self.recording
        if place.is_dir():
            rmtree(place, ignore_errors=True)
        else:
            place.unlink(missing_ok=True)
