"""The stiff pixel by two general solvers that know nothing of its closed forms.

LSODA of scipy and CVODE of SUNDIALS step the same equations, phase by phase: restarted at every
event and at every knot of the light, time scaled by the phase and charge by the threshold, so that
no default tolerance meets a charge in coulombs. Unlike the compiled pixel they take C at the swing
of every instant, in the comparator's phase too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from sensor.circuit.circuit import Circuit

Values = npt.NDArray[np.float64]
Solver = Literal["LSODA", "Radau", "CVODE"]
_STEPS = 32
"""Steps at least in a phase within a piece of light, so that a rise above the threshold between two
of them is not stepped over."""


@dataclass(frozen=True)
class _Problem:
    """y' = slope(t, y) on 0..length until crossed(y) rises through zero, if it is given."""

    slope: Callable[[float, Values], list[float]]
    crossed: Callable[[float, Values], float] | None
    length: float
    start: list[float]


def _scipy(problem: _Problem, method: str, tolerance: float) -> tuple[float | None, Values]:
    from scipy.integrate import solve_ivp

    events = None
    if problem.crossed is not None:
        crossed = problem.crossed

        def event(t: float, y: Values) -> float:
            return crossed(t, y)

        event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
        events = event
    solution = solve_ivp(
        problem.slope, (0, problem.length), problem.start, method, events=events, rtol=tolerance,
        atol=tolerance * 1e-3, max_step=problem.length / _STEPS,
    )  # fmt: skip
    if not solution.success:
        raise RuntimeError(f"{method}: {solution.message}")
    if problem.crossed is not None and solution.t_events[0].size:
        return float(solution.t_events[0][0]), solution.y_events[0][0]
    return None, solution.y[:, -1]


def _cvode(problem: _Problem, tolerance: float) -> tuple[float | None, Values]:
    from sksundae.cvode import CVODE

    options: dict[str, Any] = {}
    if problem.crossed is not None:
        crossed = problem.crossed

        def event(t: float, y: Values, events: Values) -> None:
            events[0] = crossed(t, y)

        event.terminal, event.direction = [True], [1]  # type: ignore[attr-defined]
        options = {"eventsfn": event, "num_events": 1}

    def right(t: float, y: Values, yp: Values) -> None:
        yp[:] = problem.slope(t, y)

    solver = CVODE(
        right, rtol=tolerance, atol=tolerance * 1e-3, max_step=problem.length / _STEPS,
        max_num_steps=10**6, **options,
    )  # fmt: skip
    solution = solver.solve(np.array([0.0, problem.length]), np.array(problem.start))
    if not solution.success:
        raise RuntimeError(f"CVODE: {solution.message}")
    if problem.crossed is not None and solution.t_events is not None and len(solution.t_events):
        return float(solution.t_events[0]), solution.y_events[0]
    return None, solution.y[-1]


def _solve(problem: _Problem, solver: Solver, tolerance: float) -> tuple[float | None, Values]:
    if solver == "CVODE":
        return _cvode(problem, tolerance)
    return _scipy(problem, solver, tolerance)


def solved_train(
    circuit: Circuit,
    knots: Values,
    first: Values,
    last: Values,
    goals: Values,
    charge: float = 0.0,
    solver: Solver = "CVODE",
    tolerance: float = 1e-10,
) -> Values:
    """As `spike_train` of phases.py, by a solver at a relative tolerance."""
    a, electrons = circuit.nonlinearity, circuit.electrons
    ohmic = circuit.resistance * circuit.capacitance
    spikes: list[float] = []
    phase, volts, wait = 0, 0.0, 0.0

    def swing(n: float) -> float:
        linear = n / electrons
        return 2 * linear / (1 + math.sqrt(max(1 + 2 * a * linear, 0.0)))

    for i in range(first.size):
        begin, end = float(knots[i]), float(knots[i + 1])
        change = (last[i] - first[i]) / (end - begin)
        now = 0.0
        while len(spikes) < goals.size and now < end - begin:
            goal = float(goals[len(spikes)])
            rate = first[i] + change * now
            left = end - begin - now
            if phase == 0 and charge >= goal:
                phase, volts = 1, 0.0
            if phase == 1 and circuit.trip == 0:
                spikes.append(begin + now)
                phase, wait = 2, circuit.reset_time
                continue
            if phase == 2 and (wait == 0 or (ohmic == 0 and wait <= left)):
                charge = 0.0 if ohmic == 0 else charge
                now += wait
                phase, wait = 0, 0.0
                continue
            level = swing(goal)
            unit = left
            if phase == 1:
                speed = max((rate - level * electrons / circuit.leak) / electrons, 1e-300)
                c = circuit.trip / (circuit.gain * speed * circuit.pole)
                unit = min(left, 2 * circuit.pole * (1.5 * math.sqrt(2 * c) + 1 + c))
            elif phase == 2:
                unit = min(left, wait)
            elif rate > 0:
                unit = min(left, 2 * (goal - charge) / rate)

            def slope(t: float, y: Values, unit: float = unit, rate: float = rate,
                      goal: float = goal, phase: int = phase, level: float = level,
                      ramp: float = change,
                      ) -> list[float]:  # fmt: skip
                n = y[0] * goal
                v = swing(n)
                current = rate + ramp * t * unit - v * electrons / circuit.leak
                if phase == 2 and ohmic > 0:
                    current -= v * electrons / ohmic
                out = [current * unit / goal]
                if phase == 1:
                    over = circuit.gain * (v - level)
                    out.append((over / circuit.trip - y[1]) * unit / circuit.pole)
                return out

            start = [charge / goal] + ([volts / circuit.trip] if phase == 1 else [])
            crossed = None
            if phase < 2:
                crossed = lambda t, y, at=phase: y[at] - 1.0  # noqa: E731
            at, y = _solve(_Problem(slope, crossed, 1.0, start), solver, tolerance)
            charge = float(y[0]) * goal
            if phase == 1:
                volts = float(y[1]) * circuit.trip
            if at is None:
                now = end - begin if unit == left else now + unit
                if phase == 2:
                    wait -= unit
                    if wait <= 0:
                        phase, wait = 0, 0.0
                continue
            now += at * unit
            if phase == 0:
                charge, phase, volts = goal, 1, 0.0
            else:
                spikes.append(begin + now)
                phase, wait, volts = 2, circuit.reset_time, 0.0
    return np.array(spikes)
