"""The fast tier in numpy: the golden model of its kernels, bit for bit.

A cycle's light is float32, one rounding an operation, and becomes an integer; all else is integer.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.light.light import Light, Plane
from cosim.spikes.viform import WORD, words_for
from sensor.latched.fast.array import LANES, PixelArray
from sensor.latched.fast.course import Course, Segment
from sensor.latched.fast.units import BANK, CAP, DEAD_TIME, JITTER, NOISE, TIMING, draw_thresholds
from sensor.latched.pixel.charge import transfer_light

_F = np.float32
Array = npt.NDArray[Any]


def _whole_groups(mask: Array) -> Array:
    """Whether a mask, (rows, columns), is true for all pixels of the group of each pixel."""
    groups = mask.reshape(len(mask), -1, LANES).all(axis=2)
    return np.asarray(groups.repeat(LANES, axis=1))


class NumpyFast:
    """One cycle at a time over all pixels of an array."""

    def __init__(self, array: PixelArray) -> None:
        self._array = array
        self._numbers = array.padded(array.numbers)
        lanes = np.arange(self._numbers.shape[1], dtype=np.uint32) % LANES
        self._lanes = np.broadcast_to(lanes, self._numbers.shape)
        self._groups = np.repeat(self._numbers[:, ::LANES], LANES, axis=1)
        self._flags = np.repeat(array.group_flags, LANES, axis=1)
        self._charge, self._spikes = array.initial_state()

    def _level(self, plane: Plane) -> Array:
        """Thresholds a cycle under a steady plane."""
        array, light = self._array, self._array.padded(plane)
        if array.gains is None:
            return np.minimum(light * _F(array.scale), array.brightest)
        gain, dark = array.gains
        return np.minimum(np.maximum(light * gain + dark, _F(0)), array.brightest)

    def _bank_ramp(self, segment: Segment, base: Array, others: list[Array], start: int) -> Any:
        """Units that the cycles of a segment bring to groups that draw from the bank, (cycles,
        rows, columns) int64, and the groups' pixels for which they hold; None if they do not."""
        if len(others) > 1 or (others and segment.anchors is None) or self._array.model.transfers:
            return None
        one = _F(self._array.units.one)
        level, last = base * one, (others or [base])[0] * one
        step = last - level
        easy = _whole_groups(np.maximum(level, last) <= _F(CAP) * _F(1 - 2.0**-20))
        slope = np.rint(step * _F(segment.slope)).astype(np.int64)
        ramp = []
        for weight, since, _ in self._anchors(segment, bool(others), start):
            ramp.append(np.rint(level + weight * step).astype(np.int64) + since * slope)
        return ramp, easy

    def _phase_ramp(self, segment: Segment, base: Array, others: list[Array], start: int) -> Any:
        """The same for groups without flags, in 2^-32 thresholds and without whole thresholds."""
        if len(others) > 1 or self._array.model.transfers:
            return None
        step = (others or [base])[0] - base
        growth, margin, none = step * _F(segment.slope), _F(2.0**-20), -(2**62)
        half = np.trunc(growth * _F(2.0**31)).astype(np.int64)
        ramp = []
        for weight, since, reach in self._anchors(segment, bool(others), start):
            first = np.maximum(base + weight * step, _F(0))
            last = first + (reach - 1).astype(_F) * growth
            below = np.maximum(first, last) < _F(1) - margin
            above = np.minimum(first, last) > _F(1) + margin
            easy = _whole_groups((below | above) & (np.abs(growth) <= _F(0.25)))
            whole = np.floor(first)
            begin = ((first - whole) * _F(2.0**32) + _F(0.5)).astype(np.int64)
            fall = np.where(first < 1, np.maximum(-half, 0) * 2 * (reach - 1), 0)
            add = (np.maximum(begin, fall) + since * 2 * half) % 2**32
            ramp.append(np.where(easy, add + np.where(first >= 1, 2**32, 0), none))
        return ramp, np.ones(base.shape, bool)

    @staticmethod
    def _anchors(segment: Segment, moves: bool, start: int) -> Iterator[tuple[Array, Array, Array]]:
        """Weight at the anchor of each cycle, cycles since the anchor and its reach, (rows, 1)."""
        for n in range(segment.cycles):
            weight, since, reach = np.zeros((1, 1), _F), np.zeros((1, 1)), np.ones((1, 1))
            if moves and segment.anchors is None:
                weight = segment.weights[n][:, :1]
            elif moves:
                c = segment.first + n
                word = (start + c) // WORD - (start + segment.first) // WORD
                weight, since, reach = np.split(segment.anchors[word], 3, axis=1)
                since = c - since
            yield weight, since.astype(np.int64), reach.astype(np.int64)

    def _rates(
        self, course: Course, start: int, cycles: int
    ) -> Iterator[tuple[Array, Array, Array]]:
        """Thresholds that each cycle brings; the units of those pixels whose light is a ramp of
        whole steps, if they draw from the bank or have no flags, a large negative number
        elsewhere; and the share of its light that a spike loses."""
        steady = self._level(course.steady)
        none = np.full(steady.shape, -(2**62), np.int64)
        if course.box is None:
            for _ in range(cycles):
                yield steady, none, np.full(steady.shape, self._array.dead)
            return
        y0, y1, x0, x1 = course.box
        # Whole groups, as in the kernels.
        box = slice(y0, y1), slice(x0 // LANES * LANES, -(-x1 // LANES) * LANES)
        flags = self._flags[box]
        for segment in course.segments:
            base = self._level(segment.base)[box]
            levels = [self._level(plane)[box] for plane in segment.planes]
            steps = [level - base for level in levels]
            ramps = [
                (self._bank_ramp(segment, base, levels, start), (flags & BANK) != 0),
                (self._phase_ramp(segment, base, levels, start), flags == 0),
            ]
            for n, weights in enumerate(segment.weights):
                rate = steady.copy()
                rate[box] = base
                for k, step in enumerate(steps):
                    rate[box] += weights[:, k : k + 1] * step
                ramp = none.copy()
                for found, mine in ramps:
                    if found is not None:
                        ramp[box] = np.where(found[1] & mine, found[0][n], ramp[box])
                share = np.full(rate.shape, self._array.dead)
                if weights.shape[1] > len(steps):
                    share[box] *= weights[:, -1:]
                yield rate, ramp, share

    def _phase(self, rate: Array, ramp: Array) -> Array:
        """One cycle of the pixels without any flag."""
        ramps, rate = ramp > -(2**61), np.maximum(rate, _F(0))
        whole = np.where(ramps, ramp >> 32, np.floor(rate))
        add = ((rate - np.floor(rate)) * _F(2.0**32) + _F(0.5)).astype(np.uint64)
        add = np.where(ramps, (ramp % 2**32).astype(np.uint64), add)
        total = self._charge.view(np.uint32).astype(np.uint64) + add
        mine = self._flags == 0
        self._charge[mine] = total.astype(np.uint32).view(np.int32)[mine]
        return mine & ((total >> np.uint64(32) != 0) | (whole >= 1))

    def _draw(self, due: Array, crossing: int, cycle: int) -> Array:
        """Next thresholds of the pixels of a mask, (n,); other lanes keep their spike index.
        crossing: number of thresholds crossed before in this cycle."""
        array, units = self._array, self._array.units
        threshold = np.full(due.shape, units.one, np.int64)
        banked = (self._flags & BANK) != 0
        from_bank = due & banked
        self._spikes[due & ~banked] += np.uint64(1)
        draw = due & ~banked & ((self._flags & NOISE) != 0)
        if draw.any():
            k, numbers = self._spikes[draw], self._numbers[draw]
            threshold[draw] = draw_thresholds(units, k, numbers, array.model.seed)
        if from_bank.any():
            cycles = np.full(np.count_nonzero(from_bank), cycle)
            threshold[from_bank] = array.bank.draw(
                self._groups[from_bank], self._lanes[from_bank], cycles, crossing, array.model.seed
            )
            self._spikes[from_bank] = (2 * (cycle + 1) + (crossing > 0)) % 2**32
        return threshold[due]

    def _deficit(self, rate: Array, ramp: Array, share: Array, cycle: int) -> Array:
        """One cycle of the pixels that have flags."""
        array, units = self._array, self._array.units
        mine = self._flags != 0
        most = _F(CAP / units.one)
        held = np.minimum(np.maximum(rate, _F(0)), most) * _F(units.one)
        banked = (self._flags & BANK) != 0
        add = np.where(banked, np.rint(held), held + _F(0.5))
        add = np.where(mine, add, 0).astype(np.int64)
        ramps = banked & ((self._flags & TIMING) == 0) & (ramp > -(2**61))
        add = np.where(ramps, ramp, add)
        lost = (add.astype(_F) * share).astype(np.int64)
        lost[(self._flags & DEAD_TIME) == 0] = 0
        noisy = (self._flags & NOISE) != 0
        top = np.where(noisy, units.top, units.one)
        if banked.any():
            top[banked] = array.over
        early = self._early(add, cycle)
        deficit = self._charge.astype(np.int64) - early
        if array.model.reset != "residual":
            return self._one(deficit - np.where(mine, add, 0), lost, mine, early, cycle)
        # Light above the longest threshold: thresholds are subtracted at their mean.
        certain = mine & (add >= top + lost) & (deficit < add)
        whole = units.one + lost
        many = np.where(certain, -((deficit - add) // whole), 0)
        self._spikes += np.where(banked, 0, many).astype(np.uint64)
        self._spikes[certain & banked] = 2 * (cycle + 1) % 2**32
        deficit += many * whole - np.where(mine, add, 0)
        fired = certain | (mine & (deficit < 0))
        due, crossing = mine & (deficit < 0), 0
        while due.any():
            deficit[due] += self._draw(due, crossing, cycle) + lost[due]
            due, crossing = mine & (deficit < 0), crossing + 1
        self._charge[mine] = (deficit + early).astype(np.int32)[mine]
        return fired

    def _early(self, add: Array, cycle: int) -> Array:
        """Units by which the comparison at the end of a cycle is early."""
        array, early = self._array, np.zeros(add.shape, np.int64)
        if array.timing is not None:
            band = slice(array.timing.first, array.timing.stop)
            moved = np.zeros(add[band].shape, np.float32)
            moved[:, : array.shape[1]] = array.timing.at(cycle + 1)
            early[band] = np.rint(add[band].astype(_F) * moved)
        return np.where(self._flags & JITTER, early, 0)

    def _one(self, deficit: Array, lost: Array, mine: Array, early: Array, cycle: int) -> Array:
        """The end of a cycle in which one threshold is crossed at most: `hard`, `subtract`."""
        array = self._array
        fired = mine & (deficit < 0)
        threshold = np.zeros(fired.shape, np.int64)
        threshold[fired] = self._draw(fired, 0, cycle)
        if array.model.reset == "hard":
            deficit = np.where(fired, threshold + lost - 1, deficit)
        else:
            deficit = np.maximum(deficit + np.where(fired, threshold + lost, 0), array.deepest)
        self._charge[mine] = (deficit + early).astype(np.int32)[mine]
        return fired

    def expose(self, light: Light, start: int, cycles: int) -> npt.NDArray[np.uint32]:
        """Words (ceil(cycles / 32), H W) of cycles `start` to `start + cycles`."""
        self._array.check(light, start, cycles)
        course = self._array.course(light, start, cycles)
        words = np.zeros((words_for(cycles), self._charge.size), np.uint32)
        model, most = self._array.model, self._array.brightest
        own = self._array.own_course(light, start, cycles) if self._array.has_own else course
        noisy = (self._flags & (TIMING | JITTER)) != 0
        moved = self._rates(own, start, cycles)
        for c, (rate, ramp, share) in enumerate(self._rates(course, start, cycles)):
            other, moved_ramp, mine = next(moved)
            ramp = np.where(noisy, moved_ramp, ramp)
            rate, share = np.where(noisy, other, rate), np.where(noisy, mine, share)
            if model.transfers:
                positive = np.maximum(rate, _F(0))
                rate = transfer_light(model.transfers, positive, self._array.ratio)
                rate = np.minimum(np.maximum(rate, _F(0)), most)
            fired = self._phase(rate, ramp) | self._deficit(rate, ramp, share, start + c)
            words[c // WORD] |= fired.ravel().astype(np.uint32) << np.uint32(c % WORD)
        return np.stack([self._array.trimmed(word) for word in words])

    def fraction(self) -> npt.NDArray[np.float64]:
        """Stored charge over the running interval's own threshold, now, (H W,)."""
        return self._array.fraction(self._charge, self._spikes)

    def state(self) -> dict[str, Array]:
        trim = self._array.trimmed
        return {"charge": trim(self._charge).copy(), "spikes": trim(self._spikes).copy()}

    def restore(self, state: dict[str, Array]) -> None:
        self._charge = self._array.padded(np.asarray(state["charge"], np.int32))
        self._spikes = self._array.padded(np.asarray(state["spikes"], np.uint64))
