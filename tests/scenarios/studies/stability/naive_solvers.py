"""Naive ways through the stiff pixel: what cases 7, 8, 9, 13, 14, 15 and 21 of the stability suite
must catch. Each has the shape of the method that ships (see sensor/stability)."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from scipy.integrate import solve_ivp

from cosim import PS
from sensor.circuit.circuit import ELEMENTARY_CHARGE, Circuit
from sensor.circuit.phases import spike_train


def plain_log(circuit, knots, first, last, goals):  # type: ignore[no-untyped-def]
    """Case 7: log where log1p belongs."""
    rate, tau = first[0], circuit.leak
    one = goals[0] / rate if math.isinf(tau) else -tau * math.log(1 - goals[0] / (rate * tau))
    return np.arange(1, goals.size + 1) * one


def float32_time(circuit, knots, first, last, goals):  # type: ignore[no-untyped-def]
    """Case 7: instants in float32 seconds."""
    return spike_train(circuit, knots, first, last, goals).astype(np.float32)


def in_coulombs(circuit, knots, first, last, goals):  # type: ignore[no-untyped-def]
    """Cases 7 and 13: the charge in coulombs, at default tolerances."""
    e, times, start = ELEMENTARY_CHARGE, [], knots[0]

    def slope(t, n):  # type: ignore[no-untyped-def]
        light = first[0] + (last[0] - first[0]) * (t - knots[0]) / (knots[1] - knots[0])
        return [light * e - n[0] / circuit.leak]

    for goal in goals:
        full = lambda t, n, goal=goal: n[0] - goal * e  # noqa: E731
        full.terminal = True
        made = solve_ivp(slope, (start, knots[1]), [0.0], "LSODA", events=full)
        if not made.t_events[0].size:
            break
        times.append(made.t_events[0][0])
        start = times[-1] + circuit.reset_time
    return np.array(times)


def step_by_step(circuit, knots, first, last, goals):  # type: ignore[no-untyped-def]
    """Cases 13 and 14: charge over threshold, its sign looked at after each step of a solver."""
    slope_of = (last[0] - first[0]) / (knots[1] - knots[0])
    full = lambda t, n: n[0] - 1  # noqa: E731
    full.terminal = True
    made = solve_ivp(
        lambda t, n: [(first[0] + slope_of * t) / goals[0] - n[0] / circuit.leak],
        (knots[0], knots[1]), [0.0], "LSODA", events=full, rtol=1e-6,
    )  # fmt: skip
    return made.t_events[0][:1]


def _phases(circuit, knots, first, last, goals, unit, rtol, atol):  # type: ignore[no-untyped-def]
    """Integration, comparator and reset by a solver, restarted at each switch but not where the
    light changes. unit: of charge, in electrons."""
    times, now, charge = [], knots[0], 0.0
    leak, ohmic = circuit.leak, circuit.resistance * circuit.capacitance
    volt = circuit.gain / circuit.electrons * unit
    options = {"method": "LSODA", "rtol": rtol, "atol": atol}

    def light(t):  # type: ignore[no-untyped-def]
        i = min(int(np.searchsorted(knots, t, side="right")) - 1, first.size - 1)
        share = (t - knots[i]) / (knots[i + 1] - knots[i])
        return (first[i] + (last[i] - first[i]) * share) / unit

    for goal in goals / unit:
        full = lambda t, y, goal=goal: y[0] - goal  # noqa: E731
        tripped = lambda t, y: y[1] - circuit.trip  # noqa: E731
        full.terminal = tripped.terminal = True

        def waiting(t, y, goal=goal):  # type: ignore[no-untyped-def]
            return [light(t) - y[0] / leak, (volt * (y[0] - goal) - y[1]) / circuit.pole]

        made = solve_ivp(
            lambda t, y: [light(t) - y[0] / leak],
            (now, knots[-1]),
            [charge],
            events=full,
            **options,
        )
        if not made.t_events[0].size:
            break  # it stepped over the threshold
        begun = made.t_events[0][0]
        made = solve_ivp(waiting, (begun, begun + 1e-6), [goal, 0.0], events=tripped, **options)
        if not made.t_events[0].size:
            break
        times.append(made.t_events[0][0])
        made = solve_ivp(
            lambda t, y: [light(t) - y[0] / leak - y[0] / ohmic],
            (times[-1], times[-1] + circuit.reset_time), [made.y_events[0][0][0]], **options,
        )  # fmt: skip
        charge, now = made.y[0, -1], times[-1] + circuit.reset_time
    return np.array(times)


def through_the_step(circuit, knots, first, last, goals):  # type: ignore[no-untyped-def]
    """Case 8: tight tolerances, but no restart where the light steps."""
    return _phases(circuit, knots, first, last, goals, 1.0, 1e-10, 1e-8)


def phases_in_coulombs(circuit, knots, first, last, goals, tolerance):  # type: ignore[no-untyped-def]
    """Case 21: the charge in coulombs, the absolute tolerance as it comes."""
    return _phases(circuit, knots, first, last, goals, 1 / ELEMENTARY_CHARGE, tolerance, 1e-6)


def explicit(circuit: Circuit, knots, first, last, goals):  # type: ignore[no-untyped-def]
    """Case 15: Runge-Kutta through the closed switch."""
    calls, times, now, charge = 0, [], 0.0, 0.0
    enough = 20_000  # calls, after which it is given up
    ohmic = circuit.resistance * circuit.capacitance

    def slope(t, n):  # type: ignore[no-untyped-def]
        nonlocal calls
        calls += 1
        if calls > enough * goals.size:
            raise StopIteration
        return [first[0] - n[0] / ohmic]

    for goal in goals:
        now += (goal - charge) / first[0]
        times.append(now)
        try:
            made = solve_ivp(slope, (0, circuit.reset_time), [goal], "RK45", rtol=1e-9, atol=1e-6)
        except StopIteration:
            return spike_train(circuit, knots, first, last, goals), calls
        charge, now = made.y[0, -1], now + circuit.reset_time
    return np.array(times), calls


def flash_not_restarted(start: int, length: int, level: np.float32) -> Fraction:
    """Case 9: ten seconds of light as a function of time, through one call of a solver."""
    made = solve_ivp(
        lambda t, n: [float(level) * (start <= t * PS < start + length)],
        (0.0, 10.0), [0.0], "LSODA", rtol=1e-7, atol=1e-7,
    )  # fmt: skip
    return Fraction(float(made.y[0, -1]))
