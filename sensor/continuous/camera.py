"""Continuous photographing (Huang 2022 section 3.1): light in, absolute intensities out.

Each pixel watches its photocurrent; when it has changed by more than a threshold since the last
report, the pixel measures its intensity and puts the absolute value out. Nothing integrates to a
threshold and nothing spikes. The source gives the principle and no circuit; docs/continuous.md
specifies the model.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, seconds_to_ps
from cosim.compute.cores import by_rows
from cosim.light.light import Light, Piece, Plane
from cosim.spikes.events import time_order
from cosim.spikes.intensities import Intensities
from sensor.continuous.crossing import Monitors, Reports, collect, jump
from sensor.continuous.sampled import quantile_table, stationary, walk
from sensor.continuous.setting import ContinuousSetting

_STEPS = 64
"""Ticks in one call of the sampled kernel: bounds the room that noisy pixels can need."""
_NONE = np.zeros(0)

Floats = npt.NDArray[np.float64]
State = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class _Span:
    """Steps of `step` ps, the first of tick `tick` and beginning at `start`, in one piece."""

    piece: Piece
    tick: int
    start: int
    step: int
    count: int
    whole: bool
    finish: bool


def _flat(plane: Plane) -> Floats:
    return plane.ravel().astype(np.float64)


class ContinuousCamera:
    """The pixels of a continuous-photographing chip.

    Calls of `step` continue one another; at the first, the monitors have settled at the light that
    it begins with. Results do not depend on how the time is split: state and noise are computed
    from the pieces of light and from the ticks of the clock.

    Args:
        setting: setting of the sensor.
        rows: rows of the chip that are simulated, all if None. The number of a pixel, and so its
            noise, is its place on the whole chip.
    """

    def __init__(self, setting: ContinuousSetting, rows: tuple[int, int] | None = None) -> None:
        chip = setting.chip
        top, stop = rows or (0, chip.height)
        self.shape = (stop - top, chip.width)
        self.setting = setting
        self._number = np.arange(top * chip.width, stop * chip.width, dtype=np.uint32)
        gain, dark = np.ones(self._number.size), np.zeros(self._number.size)
        if setting.pattern is not None:
            fixed = setting.pattern.at(self._number)
            gain, dark = fixed.gain, fixed.dark
        self._gain, self._dark = gain * setting.electrons_per_lux, dark
        self._monitors: Monitors | None = None
        self._at = self._anchor = 0
        self._held: list[Piece] = []
        self._room = 256
        self._checked: list[Plane] = []

    def step(self, light: Light, start_ps: int, stop_ps: int) -> Intensities:
        """The reports from `start_ps` to before `stop_ps`; with noise those of ticks that end by
        then. light: lux on the pixels, at least that time.

        Raises ValueError for light of another shape, light that does not cover the time, light
        below 0, and a start that is not where the last step stopped.
        """
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        if not 0 <= start_ps < stop_ps or (self._monitors is not None and start_ps != self._at):
            raise ValueError(f"a step must go on from {self._at} ps, not {start_ps} to {stop_ps}")
        if light.pieces[0].start > start_ps or light.pieces[-1].stop < stop_ps:
            raise ValueError(f"light must cover {start_ps} to {stop_ps} ps")
        clock, noise = self.setting.clock, self.setting.noise
        for piece in light.pieces:
            if piece.stop > start_ps and piece.start < stop_ps:
                self._check(piece.first)
                self._check(piece.last)
        if self._monitors is None:
            self._begin(light, start_ps)
        parts = self._sampled(light, stop_ps) if noise else self._exact(light, stop_ps)
        self._at = stop_ps
        first = clock.cycle_at(start_ps)
        return self._intensities(list(parts), first, clock.cycle_at(stop_ps - 1) - first + 1)

    def _check(self, plane: Plane) -> None:
        if any(plane is known for known in self._checked):
            return
        if not ((plane >= 0) & (plane < np.inf)).all():
            raise ValueError("light must be finite and 0 or more")
        self._checked = [*self._checked[-3:], plane]

    def _begin(self, light: Light, start_ps: int) -> None:
        setting = self.setting
        mean = self._gain * _flat(light.at(start_ps)) + self._dark
        tick = setting.clock.cycle_at(start_ps)
        if not setting.noise:
            self._monitors, self._anchor = Monitors.fresh(mean, start_ps), start_ps
            return
        if setting.clock.edge(tick) != start_ps:
            raise ValueError(f"the first step must begin with a tick, not at {start_ps} ps")
        seed = np.uint64(setting.seed)
        current = stationary(mean, self._number, setting.time_constant, seed, quantile_table())
        self._monitors, self._anchor = Monitors.fresh(current, tick), start_ps

    def _collect(self, kernel: Any, **given: Any) -> Reports:
        """Runs a kernel on the monitors and keeps what it makes of them."""
        assert self._monitors is not None

        def run(m: Monitors, *out: Any) -> None:
            state = m.current, m.reference, m.when, m.measuring, m.charge
            by_rows(kernel, out[0].size, *state, *given.values(), *out)

        self._monitors, reports, self._room = collect(run, self._monitors, self._room)
        return reports

    def _slope(self, piece: Piece) -> Floats:
        """Change of light a second, (n,)."""
        if piece.constant:
            return np.zeros(self._number.size)
        return (_flat(piece.last) - _flat(piece.first)) * (PS / (piece.stop - piece.start))

    def _exact(self, light: Light, stop_ps: int) -> Iterator[Reports]:
        """Piece by piece, from crossing to crossing."""
        setting, clock = self.setting, self.setting.clock
        per_tick = Fraction(PS * clock.den, clock.num)
        numerator, denominator = per_tick.numerator, per_tick.denominator
        tick = clock.cycle_at(self._at) if self._at else clock.cycle_at(self._anchor)
        whole, rest = divmod(tick * numerator, denominator)
        if (stop_ps - whole) * denominator + numerator >= 2**62:
            raise ValueError("a step must be shorter for a clock of this frequency")
        grid = tuple(np.int64(x) for x in (tick, whole, rest, numerator, denominator))
        pieces = [p for p in light.pieces if p.stop > self._anchor and p.start < stop_ps]
        if pieces[0].start > self._anchor:
            raise ValueError(f"light must cover {self._anchor} ps, where its last piece began")
        for piece in pieces:
            slope, until = self._slope(piece), min(piece.stop, stop_ps)
            first = _flat(piece.first) + slope * ((self._anchor - piece.start) / PS)
            yield self._collect(
                jump, first=first, slope=slope, gain=self._gain, dark=self._dark,
                anchor=self._anchor, stop=piece.stop, until=until, grid=grid,
                tau=setting.time_constant, contrast=setting.contrast, floor=setting.floor,
                measure=seconds_to_ps(setting.measure), dead=seconds_to_ps(setting.dead_time),
            )  # fmt: skip
            if until == piece.stop:
                self._anchor = until

    def _spans(self, pieces: list[Piece], stop_ps: int) -> Iterator[_Span]:
        """Steps from the anchor to the last tick's end by `stop_ps`: runs of whole ticks inside a
        piece, and the parts of ticks in which pieces meet."""
        clock = self.setting.clock
        tick = clock.cycle_at(self._anchor)
        last = clock.cycle_at(stop_ps)  # the tick that is open at stop_ps
        for piece in pieces:
            while tick < last and piece.stop > clock.edge(tick):
                start, end = clock.edge(tick), clock.edge(tick + 1)
                if piece.start <= start and end <= piece.stop:
                    until = min(last, tick + _STEPS, clock.cycle_at(piece.stop))
                    yield _Span(piece, tick, start, 0, until - tick, True, True)
                    tick = until
                    continue
                begin, done = max(start, piece.start), end <= piece.stop
                step = min(end, piece.stop) - begin
                yield _Span(piece, tick, begin, step, 1, False, done)
                if not done:
                    break
                tick += 1

    def _sampled(self, light: Light, stop_ps: int) -> Iterator[Reports]:
        """Tick by tick."""
        setting, clock = self.setting, self.setting.clock
        pieces = [p for p in light.pieces if not self._held or p.start >= self._held[-1].stop]
        pieces = [*self._held, *pieces]
        period, n = float(clock.period), self._number.size
        sums = _NONE, _NONE, _NONE
        for span in self._spans(pieces, stop_ps):
            if span.whole:
                sums = _NONE, _NONE, _NONE
            elif not sums[0].size:
                sums = np.zeros(n), np.zeros(n), np.zeros(n)
            piece = span.piece
            edges = [clock.edge(span.tick + j) for j in range(span.count)] if span.whole else None
            begin = np.array([e - piece.start for e in edges or [span.start]], np.float64) / PS
            yield self._collect(
                walk, response=sums[0], variance=sums[1], mean=sums[2], number=self._number,
                first=_flat(piece.first), slope=self._slope(piece), gain=self._gain,
                dark=self._dark, begin=begin, h=period if span.whole else span.step / PS,
                tick0=span.tick, finish=span.finish, tau=setting.time_constant, period=period,
                contrast=setting.contrast, floor=setting.floor,
                measure=setting.ticks(setting.measure), dead=setting.ticks(setting.dead_time),
                seed=np.uint64(setting.seed), table=quantile_table(),
            )  # fmt: skip
            if not span.whole and span.finish:
                sums = _NONE, _NONE, _NONE
        self._anchor = clock.edge(clock.cycle_at(stop_ps))
        # Pieces that end in the open tick are not in the light of the next step.
        self._held = [p for p in pieces if self._anchor < p.stop <= stop_ps]

    def _intensities(self, parts: list[Reports], first: int, ticks: int) -> Intensities:
        names = ("pixel", "tick", "value")
        pixel, tick, value = (
            np.concatenate([getattr(part, name) for part in parts] or [np.zeros(0)])
            for name in names
        )
        order = time_order(tick, pixel)
        row, column = np.divmod(pixel[order].astype(np.int64), self.shape[1])
        converter = self.setting.converter
        return Intensities(
            row.astype(np.uint16),
            column.astype(np.uint16),
            tick[order].astype(np.int64),
            converter.decode(converter.encode(value[order])),
            self.shape,
            ticks,
            self.setting.clock,
            first,
        )

    def state(self) -> State:
        """Everything the next step depends on."""
        if self._monitors is None:
            return {}
        state: State = {name: array.copy() for name, array in vars(self._monitors).items()}
        held = self._held
        return state | {
            "at": np.array([self._at, self._anchor]),
            "held_time": np.array([[p.start, p.stop] for p in held], np.int64).reshape(-1, 2),
            "held_first": np.array([p.first for p in held]).reshape(-1, *self.shape),
            "held_last": np.array([p.last for p in held]).reshape(-1, *self.shape),
        }

    def restore(self, state: State) -> None:
        """Go on from a `state`."""
        if not state:
            self._monitors, self._held = None, []
            return
        names = ("current", "reference", "when", "measuring", "charge")
        self._monitors = Monitors(*(state[name].copy() for name in names))
        self._at, self._anchor = (int(x) for x in state["at"])
        self._held = [
            Piece(int(start), int(stop), first.astype(np.float32), last.astype(np.float32))
            for (start, stop), first, last in zip(
                state["held_time"], state["held_first"], state["held_last"], strict=True
            )
        ]
