"""The fast tier on an OpenCL device: what does not change in one launch, what does in a few.

A work-item is a group of sixteen neighbours. Outside the boxes in which the light of a call changes
one launch runs the whole call; inside, a launch reads up to sixteen planes where they lie in memory
and makes each cycle's light from them. Each set of flags has kernels of its own.
"""

from __future__ import annotations

from importlib.resources import files
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.compute.opencl import Device
from cosim.compute.philox import philox_cl
from cosim.compute.streams import Stream
from cosim.light.light import Box, Light, Piece, Plane
from cosim.spikes.viform import words_for
from sensor.device.pattern import FixedPattern
from sensor.latched.fast.course import MOST_PLANES, Course, Segment
from sensor.latched.fast.ground import LANES, Ground
from sensor.latched.fast.units import CAP, DEAD_TIME, EMPTY, NOISE, RESET
from sensor.latched.pixel.model import ExactModel
from sensor.latched.pixel.transfer import light_source

__all__ = ["FastPixels"]

_LOCAL: Final = 8
"""Work-items that share a core at a time. PoCL keeps the private arrays of all of them, so that few
stay in its cache, and thousands overrun its stack."""
_ENTRY: Final = 5 + MOST_PLANES
"""Integers that describe a segment to a kernel."""


def _looked_at(piece: Piece, plane: Plane) -> None:
    """Raises ValueError for light below 0, or none, where the piece may have changed it."""
    y0, y1, x0, x1 = piece.changed or (0, plane.shape[0], 0, plane.shape[1])
    rows = plane[y0:y1]  # whole rows lie in one piece, and are looked through faster
    part = rows[:, x0:x1]
    if part.size and not rows.min() >= 0 and not part.min() >= 0:
        raise ValueError(f"light must be 0 or more, not {float(part.min()):g}")


class FastPixels:
    """Pixels of one plane, exposed to light.

    model: of any reset rule. shape: (H, W). numbers: of the pixels, (H W,)
    uint32. gain: photoelectrons a second for a unit of light. pattern: of these pixels. offsets:
    (H,) int64 ps from a clock edge to the instant at which each row is sampled. flags: (H,
    ceil(W / 16)) uint8, what is kept for each group of sixteen columns: 1 noise, 2 dead time; all
    that the model has unless given.

    Results depend neither on how a run is split into calls nor on where rows and groups sit; they
    are those of `NumpyFast` (tests/sensor/latched/fast/numpy_fast.py) to the last bit.
    """

    def __init__(
        self,
        model: ExactModel,
        shape: tuple[int, int],
        numbers: npt.NDArray[np.uint32],
        device: Device,
        clock: Clock,
        gain: float,
        pattern: FixedPattern | None = None,
        offsets: npt.NDArray[np.int64] | None = None,
        flags: npt.NDArray[np.uint8] | None = None,
    ) -> None:
        self._ground = ground = Ground(model, shape, numbers, clock, gain, pattern, offsets, flags)
        self._device = device
        self._numbers = device.upload(ground.padded(numbers))
        self._table = device.upload(ground.units.table)
        self._flags = device.upload(ground.kept)
        flat = ground.kept.ravel()
        lists = {int(f): _filled(np.flatnonzero(flat == f)) for f in np.unique(flat)}
        self._lists = {f: (device.upload(groups), groups.size) for f, groups in lists.items()}
        self._gains: tuple[Any, ...] = (np.float32(ground.scale),)
        if ground.gains is not None:
            self._gains = tuple(device.upload(plane) for plane in ground.gains)
        self._kernels = {f: self._build(f) for f in lists}
        self._planes: dict[int, tuple[Plane, Any]] = {}
        self._put(*ground.first())

    def _build(self, flags: int) -> tuple[Any, Any]:
        """Kernels of a set of flags: for steady light and for light that moves."""

        def text(name: str) -> str:
            return (files("sensor.latched.fast") / name).read_text()

        source, model = text("light.cl"), self._ground.model
        defines = ["-cl-std=CL1.2", f"-DFLAGS={flags}", f"-DCAP={CAP}", f"-DEMPTY=({EMPTY})"]
        if self._ground.gains is not None:
            defines.append("-DPATTERN")
        if model.transfers:
            source = light_source(model.transfers, self._ground.ratio) + source
            defines.append("-DTRANSFER")
        if flags & NOISE:
            source += philox_cl() + text("draws.cl")
            defines += ["-DNOISE", f"-DSTREAM={int(Stream.SHOT_NOISE)}u"]
        if flags & DEAD_TIME:
            defines.append("-DDEAD_TIME")
        if flags & RESET:
            defines += [f"-DRESET_{self._ground.model.reset.upper()}"]
            if self._ground.model.reset == "subtract":
                defines += [f"-DDEEPEST=({self._ground.deepest})"]
        source += text("deficit.cl" if flags else "phase.cl")
        made = (self._device.kernel(source, name, tuple(defines)) for name in ("steady", "moving"))
        return next(made), next(made)

    def _put(self, charge: npt.NDArray[np.int32], spikes: npt.NDArray[np.uint64]) -> None:
        self._charge = self._device.upload(charge)
        self._low = self._device.upload(spikes.astype(np.uint32))
        self._high = self._device.upload((spikes >> np.uint64(32)).astype(np.uint32))

    def _take(self) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.uint64]]:
        height, groups = self._ground.groups
        shape, device = (height, groups * LANES), self._device
        low = device.download(self._low, np.empty(shape, np.uint32))
        high = device.download(self._high, np.empty(shape, np.uint32))
        charge = device.download(self._charge, np.empty(shape, np.int32))
        return charge, low.astype(np.uint64) | (high.astype(np.uint64) << np.uint64(32))

    def _state(self, flags: int) -> tuple[Any, ...]:
        """Arguments of a kernel that are the pixels' own."""
        if not flags:
            return (self._charge,)
        ground, units = self._ground, self._ground.units
        return (
            self._charge, self._low, self._high, self._numbers, self._table,
            np.uint32(ground.model.seed), ground.dead, np.int32(units.one),
            np.int32(units.top if flags & NOISE else units.one),
        )  # fmt: skip

    def _look(self, course: Course) -> None:
        """Shares the call's planes with the device, each looked at once; forgets the others."""
        kept: dict[int, tuple[Plane, Any]] = {}
        for piece in course.pieces:
            for plane in (piece.first, piece.last):
                known = self._planes.get(id(plane)) or kept.get(id(plane))
                if known is None:
                    if self._planes or kept:
                        _looked_at(piece, plane)
                    else:
                        _looked_at(Piece(0, 1, plane, plane), plane)
                    shared = np.ascontiguousarray(plane, np.float32)
                    known = (plane, self._device.share(shared))
                kept[id(plane)] = known
        for segment in course.segments:  # those that were made for one cycle
            if id(segment.base) not in kept:
                kept[id(segment.base)] = (segment.base, self._device.share(segment.base))
        self._planes = kept

    def _steady(self, course: Course, cycles: int, words: Any) -> None:
        height, groups = self._ground.groups
        y0, y1, g0, g1 = _groups(course.box)
        _, plane = self._planes[id(course.steady)]
        for flags, (groups_of, n) in self._lists.items():
            if (y1 - y0) * (g1 - g0) == height * groups:
                return
            self._kernels[flags][0](
                self._device.queue, (n,), (_LOCAL,), *self._state(flags),
                plane, words, np.uint32(height * self._ground.shape[1]),
                np.uint32(self._ground.shape[1]), np.uint32(groups), self._ground.brightest,
                groups_of, *(np.uint32(edge) for edge in (y0, y1, g0, g1)), np.uint32(cycles),
                *self._gains,
            )  # fmt: skip

    def _moving(self, segments: list[Segment], box: Box, words: Any) -> None:
        """One launch, of segments that share sixteen planes."""
        slots: dict[int, int] = {}
        entries = np.zeros((len(segments), _ENTRY), np.int32)
        begin = 1  # one weight stands for none
        for entry, segment in zip(entries, segments, strict=True):
            used = [slots.setdefault(id(p), len(slots)) for p in (segment.base, *segment.planes)]
            at = begin if segment.planes else 0
            entry[:5] = segment.first, segment.cycles, at, used[0], len(segment.planes)
            entry[5 : 5 + len(segment.planes)] = used[1:]
            begin += segment.weights.size
        weights = np.concatenate([np.zeros(1, np.float32), *(s.weights.ravel() for s in segments)])
        rows = max(s.weights.shape[1] for s in segments)
        planes = [self._planes[key][1] for key in slots]
        planes += planes[:1] * (MOST_PLANES - len(planes))
        y0, y1, g0, g1 = _groups(box)
        (height, width), device = self._ground.shape, self._device
        shared = device.upload(entries), device.upload(weights)
        wide = -(-(g1 - g0) // _LOCAL) * _LOCAL
        for flags in self._lists:
            self._kernels[flags][1](
                device.queue, (wide, y1 - y0), (_LOCAL, 1), *self._state(flags),
                self._flags, shared[0], np.uint32(len(segments)), shared[1], np.uint32(rows),
                words, np.uint32(height * width), np.uint32(width),
                np.uint32(self._ground.groups[1]), self._ground.brightest,
                np.uint32(y0), np.uint32(g0), np.uint32(g1), np.uint32(len(slots)),
                *self._gains, *planes,
            )  # fmt: skip

    def _launches(self, segments: list[Segment]) -> list[list[Segment]]:
        """Segments in runs that each need no more planes than a launch can have."""
        runs: list[list[Segment]] = []
        met: set[int] = set()
        for segment in segments:
            needs = {id(p) for p in (segment.base, *segment.planes)}
            if not runs or len(met | needs) > MOST_PLANES:
                runs.append([])
                met = set()
            met |= needs
            runs[-1].append(segment)
        return runs

    def expose(self, light: Light, start: int, cycles: int) -> npt.NDArray[np.uint32]:
        """Words (ceil(cycles / 32), H W) of cycles `start` to `start + cycles` of the clock, bit b
        of word w being cycle start + 32 w + b.

        Raises ValueError for light of another shape, below 0, or that does not cover the cycles.
        """
        ground = self._ground
        course = ground.course(light, start, cycles)
        self._look(course)
        out = np.empty((words_for(cycles), ground.shape[0] * ground.shape[1]), np.uint32)
        words = self._device.share(out, write=True)
        self._steady(course, cycles, words)
        if course.box is not None:
            for run in self._launches(course.segments):
                self._moving(run, course.box, words)
        self._device.settle(words, out)
        return out

    def fraction(self) -> npt.NDArray[np.float64]:
        """Stored charge over the running interval's own threshold, now, (H W,)."""
        return self._ground.fraction(*self._take())

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """charge: phase of 2^32 or deficit, (H W,) int32. spikes: index of the interval that is
        running, (H W,) uint64; 0 where no thresholds are drawn."""
        charge, spikes = self._take()
        trim = self._ground.trimmed
        return {"charge": trim(charge).copy(), "spikes": trim(spikes).copy()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Goes on from a `state`."""
        pad = self._ground.padded
        self._put(
            pad(np.asarray(state["charge"], np.int32)), pad(np.asarray(state["spikes"], np.uint64))
        )


def _filled(groups: npt.NDArray[np.intp]) -> npt.NDArray[np.uint32]:
    """Numbers of groups, filled up to whole work-groups with one that there is not."""
    rest = -groups.size % _LOCAL
    return np.append(groups.astype(np.uint32), np.full(rest, 0xFFFFFFFF, np.uint32))


def _groups(box: Box | None) -> tuple[int, int, int, int]:
    """Rows and groups that a box touches."""
    if box is None:
        return 0, 0, 0, 0
    y0, y1, x0, x1 = box
    return y0, y1, x0 // LANES, -(-x1 // LANES)
