"""The fast tier on an OpenCL device.

A work-item simulates a group of sixteen neighbours, or four groups that draw from the bank. Outside
the box in which the light of a call changes, one launch runs the whole call. Inside it, a launch
reads up to sixteen planes in place and computes the light of each cycle from them. Each set of
flags has its own kernels.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from itertools import chain
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device, wide_cl
from cosim.compute.outputs import Outputs
from cosim.compute.philox import philox_cl
from cosim.compute.streams import Stream
from cosim.light.light import Box, Light, Plane, Scaled
from cosim.spikes.viform import WORD, words_for
from sensor.latched.fast.array import LANES, PixelArray
from sensor.latched.fast.course import MOST_PLANES
from sensor.latched.fast.runs import Launches, Run
from sensor.latched.fast.taking_over import taken_over
from sensor.latched.fast.units import (
    BANK,
    CAP,
    DEAD_TIME,
    EMPTY,
    JITTER,
    NOISE,
    NOTHING,
    RESET,
    TIMING,
)
from sensor.latched.pixel.bank import GENERATOR, PERIOD, STEPS, group_keys
from sensor.latched.pixel.charge import light_source
from sensor.latched.sampling import KNOT, LIMIT

_LOCAL: Final = 8
"""Work-items that share a core of a processor. PoCL allocates the private arrays of all of them at
once: those of a few fit in the cache, those of thousands overflow the stack."""
_TOGETHER: Final = 4
"""Groups that a work-item steps together if it does so cycle by cycle, to hide the latency of each.
On a GPU it is one: there, other work-items hide it, and the state of four fills the registers."""


_FLOAT16: Final = np.dtype("V64")
"""Sixteen float32 as one argument of a kernel."""

_OWN: Final = TIMING | JITTER
"""Flags of the groups with a course of their own; see `PixelArray.own_course`."""
_CONSTANT: Final = (
    "_firsts", "_numbers", "_table", "_flags", "_together", "_lists", "_gains", "_bank", "_moves",
    "_kernels",
)  # fmt: skip
"""Attributes of pixels that do not depend on the seed."""


class FastPixels:
    """Pixels of one plane, exposed to light.

    Results do not depend on how a run is split into calls, nor on how a plane is split into tiles.
    They agree with `NumpyFast` (tests/sensor/latched/fast/numpy_fast.py) bit for bit.

    Args:
        array: the pixels.
        device: OpenCL device.
        like: pixels of which `array` is `PixelArray.seeded`, whose constants are shared; None for
            none.
    """

    def __init__(self, array: PixelArray, device: Device, like: FastPixels | None = None) -> None:
        self.array = array
        self._device = device
        self._outputs = Outputs(np.uint32, device.memory)
        self._given = np.empty((0, 0), np.uint32)
        self._planes: dict[int, tuple[Plane, Any]] = {}
        self._fault = device.upload(np.zeros(1, np.int32))
        if like is None:
            self._set_up(array, device)
        else:
            for name in _CONSTANT:
                setattr(self, name, getattr(like, name))
        if array.banked:
            self._keys = device.upload(group_keys(self._firsts, array.model.seed))
        self._upload(*array.initial_state())

    def _set_up(self, array: PixelArray, device: Device) -> None:
        """Makes what does not depend on the seed: _CONSTANT."""
        numbers = array.padded(array.numbers)
        self._firsts = np.ascontiguousarray(numbers[:, ::LANES])
        self._numbers = device.upload(numbers)
        self._table = device.upload(array.units.table)
        self._flags = device.upload(array.group_flags)
        flat = array.group_flags.ravel()
        self._together = 1 if device.gpu else _TOGETHER
        lists = {int(f): self._filled(np.flatnonzero(flat == f), int(f)) for f in np.unique(flat)}
        self._lists = {f: (device.upload(groups), groups.size) for f, groups in lists.items()}
        self._gains: tuple[Any, ...] = (np.float32(array.scale),)
        if array.gains is not None:
            self._gains = tuple(device.upload(plane) for plane in array.gains)
        self._bank: tuple[Any, ...] = ()
        if array.banked:
            self._bank = tuple(device.upload(values) for values in (array.bank.values, STEPS))
        self._moves: tuple[Any, ...] = ()
        if array.timing is not None:
            factors = np.zeros((array.shape[0], array.timing.factors.shape[1]), np.float32)
            factors[array.timing.first : array.timing.stop] = array.timing.factors
            self._moves = self._numbers, device.upload(factors)
        self._kernels = {f: self._build(f) for f in lists}

    def _build(self, flags: int) -> tuple[Any, Any]:
        """Kernels for a set of flags: for constant light, and for changing light."""

        def text(name: str) -> str:
            return (files("sensor.latched.fast") / name).read_text(encoding="utf-8")

        source, model = wide_cl() + text("light.cl"), self.array.model
        defines = [
            "-cl-std=CL1.2",
            f"-DFLAGS={flags}",
            f"-DTIMING_FLAG={TIMING}",
            f"-DJITTER_FLAG={JITTER}",
            f"-DCAP={CAP}",
            f"-DEMPTY=({EMPTY})",
            f"-DNOTHING=({NOTHING}f)",
            f"-DGROUPS={self._together}",
        ]
        if not self._device.gpu:
            defines.append("-DIN_TURN")
        if self.array.gains is not None:
            defines.append("-DPATTERN")
        if model.transfers:
            source = light_source(model.transfers, self.array.ratio) + source
            defines.append("-DTRANSFER")
        if flags & (BANK | JITTER):
            defines += [f"-D{name}={value}u" for name, value in GENERATOR.items()]
        if flags & JITTER:
            defines += [f"-DKNOT={KNOT}u", f"-DMOVE_LIMIT=({float(np.float32(LIMIT)).hex()}f)"]
        if flags & NOISE and not flags & BANK:
            source += philox_cl() + text("draws.cl")
            defines += ["-DNOISE", f"-DSTREAM={int(Stream.SHOT_NOISE)}u"]
        if flags & DEAD_TIME:
            defines.append("-DDEAD_TIME")
        if flags & RESET:
            defines += [f"-DRESET_{self.array.model.reset.upper()}"]
            if self.array.model.reset == "subtract":
                defines += [f"-DDEEPEST=({self.array.deepest})"]
        if flags:
            source += text("charge.cl") + text("moves.cl")
            source += text("bank.cl" if flags & BANK else "deficit.cl")
        else:
            source += text("phase.cl")
        moving = self._device.kernel(source, "moving", tuple(defines))
        if flags & JITTER:
            return None, moving
        return self._device.kernel(source, "steady", tuple(defines)), moving

    def constants(self) -> FastPixels:
        """These pixels without state and without memory of results, to make others like them."""
        kept = FastPixels.__new__(FastPixels)
        for name in ("array", *_CONSTANT):
            setattr(kept, name, getattr(self, name))
        return kept

    def _items(self, groups: int, together: bool) -> tuple[int, int]:
        """Work-items that a number of groups need, whole work-groups of them, and the size of a
        work-group. together: whether an item has several groups."""
        items = -(-groups // (self._together if together else 1))
        return self._device.groups(items, 1 if together else _LOCAL)

    def _filled(self, groups: npt.NDArray[np.intp], flags: int) -> npt.NDArray[np.uint32]:
        """Numbers of groups, padded to whole work-groups with a number that no group has."""
        together = bool(flags & BANK)
        size = self._items(groups.size, together)[0] * (self._together if together else 1)
        rest = np.full(size - groups.size, 0xFFFFFFFF, np.uint32)
        return np.append(groups.astype(np.uint32), rest)

    def _upload(self, charge: npt.NDArray[np.int32], spikes: npt.NDArray[np.uint64]) -> None:
        """Writes the padded state to the device."""
        self._charge = self._device.upload(charge)
        self._low = self._device.upload(spikes.astype(np.uint32))
        self._high = self._device.upload((spikes >> np.uint64(32)).astype(np.uint32))

    def _download(self) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.uint64]]:
        """Charge and spike index of every padded pixel."""
        height, groups = self.array.groups
        shape, device = (height, groups * LANES), self._device
        low = device.download(self._low, np.empty(shape, np.uint32))
        high = device.download(self._high, np.empty(shape, np.uint32))
        charge = device.download(self._charge, np.empty(shape, np.int32))
        return charge, low.astype(np.uint64) | (high.astype(np.uint64) << np.uint64(32))

    def _state(self, flags: int, start: int) -> tuple[Any, ...]:
        """Kernel arguments that hold the state and the model of the pixels. start: first cycle of
        the call."""
        if not flags:
            return (self._charge,)
        array, units = self.array, self.array.units
        moves: tuple[Any, ...] = ()
        if flags & JITTER and array.timing is not None:
            moves = np.uint32(start % 2**32), np.uint32(array.timing.key), *self._moves
        if flags & BANK:
            return (
                self._charge, self._low, self._keys, *self._bank, np.uint32(start % PERIOD),
                array.dead, np.int32(units.one), np.int32(array.bank.shortest),
                np.int32(array.over), *moves,
            )  # fmt: skip
        return (
            self._charge, self._low, self._high, self._numbers, self._table,
            np.uint32(array.model.seed), array.dead, np.int32(units.one),
            np.int32(units.top if flags & NOISE else units.one), *moves,
        )  # fmt: skip

    def _share(self, launches: Launches, before: dict[int, tuple[Plane, Any]]) -> None:
        """Shares each new plane with the device. before: those of the last call."""
        planes = self._planes
        for given in (launches.steady, *chain.from_iterable(run.planes for run in launches.runs)):
            plane = given.plane if isinstance(given, Scaled) else given
            if id(plane) not in planes:
                shared = before.get(id(plane))
                if shared is None:
                    shared = plane, self._device.share(np.ascontiguousarray(plane, np.float32))
                planes[id(plane)] = shared

    def _shared(self, plane: Any) -> tuple[Any, np.float32]:
        """The shared plane, and the factor by which a kernel multiplies it."""
        if isinstance(plane, Scaled):
            return self._planes[id(plane.plane)][1], plane.factor
        return self._planes[id(plane)][1], np.float32(1)

    def _steady(self, launches: Launches, start: int, cycles: int, words: Any) -> None:
        """One launch for the pixels outside the box of changing light. Groups with a
        course of their own are not among them."""
        height, groups = self.array.groups
        y0, y1, g0, g1 = _groups(launches.box)
        plane, factor = self._shared(launches.steady)
        for flags, (groups_of, n) in self._lists.items():
            if flags & _OWN:
                continue
            if (y1 - y0) * (g1 - g0) == height * groups:
                return
            items, local = self._items(n, bool(flags & BANK))
            self._kernels[flags][0](
                self._device.queue, (items,), (local,), *self._state(flags, start),
                plane, factor, words, np.uint32(height * self.array.shape[1]),
                np.uint32(self.array.shape[1]), np.uint32(groups), self.array.brightest,
                groups_of, *(np.uint32(edge) for edge in (y0, y1, g0, g1)), np.uint32(cycles),
                self._fault, *self._gains,
            )  # fmt: skip

    def _moving(self, run: Run, box: Box | None, start: int, words: Any, own: bool) -> None:
        """One launch for segments of a course that together use at most sixteen planes, for the
        groups with a course of their own, or the others. start: first cycle of the call."""
        planes, some = zip(*map(self._shared, run.planes), strict=True)
        planes += planes[:1] * (MOST_PLANES - len(planes))
        factors = np.ones(MOST_PLANES, np.float32)
        factors[: len(some)] = some
        y0, y1, g0, g1 = _groups(box)
        (height, width), device = self.array.shape, self._device
        shared = device.upload(run.entries), device.upload(run.weights)
        for flags in self._lists:
            if bool(flags & _OWN) != own:
                continue
            items, local = self._items(g1 - g0, not flags or bool(flags & BANK))
            first = () if flags else (np.uint32(start % PERIOD),)
            self._kernels[flags][1](
                device.queue, (items, y1 - y0), (local, 1), *self._state(flags, start), *first,
                self._flags, shared[0], np.uint32(len(run.entries)), shared[1],
                np.uint32(run.rows), words, np.uint32(height * width), np.uint32(width),
                np.uint32(self.array.groups[1]), self.array.brightest,
                np.uint32(y0), np.uint32(g0), np.uint32(g1), np.uint32(len(run.planes)),
                self._fault, *self._gains, *planes, factors.view(_FLOAT16)[0],
            )  # fmt: skip

    def into(self, words: npt.NDArray[np.uint32]) -> None:
        """Has the next calls write into these words, (words, H W), one after another."""
        self._given = words

    def _room(self, words: int) -> npt.NDArray[np.uint32]:
        """Memory for the words of a call, (words, H W)."""
        if words > len(self._given):
            return self._outputs.take((words, self.array.shape[0] * self.array.shape[1]))
        out, self._given = self._given[:words], self._given[words:]
        return out

    def expose(self, light: Light, start: int, cycles: int) -> npt.NDArray[np.uint32]:
        """Latched bits of cycles `start` to `start + cycles` of the clock.

        Returns:
            (ceil(cycles / 32), H W) uint32; bit b of word w is cycle start + 32 w + b.

        Raises:
            ValueError: the light has another shape, is negative, or does not cover the cycles.
                After negative light the state has no meaning.
        """
        return self.launch(light, start, cycles)()

    def launch(self, light: Light, start: int, cycles: int) -> Callable[[], npt.NDArray[np.uint32]]:
        """Begins what `expose` does. The result waits for it and returns its words; it must be
        called, as the device writes into memory of the host until then."""
        array = self.array
        array.check(light, start, cycles)
        out = self._room(words_for(cycles))
        before, self._planes = self._planes, {}
        targets: list[tuple[Any, npt.NDArray[np.uint32]]] = []
        fault = np.empty(1, np.int32)

        def wait() -> npt.NDArray[np.uint32]:
            try:
                fetched = self._device.fetch(self._fault, fault)
                for words, part in targets:
                    self._device.settle(words, part)
            except BaseException:
                self._device.finish()
                raise
            del fetched
            if fault[0]:
                self._fault = self._device.upload(np.zeros(1, np.int32))
                ends = ((piece.first, piece.last) for piece in light.pieces)
                least = np.min([np.asarray(plane).min() for plane in chain.from_iterable(ends)])
                raise ValueError(f"light must be 0 or more, not {float(least):g}")
            return out

        try:
            for first, n in array.parts(light, start, cycles):
                begin, part = start + first, out[first // WORD : words_for(first + n)]
                words = self._device.target(part)
                targets.append((words, part))
                launches = array.launches(light, begin, n)
                self._run(launches, before, begin, n, words)
                if array.has_own:  # while the kernels of others run
                    if not array.in_common(launches.box):
                        launches = array.own_launches(light, begin, n)
                    self._run(launches, before, begin, n, words, True)
        except BaseException:
            self._device.finish()
            raise
        return wait

    def finish(self) -> None:
        """Waits for what `launch` has begun, whose words are dropped."""
        self._device.finish()

    def _run(
        self, launches: Launches, before: dict[int, tuple[Plane, Any]], begin: int, cycles: int,
        words: Any, own: bool = False,
    ) -> None:  # fmt: skip
        """Launches all kernels; see `_moving` and `_share`."""
        self._share(launches, before)
        if not own:
            self._steady(launches, begin, cycles, words)
        for run in launches.runs:
            self._moving(run, launches.box, begin, words, own)

    def fraction(self) -> npt.NDArray[np.float64]:
        """Stored charge over the threshold of the current interval, (H W,)."""
        return self.array.fraction(*self._download())

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next call depends on.

        Returns:
            charge: (H W,) int32, phase in 2^-32 of a threshold, or deficit in units.
            spikes: (H W,) uint64, index of the current interval; 0 where no thresholds are drawn.
                For pixels that draw from the bank the latest spike: twice the number of the cycle
                after it, plus 1 if it was not the first of its cycle, modulo 2^32; 0 for none.
        """
        charge, spikes = self._download()
        trim = self.array.trimmed
        return {"charge": trim(charge).copy(), "spikes": trim(spikes).copy()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        pad = self.array.padded
        self._upload(
            pad(np.asarray(state["charge"], np.int32)), pad(np.asarray(state["spikes"], np.uint64))
        )

    def take_over(
        self, before: FastPixels, cycle: int, fresh: npt.NDArray[np.bool_], interval: int
    ) -> npt.NDArray[np.bool_]:
        """Continues the pixels of another threshold; see `RewrittenPixels` and `taken_over`."""
        state, fires = taken_over(self.array, before.array, before.state(), cycle, fresh, interval)
        self.restore(state)
        return fires


def _groups(box: Box | None) -> tuple[int, int, int, int]:
    """Rows y0 to y1 and groups g0 to g1 that a box overlaps."""
    if box is None:
        return 0, 0, 0, 0
    y0, y1, x0, x1 = box
    return y0, y1, x0 // LANES, -(-x1 // LANES)
