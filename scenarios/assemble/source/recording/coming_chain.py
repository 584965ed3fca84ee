"""The chain of a stream that comes while the run goes on; its recording is always sound."""

from __future__ import annotations

import shlex
import time
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field
from typing import Final

from cosim import InputError, Interrupted
from cosim.compute.stopping import finishing
from cosim.config.amounts import count, number
from cosim.files import Recorder
from cosim.run.chain import STREAM, BlockChain
from cosim.run.progress import Progress
from scenarios.assemble.source.recording.coming import ComingPlanes

_TOLD_S: Final = 0.5
"""Least time between two texts of the progress, s."""
_LEAST_S: Final = 1e-9
"""Least time of a stage, s, by which speeds are divided."""


class _Received:
    """Progress of a stream: the planes that have come, and their rate. The share that is done, of a
    stream with a length, is that of the whole chain, which goes on for longer with a link.

    Args:
        progress: receives it.
        planes: the stream.
        what: beginning of the text.
    """

    def __init__(self, progress: Progress, planes: ComingPlanes, what: str) -> None:
        self._progress, self._planes, self._what = progress, planes, what
        self._told: float | None = None

    def start(self, what: str, total: int) -> None:
        self._progress.start(self.text(), total if self._planes.cycles else 0)

    def text(self) -> str:
        planes, rate = self._planes, self._planes.rate
        speed = "" if rate is None else f" at {number(rate)} planes/s"
        late = f", {count(planes.lateness.late)} late" if planes.lateness.late else ""
        came = "1 plane" if planes.came == 1 else f"{count(planes.came)} planes"
        return f"{self._what}: {came} received{speed}{late}"

    def advance(self, done: int) -> None:
        now = time.monotonic()
        if self._told is None or now - self._told >= _TOLD_S:
            self._told = now
            self._progress.tell(self.text())
        self._progress.advance(done if self._planes.cycles else self._planes.came)

    def tell(self, what: str) -> None:
        self._progress.tell(what)

    def note(self, text: str) -> None:
        self._progress.note(text)


@dataclass
class ComingChain(BlockChain):
    """Records a stream, and sends and shows it if its length is known, as it comes.

    The chain ends early if the stream does. Then, and when it is interrupted, the recording holds
    all whole planes that have come.

    Attributes:
        planes: the first stage, as it is without a link.
        recorder: recorder of the stream.
        again: whether the source can be read again, so that an interrupted run can go on.
    """

    planes: ComingPlanes = field(kw_only=True)
    recorder: Recorder = field(kw_only=True)
    again: bool = field(kw_only=True)

    def run(self, progress: Progress) -> dict[str, float]:
        """See `Chain`."""
        self.planes.start()
        begin = self.planes.came - self.planes.waiting
        try:
            # A pipe cannot be read again: only a second signal cuts off its recording.
            with nullcontext() if self.again else finishing():
                spent = super().run(_Received(progress, self.planes, self.title))
        except Interrupted as exc:
            kept = self._end()
            done, total, unit = kept, self.planes.cycles or 0, "planes"
            if kept == total and exc.done < exc.total:  # all came, but the link has not sent all
                done, total, unit = exc.done, exc.total, "cycles"
            raise Interrupted(done, total, self._how_to_go_on(exc.remedy), unit) from None
        except InputError:  # of the source, or a full disk, on which not even this may be possible
            with suppress(OSError), finishing():
                if kept := max(begin, self.recorder.stop):
                    self.recorder.end(kept)
            raise
        if self.planes.came != self.planes.cycles:
            self._end()
        # A run that goes on may have left nothing to do to a stage, whose speed is not told then.
        return {name: max(seconds, _LEAST_S) for name, seconds in spent.items()}

    def _how_to_go_on(self, resume: str) -> str:
        if self.again:
            return resume
        store = shlex.quote(str(self.folder / STREAM))
        return f"what came is {store}: viform run playback --set sensor.source=file:{store}"

    @finishing()
    def _end(self) -> int:
        """Writes the planes that fill no block, and ends the recording; returns its cycles."""
        planes = self.planes
        if planes.waiting:
            self.recorder.step(*planes.rest())
        self.recorder.end(planes.came)
        return planes.came
