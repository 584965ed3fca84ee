"""Pixels of the reference tier: they turn light into spike words in continuous time and float64."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.compute.cores import by_rows
from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from cosim.light.light import Light, Piece, Plane
from cosim.spikes.viform import words_for
from sensor.circuit.circuit import Circuit
from sensor.circuit.phases import RESET
from sensor.device.pattern import FixedPattern
from sensor.latched.pixel.charge import transfer_light
from sensor.latched.pixel.model import JUMP, ROOM, ExactModel
from sensor.latched.pixel.thresholds import spike_words
from sensor.latched.reference.bank_draws import BankDraws, bank_draws
from sensor.latched.reference.engine import expose
from sensor.latched.reference.law import LEAST, draw_all, law_of
from sensor.latched.reference.stiff_engine import expose_circuit
from sensor.latched.sampling import PixelTiming, RowMoves

Values = npt.NDArray[np.float64]
_RULE = {"residual": 0, "hard": 1, "subtract": 2}
_KEYS = {
    "tick": np.int64, "part": np.float64, "charge": np.float64, "goal": np.float64,
    "spikes": np.uint64, "held": np.float64, "phase": np.int64, "volts": np.float64,
    "wait": np.float64, "cycle": np.int64, "pending": np.float64, "ahead": np.float64,
}  # fmt: skip


class ReferencePixels:
    """The pixel of the exact tier (sensor/latched/pixel/model.py) without discretisation. It has
    the same effects, and takes the threshold of spike k as the exact quantile of the same word.

    Under `residual` a pixel restarts at each crossing: its dead time begins there and not at the
    latch, and exactly the light in it is lost. `hard` and `subtract` act at the latch. A crossing
    at the latch instant counts. Very bright pixels skip whole intervals of mean length (see
    engine.py). This affects only the phase with which such a pixel leaves saturation; without dead
    time and circuit, that phase equals the exact tier's.

    The class needs 16 bytes per pixel and piece of light in addition to the light, and is meant for
    patches.

    Args:
        model: rules of a pixel.
        numbers: (n,) uint32, numbers of the pixels on the chip.
        clock: clock of the latches.
        gain: electrons a second per unit of light.
        pattern: fixed pattern of these pixels, None if all are nominal.
        offsets: (n,) int64, ps from a clock edge to the latch of each pixel; None for 0.
        circuit: circuit of the pixel, None for none. Each spike then takes the delay of its
            comparator and its reset, and the charge leaks.
        overshoot: electrons beyond a threshold until the comparator switches; only `fraction` uses
            them.
        moves: moves of the sampling instants of rows, None for none.
        bank: draws of the pixels that take their thresholds from the bank, None for no such pixel.
        timing: timing noise of the pixels, None for none.

    Raises:
        ValueError: `offsets` has another shape, or a circuit comes with a dead time or with a reset
            other than `residual`, or its capacitance falls to 0 at twice the threshold.
    """

    def __init__(
        self,
        model: ExactModel,
        numbers: npt.NDArray[np.uint32],
        clock: Clock,
        gain: float,
        pattern: FixedPattern | None = None,
        offsets: npt.NDArray[np.int64] | None = None,
        circuit: Circuit | None = None,
        overshoot: float = 0.0,
        moves: RowMoves | None = None,
        bank: BankDraws | None = None,
        timing: PixelTiming | None = None,
    ) -> None:
        n = numbers.size
        self._model, self._numbers, self._clock = model, numbers.astype(np.uint32), clock
        self._gain, self._pattern = gain, pattern
        self._offsets = np.zeros(n, np.int64) if offsets is None else offsets.astype(np.int64)
        if self._offsets.shape != (n,):
            raise ValueError(f"offsets must be ({n},), one a pixel, not {self._offsets.shape}")
        self._moves, self._timing = moves, timing
        if moves is None:
            self._places, self._rows = np.unique(self._offsets, return_inverse=True)
        else:  # pixels lie row by row
            width = n // moves.height
            self._places, self._rows = self._offsets[::width], np.arange(n) // width
        self._shared = self._rows
        if timing is not None:  # each of these pixels has its own instants
            self._rows = self._rows.copy()
            mine = self._rows[timing.first * timing.columns : timing.stop * timing.columns]
            mine[:] = self._places.size + np.arange(mine.size)
        self._circuit = None if circuit is None else circuit.packed()
        if circuit is not None:
            if model.reset != "residual" or model.dead_time > 0:
                raise ValueError(
                    "a circuit must stand with reset 'residual' and no dead time, not "
                    f"{model.reset!r} and {model.dead_time:g} cycle"
                )
            circuit.swing(2 * model.threshold)  # raises if the capacitance nears zero
        self._bank = bank_draws(model, numbers) if bank is None else bank
        if circuit is not None and self._bank.mine.any():
            raise ValueError("pixels that draw from the bank must stand without a circuit")
        self._overshoot = overshoot
        shot = model.shot
        self._law = law_of(model.threshold, model.threshold_noise, shot, model.shift)
        self._shot = shot
        self._levels: list[tuple[Plane, Values]] = []
        goal, charge = self._initial()
        self._state: dict[str, Any] = {
            "tick": np.zeros(n, np.int64), "part": np.zeros(n), "charge": charge, "goal": goal,
            "spikes": np.zeros(n, np.uint64), "held": charge.copy(),
            "phase": np.zeros(n, np.int64), "volts": np.zeros(n), "wait": np.zeros(n),
            "cycle": np.full(1, -1), "pending": np.zeros(n), "ahead": np.zeros(n),
        }  # fmt: skip

    def _first_goals(self) -> Values:
        """Threshold of spike 0, (n,) electrons, as in `ExactModel.first_thresholds`."""
        model, numbers, law = self._model, self._numbers, self._law
        if model.random_start and model.noisy:
            longer = model.threshold + self._shot + model.threshold_noise**2 / model.threshold
            law = law_of(longer, model.threshold_noise, self._shot, model.shift)
        return draw_all(law, spike_words(np.zeros(numbers.size, np.uint64), numbers, model.seed))

    def _initial(self) -> tuple[Values, Values]:
        """Threshold of spike 0 and initial charge, (n,) electrons each, as in `ExactModel.initial`:
        intervals are weighted by their length, and the charge is uniform below the threshold."""
        model, numbers, goal = self._model, self._numbers, self._first_goals()
        if not model.random_start:
            return goal, np.zeros(goal.size)
        words = philox4x32((numbers, 0, 0, 0), (model.seed, Stream.INITIAL_CHARGE))[0]
        return goal, np.maximum(goal - model.shift, LEAST) * (words / 2.0**32)

    def _level(self, plane: Plane) -> Values:
        """Electrons a picosecond under a steady plane before transfers, (n,); cached by plane.

        Unlike in the exact tier, LARGEST is no limit here: a flash keeps all of its charge.
        """
        for known, rates in self._levels:
            if known is plane:
                return rates
        if not (plane >= 0).all():
            raise ValueError(f"light must be 0 or more, not {float(plane.min()):g}")
        period = float(self._clock.period)
        electrons = plane.astype(np.float64).ravel() * (self._gain * period)
        if self._pattern is not None:
            electrons = electrons * self._pattern.gain + self._pattern.dark * period
        rates = electrons / (PS * period)
        self._levels = [*self._levels[-63:], (plane, rates)]
        return rates

    def _course(
        self, light: Light, first: int, last: int
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], Values, Values]:
        """Begins and ends, (pieces,) ps, and rates at both, (n, pieces), of the pieces between two
        instants."""
        n = self._numbers.size
        if light.shape[0] * light.shape[1] != n:
            raise ValueError(f"light must fall on {n} pixels, not {light.shape}")
        if light.pieces[0].start > max(first, 0) or light.pieces[-1].stop < last:
            raise ValueError(
                f"light must cover {max(first, 0)} to {last} ps, not "
                f"{light.pieces[0].start} to {light.pieces[-1].stop} ps"
            )
        met = [p for p in light.pieces if p.stop > first and p.start < last] or [light.pieces[0]]
        if self._model.transfers:
            return self._transferred_course(met, first, last)
        begins = np.array([p.start for p in met], np.int64)
        ends = np.array([p.stop for p in met], np.int64)
        # Pieces are gathered row by row: columns written one by one would miss the cache at each
        # pixel.
        starts = np.ascontiguousarray(np.array([self._level(p.first) for p in met]).T)
        stops = starts
        if not all(p.constant for p in met):
            stops = np.ascontiguousarray(np.array([self._level(p.last) for p in met]).T)
        return begins, ends, starts, stops

    def _transferred_course(
        self, pieces: list[Piece], first: int, last: int
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], Values, Values]:
        """`_course` with the transfers applied to the rate.

        Changing light is cut at the clock edges, and the mapped rate is linear between them. The
        error is of second order in the change within a cycle.
        """
        clock, model = self._clock, self._model
        per_threshold = PS * float(clock.period) / model.threshold
        begins, ends, starts, stops = [], [], [], []
        for piece in pieces:
            a, b = self._level(piece.first), self._level(piece.last)
            cuts = [piece.start, piece.stop]
            if not piece.constant:
                low, high = max(first, piece.start), min(last, piece.stop)
                cycles = range(clock.cycle_at(max(low, 0)), clock.cycle_at(max(high, 0)) + 2)
                inside = {clock.edge(c) for c in cycles}
                cuts = sorted({*cuts, *(e for e in inside if piece.start < e < piece.stop)})
            length = piece.stop - piece.start
            lit = [a + (b - a) * ((t - piece.start) / length) for t in cuts]
            levels = [
                transfer_light(model.transfers, level * per_threshold, 1) / per_threshold
                for level in lit
            ]
            begins += cuts[:-1]
            ends += cuts[1:]
            starts += levels[:-1]
            stops += levels[1:]
        return (
            np.array(begins, np.int64), np.array(ends, np.int64),
            np.ascontiguousarray(np.stack(starts, axis=1)),
            np.ascontiguousarray(np.stack(stops, axis=1)),
        )  # fmt: skip

    def _latches(self, start: int, cycles: int) -> npt.NDArray[np.int64]:
        """Instants at which cycles begin and end, (rows, cycles + 1) ps; see `_rows`."""
        edges = np.array([self._clock.edge(start + c) for c in range(cycles + 1)], np.int64)
        latches: npt.NDArray[np.int64] = edges + self._places[:, None]
        if self._moves is not None:
            latches[self._moves.first : self._moves.stop] += self._moves.moves(start, cycles + 1).T
        if self._timing is None:
            return latches
        timing, period = self._timing, PS * float(self._clock.period)
        moved = np.array([timing.at(start + c).ravel() for c in range(cycles + 1)], np.float64)
        shared = self._shared[timing.first * timing.columns : timing.stop * timing.columns]
        return np.concatenate([latches, latches[shared] + np.rint(moved.T * period).astype(int)])

    def expose(self, light: Light, start: int, cycles: int) -> npt.NDArray[np.uint32]:
        """Latched bits of cycles `start` to `start + cycles` of the clock.

        Calls follow each other without gaps. Results do not depend on how a run is split into
        calls, as long as the pieces of light are the same.

        Args:
            light: light on these pixels, row by row. It covers the cycles, moved by every offset.
            start: first cycle.
            cycles: number of cycles.

        Returns:
            (ceil(cycles / 32), n) uint32; bit b of word w is cycle start + 32 w + b.

        Raises:
            ValueError: the light has another size, is negative or does not cover the cycles, or
                `start` does not follow the last call.
        """
        state, clock = self._state, self._clock
        latches = self._latches(start, cycles)
        if state["cycle"][0] < 0:
            state["tick"] = latches[self._rows, 0]
        elif state["cycle"][0] != start:
            raise ValueError(f"cycles must go on at {state['cycle'][0]}, not at {start}")
        n, law, model = self._numbers.size, self._law, self._model
        words = np.zeros((words_for(cycles), n), np.uint32)
        if n == 0 or cycles == 0:
            return words
        course = self._course(light, int(latches[:, 0].min()), int(latches[:, -1].max()))
        before = tuple(state[key] for key in ("tick", "part", "charge", "goal", "spikes", "held"))
        inputs = (self._numbers, self._rows, *course, latches)
        drawn = (law.q, law.kind, law.sigma, law.table, law.functions, np.uint64(model.seed))
        if self._circuit is None:
            bank, dead = self._bank, model.dead_time * float(clock.period) * PS
            rules = (_RULE[model.reset], dead, *drawn, bank.values, bank.keys, bank.lanes, start)
            by_rows(expose, n, *before, *inputs, *rules, words, least=0)
        else:
            circuit = (state["phase"], state["volts"], state["wait"], *inputs, self._circuit)
            by_rows(expose_circuit, n, *before, *circuit, *drawn, words, least=0)
        if self._circuit is not None or model.dead_time > 0:
            state["pending"] = self._pending_after(course, latches[self._rows, -1])
        if self._timing is not None:
            state["ahead"] = self._ahead(course, latches[self._rows, -1], start + cycles)
        state["cycle"] = np.full(1, start + cycles)
        return words

    def _ahead(self, course: Any, latches: npt.NDArray[np.int64], cycle: int) -> Values:
        """Electrons that the timing noise of the last latches, (n,) ps, brought before the edge at
        which `cycle` begins: fractions are those at the edge. course: see `_course`."""
        edges = self._latches(cycle, 0)[self._shared, 0]  # those of the rows come first
        return (latches - edges) * _rates(course, np.arange(edges.size), (edges + latches) // 2)

    def _pending_after(self, course: Any, latches: npt.NDArray[np.int64]) -> Values:
        """Electrons that dead times or resets of the circuit which last beyond the latches, (n,)
        ps, will lose. course: see `_course`."""
        pending, state = np.zeros(latches.size), self._state
        wait = state["tick"] - latches + state["part"]
        if self._circuit is not None:
            wait = np.where(state["phase"] == RESET, wait + state["wait"], 0.0)
        late = np.flatnonzero(wait > 0)
        pending[late] = wait[late] * _rates(course, late, latches[late])
        return pending

    def _next(
        self, due: npt.NDArray[np.bool_], spikes: npt.NDArray[np.uint64], cycle: Any, crossing: int
    ) -> Values:
        """Thresholds of pixels that fire in a cycle, (n,) electrons. due: the n pixels; spikes: of
        all pixels, after this spike; crossing: see `Bank.draw`."""
        words = spike_words(spikes[due], self._numbers[due], self._model.seed)
        goal = draw_all(self._law, words)
        banked = np.flatnonzero(due & self._bank.mine)
        if banked.size:
            cycles = np.broadcast_to(cycle, due.shape)[banked]
            goal[self._bank.mine[due]] = self._bank.draw(self._model, banked, cycles, crossing)
        return goal

    def _running(self, spikes: npt.NDArray[np.uint64]) -> Values:
        """Threshold of the current interval of each pixel, if it is not the first, (n,)
        electrons."""
        every = np.ones(spikes.shape, bool)
        cycles = (np.maximum(spikes, 2) >> np.uint64(1)) - np.uint64(1)
        return np.where(
            spikes & np.uint64(1) == 0,
            self._next(every, spikes, cycles, 0), self._next(every, spikes, cycles, 1),
        )  # fmt: skip

    def take_over(
        self, before: ReferencePixels, cycle: int, fresh: npt.NDArray[np.bool_], interval: int
    ) -> npt.NDArray[np.bool_] | None:
        """Continues the pixels of another threshold; see `RewrittenPixels`. Raises ValueError for
        a circuit, whose threshold is a voltage."""
        if self._circuit is not None:
            raise ValueError("a written threshold must be one without a circuit")
        model, state = self._model, before.state()
        latch = self._latches(cycle, 0)[self._rows, 0]
        # Light is integrated from the write on, unless a dead time runs beyond it.
        late = (state["tick"] >= latch) & ~fresh
        tick = np.where(late, state["tick"], latch)
        part = np.where(late, state["part"], 0.0)
        charge = np.where(fresh, 0.0, np.where(late, state["charge"], state["held"]))
        banked = self._bank.mine
        first = np.where(banked, np.uint64(2 * cycle), np.uint64(interval))
        spikes = np.where(fresh, first, state["spikes"])
        goal = np.where(spikes == 0, self._first_goals(), self._running(spikes))
        fires = None
        if model.reset == "residual":
            fires = charge >= goal
            excess = charge - goal
            whole = np.where(
                excess > ROOM * self._law.q, np.maximum(excess // self._law.q - JUMP, 0), 0
            )
            charge -= whole * self._law.q
            lost = whole.copy()
            spikes += np.where(banked, 0, whole).astype(np.uint64)
            due, crossing = fires, 1
            while due.any():
                charge[due] -= goal[due]
                lost[due] += 1
                spikes[due & ~banked] += np.uint64(1)
                spikes[due & banked] = 2 * (cycle + 1) + 1
                goal[due] = self._next(due, spikes, cycle, crossing)
                due, crossing = charge >= goal, crossing + 1
            dead = model.dead_time * float(self._clock.period) * PS
            away = np.where(fires, part + dead * lost, part)
            tick, part = tick + np.floor(away).astype(np.int64), away % 1.0
        held = np.where(late & (fires is None or ~fires), state["held"], charge)
        self._state = state | {
            "tick": tick, "part": part, "charge": charge, "goal": goal, "spikes": spikes,
            "held": held,
        }  # fmt: skip
        return fires

    def fraction(self) -> Values:
        """Charge at each pixel's last latch, as it is without timing noise, over the threshold of
        its current interval, including the overshoot; at most 1 with an overshoot, (n,)."""
        held = self._state["held"] - self._state["ahead"]
        fraction: Values = held / (self._state["goal"] + self._overshoot)
        return np.minimum(fraction, 1.0) if self._overshoot else fraction

    def pending(self) -> Values:
        """Share of a threshold, (n,), that dead times which last beyond a latch will still lose, at
        the light of that latch. The other tiers lose it in the cycle of the spike."""
        lost: Values = self._state["pending"] / (self._state["goal"] + self._overshoot)
        return lost

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The state that the next call depends on, as copies."""
        return {key: self._state[key].copy() for key in _KEYS}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self._state = {key: np.array(state[key], kind) for key, kind in _KEYS.items()}


def _rates(course: Any, pixels: npt.NDArray[np.intp], instants: npt.NDArray[np.int64]) -> Values:
    """Electrons a picosecond on pixels, (n,), each at its own instant, ps; course: `_course`."""
    begins, ends, starts, stops = course
    piece = np.minimum(np.searchsorted(ends, instants), ends.size - 1)
    share = np.maximum((instants - begins[piece]) / (ends - begins)[piece], 0)
    start = starts[pixels, piece]
    return np.asarray(start + (stops[pixels, piece] - start) * share)
