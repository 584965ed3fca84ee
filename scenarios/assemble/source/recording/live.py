"""A live stream, read while the run goes on: its planes, how late they are, and its chain.

`wait` and `step` of the planes are called in two threads of a chain. `wait` holds the chain back
until the planes of a block are there, so that no stage ever waits within a block: an interrupted
run ends between two blocks. It takes no more bytes than the block has, so that a faster pipe is
held back in turn. The recording is always sound.

Plane n of a stream has the time t0 + edge(n) of its clock, where t0 is the instant at which the
first plane was there. A plane is *late* if its processing begins after its own time plus a bound.
So a chain that is slower than the camera is seen, and so is a camera that is slower than its clock;
how far the delay had grown tells by how much.
"""

from __future__ import annotations

import shlex
import threading
import time
from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from cosim import Block, Clock, InputError, Interrupted, Viform
from cosim.compute.stopping import finishing
from cosim.config.amounts import count, number
from cosim.files import Recorder
from cosim.files.dat import pixels_of
from cosim.files.plane_order import PlaneOrder
from cosim.run.chain import STREAM, BlockChain
from cosim.run.progress import Progress
from cosim.spikes.viform import pack_planes
from cosim.stage import State, section
from scenarios.assemble.source.recording.origin import Origin

_LOOK_S: Final = 0.1
"""Time after which a waiting chain looks whether the user has asked to stop, s."""
_PATIENCE: Final = 10
"""Looks after which the user is told that the first plane is waited for."""
_NS: Final = 1000
"""Picoseconds in a nanosecond."""
_TOLD_S: Final = 0.5
"""Least time between two texts of the progress, s."""
_LEAST_S: Final = 1e-9
"""Least time of a stage, s, by which speeds are divided."""


class LivePlanes:
    """The stage that takes the planes of a source; its `wait` is the gate of the chain.

    Args:
        origin: source of the bytes.
        stored: (width, height) of a plane as it is stored; 416 x 250 means 400 x 250 with head.
        order: order of bits, bytes and rows.
        clock: clock of the planes.
        cycles: number of planes that are wanted; None for all that come.
        bound: delay up to which a plane is in time, ps.
        now: a clock, ns.

    Attributes:
        shape: (height, width) in pixels.
        came: whole planes that have come so far.
        lateness: count of late planes.
        incomplete: bytes of a last plane that is not whole; 0 until the end.
        end: why nothing more comes, in words; "" until then.
    """

    def __init__(
        self, origin: Origin, stored: tuple[int, int], order: PlaneOrder, clock: Clock,
        cycles: int | None, bound: int, now: Callable[[], int] = time.monotonic_ns,
    ) -> None:  # fmt: skip
        self._origin, self._order, self.clock = origin, order, clock
        self._stored = stored[::-1]
        self.shape = pixels_of(stored)[::-1]
        self.frame = stored[0] * stored[1] // 8
        self.cycles, self._now = cycles, now
        self._held, self._taken = bytearray(), 0  # bytes that no block has taken, planes taken
        self._lock = threading.Lock()
        self._begin: tuple[int, int] | None = None  # planes that had come, and when, ns
        self._last = self._begun = 0  # when the last plane was there, and a block begun, ns
        self.lateness = Lateness(clock, bound)
        self.came = self.incomplete = 0
        self.end = ""

    @property
    def rate(self) -> float | None:
        """Planes a second since the first ones were there; None as long as no others have come."""
        if self._begin is None or self._last == self._begin[1]:
            return None
        return (self.came - self._begin[0]) * 1e9 / (self._last - self._begin[1])

    def start(self) -> None:
        """Starts the clock of the stream, if its first plane is there: what has come before waits
        for nothing but the chain. Otherwise it starts with that plane."""
        if self.waiting:
            self._mark(self.came)

    def first(self, waiting: Callable[[], None]) -> None:
        """Waits for the first plane, before anything is written. Raises InputError if the source
        ends before it. waiting: called once if that takes longer than `_PATIENCE` looks."""
        looks = 0
        while len(self._held) < self.frame:
            data = self._origin.fetch(self.frame - len(self._held), _LOOK_S)
            self._held += data
            if not data and self._origin.end:
                raise InputError(
                    "sensor.source", f"a stream of at least one plane, of {self.frame} bytes",
                    f"one of {len(self._held)} bytes: {self._origin.end}",
                    "start its writer, or check sensor.width and sensor.height",
                )  # fmt: skip
            looks += 1
            if looks == _PATIENCE:
                waiting()
        self.came = 1

    def wait(self, stop: int, stopping: Callable[[], bool] = lambda: False) -> bool:
        """Waits until the planes before cycle `stop` are there.

        Returns:
            True if they are; False if the source has ended before, or `stopping` says so.

        Raises:
            InputError: see `Origin`.
        """
        while self.came < stop:
            with self._lock:
                missing = (stop - self._taken) * self.frame - len(self._held)
            data = self._origin.fetch(missing, _LOOK_S)
            with self._lock:
                self._held += data
                came = self._taken + len(self._held) // self.frame
            if came > self.came:
                self._mark(came)
            if came < stop and ((not data and self._origin.end) or stopping()):
                self._close()
                return False
        if self.cycles is not None and self.came >= self.cycles:
            self.end = "the planes asked for are there"
        return True

    def _mark(self, came: int) -> None:
        """Notes the time at which more planes were there."""
        now = self._now()
        if self._begin is None:
            self._begin = came, now
            self.lateness.came(self._taken, now)
        self.came, self._last = came, now

    def _close(self) -> None:
        if self._origin.end:
            self.end = self._origin.end
            self.incomplete = len(self._held) % self.frame

    @property
    def waiting(self) -> int:
        """Whole planes that have come and that no block has taken."""
        return self.came - self._taken

    def step(self, data: Any, block: Block) -> Viform:
        """The planes of a block, which `wait` has found; `data` is not used."""
        return self._take(block, self._now())

    def rest(self) -> tuple[Viform, Block]:
        """The planes that fill no block, after the end. They were held back until nothing more
        came, which makes none of them late: their processing could have begun with the last of
        them."""
        block = Block(self._taken, self.waiting)
        return self._take(block, max(self._last, self._begun)), block

    def _take(self, block: Block, at: int) -> Viform:
        """The planes of a block. at: when its processing began, ns."""
        self.lateness.begun(block.start, block.stop, at)
        self._begun = at
        size = block.cycles * self.frame
        with self._lock:
            frames = np.frombuffer(bytes(self._held[:size]), np.uint8)
            del self._held[:size]
            self._taken = block.stop
        planes = self._order.planes(
            frames.reshape(block.cycles, self.frame), self._stored, self.shape[1]
        )
        return Viform(pack_planes(planes), block.cycles, self.clock, block.start)

    def state(self) -> State:
        """What a run that goes on needs: the source is read again from the first plane that no
        block has taken."""
        parts = {f"late/{name}": value for name, value in self.lateness.state().items()}
        done = self.came if self.end and not self.waiting else -1
        sample = np.frombuffer(self._origin.sample(self._taken * self.frame), np.uint8)
        planes = np.array([self._taken, done, self.incomplete])
        return {"planes": planes, "sample": sample, **parts}

    def restore(self, state: State) -> None:
        """Goes on from a `state`. Raises InputError if the source cannot be read again, or has
        other bytes than those that were read."""
        self.lateness.restore(section(state, "late"))
        self._taken, done, incomplete = (int(n) for n in state["planes"])
        self._held.clear()
        self._origin.skip(self._taken * self.frame)
        sample = state["sample"].tobytes()
        if self._origin.sample(self._taken * self.frame) != sample:
            raise InputError(
                "--resume", "given with the file that was read",
                f"with {self._origin.name}, which was written anew since",
                "start again with another --out",
            )  # fmt: skip
        self.came = self._taken
        if done >= 0:
            self.came, self.incomplete = done, incomplete
            self.end = "an earlier start of this run had read it to its end"

    def close(self) -> None:
        self._origin.close()


class Lateness:
    """Counts the late planes of a stream.

    Args:
        clock: clock of the planes.
        bound: delay up to which a plane is in time, ps.

    Attributes:
        late: number of late planes so far.
        worst: largest delay of a plane so far, ps; negative if all were early. None before the
            first plane.
    """

    def __init__(self, clock: Clock, bound: int) -> None:
        self._clock, self._bound = clock, bound
        self._begin: tuple[int, int] | None = None
        self.late = 0
        self.worst: int | None = None

    def came(self, plane: int, at_ns: int) -> None:
        """Sets the clock by the first plane of this process, which was there at `at_ns`. Later
        calls change nothing."""
        if self._begin is None:
            self._begin = plane, at_ns

    def begun(self, start: int, stop: int, at_ns: int) -> None:
        """Counts planes `start` to `stop` (excluded), whose processing began at `at_ns`."""
        assert self._begin is not None
        first, begin = self._begin
        elapsed = (at_ns - begin) * _NS
        delay = elapsed - self._clock.edge(start - first)
        self.worst = delay if self.worst is None else max(self.worst, delay)
        # Plane n is late if edge(n - first) < elapsed - bound.
        before = first + self._clock.cycle_at(elapsed - self._bound - 1) + 1
        self.late += min(max(before - start, 0), stop - start)

    def state(self) -> State:
        """What a run that goes on needs; its clock begins with its own first plane."""
        worst = [] if self.worst is None else [self.worst]
        return {"late": np.array([self.late]), "worst": np.array(worst, np.int64)}

    def restore(self, state: State) -> None:
        self.late = int(state["late"][0])
        self.worst = int(state["worst"][0]) if state["worst"].size else None


class _Received:
    """Progress of a stream: the planes that have come, and their rate. The share that is done, of a
    stream with a length, is that of the whole chain, which goes on for longer with a link.

    Args:
        progress: receives it.
        planes: the stream.
        what: beginning of the text.
    """

    def __init__(self, progress: Progress, planes: LivePlanes, what: str) -> None:
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
class LiveChain(BlockChain):
    """Records a live stream, and sends and shows it meanwhile if its length is known.

    The chain ends early if the stream does. Then, and when it is interrupted, the recording holds
    all whole planes that have come.

    Attributes:
        planes: the first stage, as it is without a link.
        recorder: recorder of the stream.
        again: whether the source can be read again, so that an interrupted run can go on.
    """

    planes: LivePlanes = field(kw_only=True)
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
