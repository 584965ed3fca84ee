"""The reference of continuous pixels: the equations of docs/continuous.md in float64, by another
way than the camera's.

Integrals of the light are sums over Gauss-Legendre nodes where the camera has closed forms, the
normal numbers are scipy's quantiles of the same random words where it has a table, and crossings
without noise are found by bisection of short steps where it has Newton's method on a whole piece.
It runs a few tiles of the chip beside the camera.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from cosim.light.light import Light, Piece
from sensor.continuous.crossing import Reports
from sensor.continuous.sampled import FILTER, INITIAL, MEASURED
from sensor.continuous.setting import ContinuousSetting

_NODES: Final = 8
"""Gauss-Legendre nodes of an interval that is no longer than the time constant."""
_LONGEST: Final = 64
"""Time constants of light that a monitor remembers; what is older counts e^-64."""
_FINE: Final = 4
"""Steps in a time constant in which crossings are looked for, and at least one a tick."""
_HALVINGS: Final = 50

Reals = npt.NDArray[np.float64]
State = dict[str, npt.NDArray[Any]]


class Reference:
    """Some pixels of a chip, whose reports are collected.

    Args:
        setting: setting of the sensor.
        numbers: numbers of the pixels on the chip, (n,).
    """

    def __init__(self, setting: ContinuousSetting, numbers: npt.NDArray[np.uint32]) -> None:
        self._setting, self._numbers = setting, numbers.astype(np.uint64)
        n = numbers.size
        gain, self._dark = np.ones(n), np.zeros(n)
        if setting.pattern is not None:
            fixed = setting.pattern.at(numbers)
            gain, self._dark = gain * fixed.gain, self._dark + fixed.dark
        self._gain = gain * setting.electrons_per_lux
        self._current, self._last = np.zeros(n), np.full(n, np.nan)
        self._when, self._measuring = np.zeros(n, np.int64), np.zeros(n, bool)
        self._charge, self._begun = np.zeros(n), False
        self._found: list[Reports] = []

    def step(self, light: Light, start: int, stop: int) -> None:
        """Goes on from `start` to `stop`, ps, both ends of ticks. light: lux on the whole chip."""
        pieces = [p for p in light.pieces if p.stop > start and p.start < stop]
        if not self._begun:
            level = self._levels(pieces[0], np.array([start]))[0]
            self._current, self._begun = level, True
            if self._setting.noise:
                word = self._words(np.array([0]), INITIAL)[0]
                self._current = level + np.sqrt(level / (2 * self._setting.time_constant)) * word
            self._when[:] = self._setting.clock.cycle_at(start) if self._setting.noise else start
        run = self._sampled if self._setting.noise else self._followed
        run(pieces, start, stop)

    def reports(self) -> Reports:
        """All reports so far, behind the converter; `pixel` is the place among `numbers`."""
        parts = self._found or [Reports(*(np.zeros(0, t) for t in (np.int64, np.int64, float)))]
        pixel, tick, value = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("pixel", "tick", "value")
        )
        converter = self._setting.converter
        return Reports(pixel, tick, converter.decode(converter.encode(value)))

    def state(self) -> State:
        """Everything the next step depends on, and the reports so far."""
        found = self._found
        names = "pixel", "tick", "value"
        return {name: getattr(self, f"_{name}").copy() for name in _STATE} | {
            "begun": np.array(self._begun),
            **{f"found_{k}": np.concatenate([getattr(r, k) for r in found] or [np.zeros(0)])
               for k in names},
        }  # fmt: skip

    def restore(self, state: State) -> None:
        """Go on from a `state`."""
        for name in _STATE:
            setattr(self, f"_{name}", state[name].copy())
        self._begun = bool(state["begun"])
        pixel, tick, value = (state[f"found_{k}"] for k in ("pixel", "tick", "value"))
        self._found = [Reports(pixel.astype(np.int64), tick.astype(np.int64), value)]

    def _levels(self, piece: Piece, when: npt.NDArray[Any]) -> Reals:
        """Photocurrent at instants of a piece, electrons/s, (*when.shape, n)."""
        at = self._numbers.astype(np.int64)
        first = piece.first.ravel()[at].astype(np.float64)
        share = (when.astype(np.float64)[..., None] - piece.start) / (piece.stop - piece.start)
        if piece.constant:
            share = np.zeros_like(share)
        last = first if piece.constant else piece.last.ravel()[at].astype(np.float64)
        return np.asarray(self._gain * (first + (last - first) * share) + self._dark)

    def _words(self, ticks: npt.NDArray[np.int64], use: int) -> Reals:
        """Normal numbers of each tick and pixel, (ticks, n)."""
        from scipy.special import ndtri

        index = ticks.astype(np.uint64)[:, None]
        block = index >> np.uint64(2)
        high, low = block >> np.uint64(32), block & np.uint64(0xFFFFFFFF)
        counter = (self._numbers[None, :], high, low, use)
        four = np.stack(philox4x32(counter, (self._setting.seed, Stream.CONTINUOUS)))
        words = np.take_along_axis(four, (index & np.uint64(3))[None].astype(np.int64), axis=0)[0]
        return np.asarray(ndtri((words.astype(np.float64) + 0.5) * 2.0**-32))

    def _sampled(self, pieces: list[Piece], start: int, stop: int) -> None:
        """Tick by tick, with noise: y -> a y + c + noise; see `sensor.continuous.sampled`."""
        setting, clock = self._setting, self._setting.clock
        first, end = clock.cycle_at(start), clock.cycle_at(stop)
        ticks = np.arange(first, end)
        edges = np.array([clock.edge(int(t)) for t in range(first, end + 1)], np.int64)
        response, variance, arrived = self._sums(pieces, edges)
        noise = np.sqrt(variance) * self._words(ticks, FILTER)
        measure, dead = setting.ticks(setting.measure), setting.ticks(setting.dead_time)
        period, decay = float(clock.period), np.exp(-float(clock.period) / setting.time_constant)
        counted = arrived
        if measure:
            share = np.divide(response, variance, out=np.zeros_like(variance), where=variance > 0)
            rest = np.sqrt(np.maximum(arrived - response * share, 0.0))
            counted = arrived + share * noise + rest * self._words(ticks, MEASURED)
        for k, tick in enumerate(ticks.tolist()):
            self._current = decay * self._current + response[k] + noise[k]
            self._charge += np.where(self._measuring, counted[k], 0.0)
            awake = tick >= self._when
            done = self._measuring & awake
            # A pixel that has not reported has no number to be near to.
            beyond = ~(np.abs(self._current - self._last) < self._threshold())
            calls = ~self._measuring & awake & beyond
            if measure:
                value = self._charge / (measure * period)
                self._report(done, tick, value, tick + 1 + dead)
                self._measuring = (self._measuring & ~done) | calls
                self._when[calls] = tick + measure
                self._charge[calls | done] = 0.0
            else:
                self._report(calls, tick, self._current, tick + 1 + dead)

    def _sums(
        self, pieces: list[Piece], edges: npt.NDArray[np.int64]
    ) -> tuple[Reals, Reals, Reals]:
        """c, v and g of each tick, (ticks, n): the integrals of the current over the filter's
        response, over its square and alone."""
        tau, ticks = self._setting.time_constant, edges.size - 1
        sums = np.zeros((3, ticks, self._numbers.size))
        for piece in pieces:
            begin, end = np.maximum(edges[:-1], piece.start), np.minimum(edges[1:], piece.stop)
            at = np.flatnonzero(begin < end)
            until = (edges[1:][at, None] - begin[at, None]) / PS  # to the end of the tick
            node, weight = _nodes((end - begin)[at] / PS, tau)
            current = self._levels(piece, begin[at, None] + node * PS)
            fades = np.exp(-(until - node) / tau) / tau
            sums[0, at] += np.einsum("kj,kjn->kn", weight * fades, current)
            sums[1, at] += np.einsum("kj,kjn->kn", weight * fades**2, current)
            sums[2, at] += np.einsum("kj,kjn->kn", weight, current)
        return sums[0], sums[1], sums[2]

    def _threshold(self) -> Reals:
        relative = self._setting.contrast * self._last
        return np.where(np.isnan(relative), 0.0, np.maximum(relative, self._setting.floor))

    def _report(self, who: npt.NDArray[np.bool_], tick: int, value: Reals, awake: Any) -> None:
        """Reports of the pixels in `who` at a tick; they sleep until `awake`."""
        if who.any():
            at = np.flatnonzero(who)
            self._found.append(Reports(at, np.full(at.size, tick), value[at]))
            self._last[at] = np.maximum(value[at], 0.0)
            self._when[at] = np.broadcast_to(awake, who.shape)[at]

    def _followed(self, pieces: list[Piece], start: int, stop: int) -> None:
        """Without noise: steps of a part of a tick, in which crossings are found by bisection."""
        for piece in pieces:
            for begin, end, tick in self._parts(piece, start, stop):
                if piece.constant and self._settled(piece, begin):
                    break  # nothing happens to the end of the piece
                parts = int(np.ceil(_FINE * (end - begin) / PS / self._setting.time_constant))
                cuts = np.rint(np.linspace(begin, end, parts + 1)).astype(np.int64)
                for a, b in pairwise(cuts.tolist()):
                    if b > a:
                        self._within(piece, a, b, tick)

    def _settled(self, piece: Piece, at: int) -> bool:
        """Whether no pixel will report again in the constant light of a piece."""
        still = self._levels(piece, np.array([at]))[0]
        settled = np.abs(self._current - still) <= 1e-13 * np.maximum(still, 1.0)
        quiet = np.abs(still - self._last) < self._threshold()
        return not self._measuring.any() and bool((settled & quiet).all())

    def _parts(self, piece: Piece, start: int, stop: int) -> Iterator[tuple[int, int, int]]:
        """(begin, end, tick) of the ticks, or parts of ticks, of a piece between two instants."""
        clock = self._setting.clock
        begin, last = max(start, piece.start), min(stop, piece.stop)
        while begin < last:
            tick = clock.cycle_at(begin)
            end = min(clock.edge(tick + 1), last)
            yield begin, end, tick
            begin = end

    def _within(self, piece: Piece, a: int, b: int, tick: int) -> None:
        """From a to b (ps) inside a tick."""
        setting, ends = self._setting, self._setting.clock.edge(tick + 1)
        measure, dead = round(setting.measure * PS), round(setting.dead_time * PS)
        before = self._current
        after = self._course(piece, a, b, before)
        while True:
            done = self._measuring & (self._when + measure < b)
            if done.any():
                value = self._mean(piece, a, self._when + measure) / setting.measure
                finish = self._when + measure
                self._report(done, tick, value, np.maximum(finish + dead, ends))
                self._measuring &= ~done
                self._charge[done] = 0.0
            looks = np.maximum(self._when, a)
            free = ~self._measuring & (looks < b)
            level = self._course(piece, a, looks, before)
            now = free & ~(np.abs(level - self._last) < self._threshold())
            later = free & ~now & (np.abs(after - self._last) >= self._threshold())
            when, value = looks.copy(), level
            if later.any():
                when, value = self._cross(piece, a, b, before, after, looks, later, value)
            who = now | (later & (when < b))
            if not who.any():
                break
            if measure:
                self._measuring |= who
                self._when[who], self._charge[who] = when[who], 0.0
            else:
                self._report(who, tick, value, np.maximum(when + dead, ends))
        if measure:
            running = self._mean(piece, a, np.full_like(self._when, b))
            self._charge = np.where(self._measuring, running, 0.0)
        self._current = after

    def _cross(
        self, piece: Piece, a: int, b: int, before: Reals, after: Reals,
        looks: npt.NDArray[np.int64], later: npt.NDArray[np.bool_], value: Reals,
    ) -> tuple[npt.NDArray[np.int64], Reals]:  # fmt: skip
        """Instants at which pixels cross their thresholds after `looks`, ps, and the levels."""
        goal = self._last + np.copysign(self._threshold(), after - self._last)
        low, high = looks.astype(np.float64), np.full(looks.size, float(b))
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            level = self._course(piece, a, middle, before)
            past = (level >= goal) == (after >= goal)
            low, high = np.where(past, low, middle), np.where(past, middle, high)
        when = np.where(later, np.rint(high), looks).astype(np.int64)
        return when, np.where(later, goal, value)

    def _course(self, piece: Piece, a: int, when: Any, before: Reals) -> Reals:
        """The monitor at instants from a on, (n,), from what it is at a."""
        tau = self._setting.time_constant
        span = np.broadcast_to((np.asarray(when, np.float64) - a) / PS, before.shape)
        node, weight = _nodes(span, tau)
        first = self._levels(piece, np.array([a]))[0]
        slope = self._levels(piece, np.array([a + PS]))[0] - first
        current = first[:, None] + slope[:, None] * node
        fades = np.exp(-(span[:, None] - node) / tau) / tau
        return np.asarray(before * np.exp(-span / tau) + (weight * fades * current).sum(1))

    def _mean(self, piece: Piece, a: int, until: npt.NDArray[np.int64]) -> Reals:
        """Charge of the running measurements by `until` (ps), electrons."""
        begin = np.maximum(self._when, a)
        middle = (begin + until) / 2
        first = self._levels(piece, np.array([a]))[0]
        slope = self._levels(piece, np.array([a + PS]))[0] - first
        part = (first + slope * ((middle - a) / PS)) * ((until - begin) / PS)
        return np.asarray(np.where(self._when < a, self._charge, 0.0) + part)


_STATE: Final = ("current", "last", "when", "measuring", "charge")


def _nodes(span: Reals, tau: float) -> tuple[Reals, Reals]:
    """Nodes and weights of integrals over 0 .. span, (k, nodes), seconds: as many Gauss-Legendre
    intervals as there are time constants, all within the `_LONGEST` last of them."""
    many = int(min(max(np.ceil(span.max(initial=0.0) / tau), 1), _LONGEST))
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    inside = ((node + 1) / 2 + np.arange(many)[:, None]).ravel() / many
    return span[:, None] * inside, span[:, None] * (np.tile(weight, many) / 2 / many)
