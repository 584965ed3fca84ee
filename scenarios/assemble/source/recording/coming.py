"""The planes of a stream that comes while the run goes on: waited for, taken, and counted.

`wait` and `step` are called in two threads of a chain. `wait` holds the chain back until the planes
of a block are there, so that no stage ever waits within a block: an interrupted run ends between
two blocks. It takes no more bytes than the block has, so that a faster pipe is held back in turn.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from cosim import Block, Clock, InputError, Viform
from cosim.files.dat import pixels_of
from cosim.files.plane_order import PlaneOrder
from cosim.spikes.viform import pack_planes
from cosim.stage import State, section
from scenarios.assemble.source.recording.lateness import Lateness
from scenarios.assemble.source.recording.origin import Origin

_LOOK_S: Final = 0.1
"""Time after which a waiting chain looks whether the user has asked to stop, s."""
_PATIENCE: Final = 10
"""Looks after which the user is told that the first plane is waited for."""


class ComingPlanes:
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
