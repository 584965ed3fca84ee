"""Cases 8, 15 and 21: light that steps within each phase of the stiff pixel, reset switches of any
speed, and solvers of differential equations that get better when they are asked to."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from decimal import Decimal, localcontext
from types import FrameType
from typing import Any, Final, NamedTuple

import numpy as np

from cosim.compute.opencl import Device
from cosim.run.case import Case
from sensor.circuit.circuit import Circuit
from sensor.circuit.phases import spike_train
from sensor.circuit.solvers import solved_train
from sensor.stability.circuits import DIGITS, FARAD, Q, Train, Values, shipped

# 8 -------------------------------------------------------------------------------------------

RATE: Final = 1e9
"""Electrons a second."""
STIFF: Final = Circuit(
    FARAD, leak=1e-2, gain=1e3, bandwidth=1e9, trip=0.5, resistance=1e6, reset_time=2e-8
)
"""Comparator of 160 ns that answers after about 70 ns; switch of 5 ns, closed for 20 ns."""


def light_steps(train: Train) -> float:
    """Largest relative error of six spikes against CVODE at 1e-12, where light steps up or down
    within integration, within the comparator's delay, within reset."""
    goals, stop = np.full(6, Q), 40 * Q / RATE
    quick = Circuit(FARAD, leak=STIFF.leak)
    knots, light = np.array([0.0, stop]), np.array([RATE])
    full = float(solved_train(quick, knots, light, light, goals[:1])[0])
    fired = float(solved_train(STIFF, knots, light, light, goals[:1])[0])
    worst = 0.0
    for at in (0.5 * full, 0.5 * (full + fired), fired + 0.5 * STIFF.reset_time):
        for factor in (0.2, 3.0):
            knots, light = np.array([0.0, at, stop]), np.array([RATE, factor * RATE])
            due = solved_train(STIFF, knots, light, light, goals, tolerance=1e-12)
            times = train(STIFF, knots, light, light, goals)
            if times.size != due.size or due.size != goals.size:
                return math.inf
            worst = max(worst, float(np.abs(times / due - 1).max()))
    return worst


# 15 ------------------------------------------------------------------------------------------


class Switch(NamedTuple):
    """The functions that the cases of stiff circuits call.

    Attributes:
        train: closed forms.
        solve: a solver, with the number of calls that it took.
    """

    train: Train
    solve: Callable[[Circuit, Values, Values, Values, Values], tuple[Values, int]]


def _counted(
    circuit: Circuit, knots: Values, first: Values, last: Values, goals: Values
) -> tuple[Values, int]:
    """CVODE, and calls of the right-hand side and of all else in its file."""
    where, calls = solved_train.__code__.co_filename, 0

    def count(frame: FrameType, event: str, given: Any) -> None:
        nonlocal calls
        calls += event == "call" and frame.f_code.co_filename == where

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        times = solved_train(circuit, knots, first, last, goals, tolerance=1e-9)
    finally:
        sys.setprofile(before)
    return times, calls


def _switch(device: Device | None) -> Switch:
    return Switch(spike_train, _counted)


def resets(switch: Switch, spikes: int = 10) -> float:
    """Most calls a spike that the solver takes, R_on C from 1 ps to 1 us; infinite where the closed
    forms are off by more than 1e-12 or the solver by more than 1e-7."""
    most, closed_for = 0.0, 1e-7
    for decade in range(-12, -5):
        tau = 10.0**decade
        circuit = Circuit(FARAD, resistance=tau / FARAD, reset_time=closed_for)
        knots = np.array([0.0, 2 * spikes * Q / RATE])
        light, goals = np.array([RATE]), np.full(spikes, Q)
        with localcontext() as context:
            context.prec = DIGITS
            ohmic = Decimal(circuit.resistance) * Decimal(circuit.capacitance)
            kept = (-Decimal(closed_for) / ohmic).exp()
            rest, at, due = Decimal(0), Decimal(0), []
            for _ in range(spikes):
                at += (Decimal(Q) - rest) / Decimal(RATE)
                due.append(at)
                rest = Decimal(Q) * kept + Decimal(RATE) * ohmic * (1 - kept)
                at += Decimal(closed_for)
            made, calls = switch.solve(circuit, knots, light, light, goals)
            for times, limit in ((switch.train(circuit, knots, light, light, goals), 1e-12),
                                 (made, 1e-7)):  # fmt: skip
                if times.size != spikes or any(
                    abs(Decimal(t) / d - 1) > Decimal(limit)
                    for t, d in zip(times.tolist(), due, strict=True)
                ):
                    return math.inf
        most = max(most, calls / spikes)
    return most


# 21 ------------------------------------------------------------------------------------------

Solve = Callable[[Circuit, Values, Values, Values, Values, float], Values]
"""Solver as `Train`, at a relative tolerance."""


def _solve(device: Device | None) -> list[Solve]:
    def by(solver: Any) -> Solve:
        def solve(
            circuit: Circuit,
            knots: Values,
            first: Values,
            last: Values,
            goals: Values,
            tolerance: float,
        ) -> Values:
            return solved_train(
                circuit, knots, first, last, goals, solver=solver, tolerance=tolerance
            )

        return solve

    return [by("LSODA"), by("CVODE")]


def halving(
    solvers: list[Solve], lights: tuple[float, ...] = (0.7, 1.0, 1.6), spikes: int = 8
) -> float:
    """Largest distance from 1 of the order e in error = C tol^e, over solvers, fitted to halvings
    of the tolerance from 6e-5 to 7e-12; infinite where the worst error of four halvings exceeds
    that of the four before. Spikes of fading light, against the closed forms."""
    tolerances = 2.0 ** -np.arange(14, 38)
    knots, goals = np.array([0.0, 20 * Q / RATE]), np.full(spikes, Q)
    worst = 0.0
    for solve in solvers:
        errors = np.zeros(tolerances.size)
        for factor in lights:
            first, last = np.array([factor * RATE]), np.array([0.8 * factor * RATE])
            due = spike_train(STIFF, knots, first, last, goals)
            for n, tolerance in enumerate(tolerances):
                times = solve(STIFF, knots, first, last, goals, float(tolerance))
                if times.size != due.size:
                    return math.inf
                errors[n] = max(errors[n], float(np.abs(times / due - 1).max()))
        if (np.diff(errors.reshape(-1, 4).max(axis=1)) > 0).any():
            return math.inf
        order = np.polyfit(np.log(tolerances), np.log(np.maximum(errors, 1e-16)), 1)[0]
        worst = max(worst, abs(float(order) - 1))
    return worst


SOLVING: Final = (
    Case(
        8,
        "light steps in every phase",
        "six spikes right where light steps within integration, comparator delay and reset",
        "CVODE at 1e-12, restarted at every step and switch",
        "a solver that is not restarted at the step",
        "relative",
        1e-10,
        light_steps,
        shipped,
    ),
    Case(
        15,
        "R_on C from 1 ps to 1 us",
        "steps of the solver bounded; its spikes right to 1e-7, the closed forms' to 1e-12",
        "closed recurrence in 50 digits",
        "explicit Runge-Kutta",
        "calls/spike",
        4000.0,
        resets,
        _switch,
        {"spikes": 3},
    ),
    Case(
        21,
        "halving the tolerance",
        "error does not grow, and falls as tolerance^1: LSODA and CVODE",
        "closed forms",
        "charge in coulombs with the default absolute tolerance",
        "|order - 1|",
        0.25,
        halving,
        _solve,
        {"lights": (1.0,), "spikes": 4},
    ),
)
