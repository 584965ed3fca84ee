"""The chain of an imager: it films frame by frame into the folder of the run and checks the plan.

The tape of the converted pixel values (`tape`) is the checkpoint.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from shutil import rmtree
from typing import Any

from cosim import Interrupted
from cosim.frames import Frame
from cosim.plan.error import Measured
from cosim.run.folder import how_to_resume, room_for
from cosim.run.inputs import add_digests
from cosim.run.progress import Progress
from cosim.run.result import viform_version
from imagers.common.model import FrameFigures, measure_frame
from imagers.run.check import DecisionCheck, Decisions, PlanPatches, watched_frames
from imagers.run.plan import PlannedRun
from imagers.run.tape import FRAMES, TAPE, FrameStore, Tape, Taped
from sensor.frame_pixels import Exposed, PixelModel


class _Clock:
    """Calls a function and adds up the time of the calls, s."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function, self.seconds = function, 0.0

    def __call__(self, *arguments: Any) -> Any:
        begin = time.perf_counter()
        try:
            return self._function(*arguments)
        finally:
            self.seconds += time.perf_counter() - begin


class _TimedScenery:
    """A scenery whose computing time is measured."""

    def __init__(self, scenery: Any) -> None:
        self.shape = scenery.shape
        self.lux_seconds = _Clock(scenery.lux_seconds)


class FrameChain:
    """See `cosim.run.machine.Chain`.

    Attributes:
        planned: the checked and planned run.
        frames: figures of every frame, in order, after the run.
        patches, decisions: the check of the plan; decisions is None if no frame affects a later
            exposure.
        registers: what a host reads in each register once a frame is ready, by name, one value for
            each frame; {} for an imager without registers.
        imager: the imager in its state after the run.

    Args:
        readable: names of the registers that a host can read.
    """

    def __init__(
        self, planned: PlannedRun, folder: Path, trace: Path | None = None,
        readable: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self.planned, self._folder, self._trace = planned, folder, trace
        self.registers: dict[str, list[int]] = {name: [] for name in readable}
        self._resume = False
        effects = list(planned.pixels.effects)
        out = [name for name in effects if name not in planned.kept]
        self.patches = PlanPatches(
            effects, out, planned.spec.seed, watched_frames(planned.exposures.frames)
        )
        self.frames: list[FrameFigures] = []
        self.decisions: DecisionCheck | None = None
        self.imager: Any = None

    @property
    def checkpoint(self) -> Path:
        return self._folder / TAPE

    @property
    def error(self) -> Measured | None:
        """The error of the plan: the larger of the error of the patches and the effect of a
        decision that full physics makes otherwise."""
        error, check = self.patches.planned(), self.decisions
        if error is None or check is None or check.differs_at is None:
            return error
        return replace(
            error, value=max(error.value, check.change), high=max(error.high, check.change)
        )

    def load(self, progress: Progress) -> bool:
        """Checks the tape. Raises InputError for that of another run."""
        Tape(self.checkpoint, self._identity(), True).close()
        self._resume = True
        return True

    def run(self, progress: Progress) -> dict[str, float]:
        """Films for the duration of the scenario. Returns the wall time of each stage, s. Raises
        Interrupted, InputError."""
        planned, spec = self.planned, self.planned.spec
        full = frozenset(planned.pixels.effects)
        tape = Tape(self.checkpoint, self._identity(), self._resume)
        scenery = _TimedScenery(planned.view.scenery)
        imager: Any = planned.model.make()
        self.imager = imager
        left_out = bool(full - planned.kept)
        decisions = Decisions(
            planned.model.judge(imager, full, planned.kept, spec.seed) if left_out else None,
            full, spec.seed,
        )  # fmt: skip
        judge = _Clock(decisions.frame)

        def converted(rows: Exposed, pixels: PixelModel) -> None:
            self.patches(rows, pixels)
            decisions.add(rows, pixels)

        watch = _Clock(converted)
        imager.pixels = Taped(imager.pixels, tape, watch)
        store = FrameStore(self._folder / FRAMES, planned.pixels.bits)
        rows, columns = planned.model.shape
        total = max(planned.exposures.frames, 1)
        progress.start(f"{spec.name}: about {total} frames of {columns} x {rows}", total)
        began = time.perf_counter()
        storing = 0.0
        try:
            with room_for("the frames", self._folder):
                for frame in self._film(scenery):
                    judge(frame)
                    begin = time.perf_counter()
                    store.append(frame)
                    self.frames.append(measure_frame(frame))
                    for name, values in self.registers.items():
                        values.append(imager.read(name))
                    storing += time.perf_counter() - begin
                    progress.advance(min(len(self.frames), total))
                store.finish(self.registers)
        except KeyboardInterrupt:
            tape.sync()
            raise Interrupted(
                len(self.frames), total, how_to_resume(self._folder), "frames"
            ) from None
        finally:
            tape.close()
        self.decisions = decisions.result()
        light, checked = scenery.lux_seconds.seconds, watch.seconds + judge.seconds
        return {
            "light": light,
            "imager": time.perf_counter() - began - light - checked - storing,
            "check": checked,
            "frames to disk": storing,
        }

    def _film(self, scenery: Any) -> Iterator[Frame]:
        spec, imager = self.planned.spec, self.imager
        frames: Iterator[Frame] = imager.film(
            scenery, spec.stop, seed=spec.seed, kept=self.planned.kept, trace=self._trace
        )
        return frames

    def _identity(self) -> str:
        """Text that depends on the scenario, the kept effects, and the version of the program."""
        kept = " ".join(sorted(self.planned.kept))
        return f"{viform_version()}\n{kept}\n{add_digests(self.planned.spec.toml)}"

    def save(self) -> None:
        """Nothing: the tape is complete when the run is."""

    def discard(self) -> None:
        """Removes the frames and the tape."""
        self.checkpoint.unlink(missing_ok=True)
        rmtree(self._folder / FRAMES, ignore_errors=True)
