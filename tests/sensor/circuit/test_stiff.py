"""The stiff pixel: closed forms against their equations and against two general solvers."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest

from sensor.circuit.circuit import Circuit
from sensor.circuit.closed import comparator_delay, crossing_time, phi, relaxed
from sensor.circuit.phases import relax, spike_train
from sensor.circuit.solvers import solved_train

CLAIM = 1e-7
"""Of a mean interval: what the closed forms promise of a spike's instant where C is constant."""


def trains(circuit: Circuit, light: tuple, goals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The train by closed forms and by CVODE; CVODE and LSODA agree ten times tighter than the
    claim, in units of the mean interval of light."""
    knots, first, last = light
    found = spike_train(circuit, knots, first, last, goals)
    cvode, lsoda = (
        solved_train(circuit, knots, first, last, goals, solver=name, tolerance=3e-11)
        for name in ("CVODE", "LSODA")
    )
    unit = goals.mean() / np.maximum(first, last).max()
    assert cvode.size == lsoda.size
    assert np.abs(cvode - lsoda).max(initial=0) < CLAIM / 10 * unit
    assert found.size == cvode.size
    return found / unit, cvode / unit


@pytest.mark.parametrize("c", [1e-14, 1e-9, 9.9e-5, 1.01e-4, 1e-2, 0.5, 3.0, 40.0, 1e5])
def test_the_comparators_delay_solves_its_equation(c: float) -> None:
    with localcontext() as context:
        context.prec = 60
        x = Decimal(comparator_delay(c))
        # Its slope 1 - exp(-x) turns the miss in c into one in x.
        miss = (x - 1 + (-x).exp() - Decimal(c)) / (1 - (-x).exp())
        assert abs(miss / x) < (1e-15 if c < 1e-4 else 4e-14)


def test_phi_is_its_integral_at_any_size() -> None:
    with localcontext() as context:
        context.prec = 80
        for z in (0.0, 1e-300, 1e-9, 0.1, 0.999, 1.0, 7.0, 1e4):
            value, factorial = (-Decimal(z)).exp(), Decimal(1)
            for k in (1, 2, 3):
                value = (1 / factorial - value) / Decimal(z) if z > 1e-20 else 1 / (factorial * k)
                factorial *= k
                assert phi(k, z) == pytest.approx(float(value), rel=4e-15)


class TestLeak:
    def test_a_leak_of_1e15_seconds_is_none_to_its_last_digit(self) -> None:
        without = crossing_time(50.0, 0.0, math.inf, 0.0, 1000.0, math.inf)
        with_it = crossing_time(50.0, 0.0, 1e15, 0.0, 1000.0, math.inf)
        # t (1 + t / (2 tau)): the plain form with log loses five digits here.
        assert with_it == pytest.approx(without * (1 + without / 2e15), rel=4e-16)

    def test_equilibrium_just_above_and_below_the_threshold(self) -> None:
        tau, goal = 1e-3, 1000.0
        above = crossing_time(goal / tau * (1 + 1e-12), 0.0, tau, 0.0, goal, math.inf)
        assert above == pytest.approx(tau * math.log(1e12), rel=1e-5)
        assert crossing_time(goal / tau * (1 - 1e-12), 0.0, tau, 0.0, goal, math.inf) == math.inf
        assert crossing_time(goal / tau, 0.0, tau, 0.0, goal, math.inf) == math.inf

    @pytest.mark.parametrize("tau", [1e-3, 0.2, math.inf])
    def test_a_rise_that_only_grazes_the_threshold_is_found(self, tau: float) -> None:
        rate, slope = 1e4, -4e4
        top = rate / 4e4 if tau == math.inf else tau * math.log1p(rate / (4e4 * tau))
        peak = relaxed(rate, slope, tau, 0.0, top)
        found = crossing_time(rate, slope, tau, 0.0, peak * (1 - 1e-13), 1.0)
        assert found == pytest.approx(top, rel=1e-5)
        assert found <= top
        assert crossing_time(rate, slope, tau, 0.0, peak * (1 + 1e-13), 1.0) == math.inf

    def test_light_that_first_loses_to_the_leak_and_then_wins(self) -> None:
        t = crossing_time(0.0, 1e6, 0.01, 90.0, 100.0, 1.0)
        assert relaxed(0.0, 1e6, 0.01, 90.0, t) == pytest.approx(100.0, rel=1e-14)
        assert relaxed(0.0, 1e6, 0.01, 90.0, 0.9 * t) < 100.0

    def test_a_changing_capacitance_under_steady_light_has_its_closed_form(self) -> None:
        # t = C0/G [(1 + a I/G) L - a V], L = -log(1 - G V / I), of C0 (1 + a V) V' = I - G V.
        a, electrons, tau, rate, goal = 0.3, 6e4, 2e-3, 4e7, 5e4
        linear = goal / electrons
        swing = 2 * linear / (1 + math.sqrt(1 + 2 * a * linear))
        drive = rate / electrons * tau
        expected = tau * (-(1 + a * drive) * math.log1p(-swing / drive) - a * swing)
        t, charge = relax(rate, 0.0, tau, a, electrons, 0.0, goal, 1.0)
        assert t == pytest.approx(expected, rel=1e-13)
        assert charge == goal
        # And far beyond its time constant it rests where the leak takes all light.
        _, rest = relax(rate / 40, 0.0, tau, a, electrons, 0.0, math.inf, 1e6)
        level = drive / 40
        assert rest == pytest.approx(electrons * level * (1 + a * level / 2), rel=1e-14)


@pytest.mark.parametrize("seed", range(6))
def test_random_circuits_and_light_agree_with_both_solvers(seed: int) -> None:
    random = np.random.default_rng(seed)
    q, base = 10 ** random.uniform(2, 4.3), 10 ** random.uniform(3, 9)
    interval = q / base
    circuit = Circuit(
        capacitance=10 ** random.uniform(-15, -13.5),
        nonlinearity=[0.0, 0.1, -0.05][seed % 3] * (seed % 2),
        leak=[math.inf, interval * 10 ** random.uniform(0.1, 2)][seed % 2],
        gain=10 ** random.uniform(2, 4),
        bandwidth=10 ** random.uniform(7, 10) / interval * 1e-6,
        trip=1.0 if seed % 2 == 0 or seed == 3 else 0.0,
        resistance=10 ** random.uniform(3, 5) * interval / 1e-6,
        reset_time=interval * 10 ** random.uniform(-3, -1),
    )
    knots = np.concatenate([[0], np.sort(random.random(4)), [1]]) * 8 * interval
    first = base * 10 ** random.uniform(-1, 1, 5)
    last = np.where(random.random(5) < 0.4, first, base * 10 ** random.uniform(-1, 1, 5))
    goals = q * random.uniform(0.8, 1.2, 8)
    found, solved = trains(circuit, (knots, first, last), goals)
    assert found.size >= 3
    assert np.abs(found - solved).max() < CLAIM


@pytest.mark.parametrize("phase", ["integrate", "delay", "reset"])
@pytest.mark.parametrize("leak", [math.inf, 3e-6])
def test_a_light_step_within_each_phase(phase: str, leak: float) -> None:
    circuit = Circuit(1e-14, 0.0, leak, 1e3, 1e9, 0.5, 1e6, 3e-8)
    calm = np.array([0.0, 1e-4]), np.array([2e9]), np.array([2e9])
    goals = np.full(6, 1000.0)
    fired = spike_train(circuit, *calm, goals)
    at = {"integrate": 0.6, "delay": 1 - 1e-2, "reset": 1.02}[phase]
    instant = fired[2] + (fired[3] - fired[2]) * (at - (at > 1))
    if phase == "delay":
        instant = fired[3] - 1e-8
    if phase == "reset":
        instant = fired[2] + 1e-8
    knots = np.array([0.0, instant, 1e-4])
    first, last = np.array([2e9, 7e9]), np.array([2e9, 7e8])
    found, solved = trains(circuit, (knots, first, last), goals)
    assert found.size == 6
    assert np.abs(found - solved).max() < CLAIM
    assert abs(found[-1] * 1000 / 7e9 - fired[-1]) > 1e-7


@pytest.mark.parametrize("ohm", [1e2, 1e4, 1e6, 1e8])
def test_resets_from_a_picosecond_to_a_microsecond(ohm: float) -> None:
    # R C = ohm x 10 fF; the reset lasts 10 ns, so the slowest leaves 99 % of the charge.
    circuit = Circuit(1e-14, 0.0, math.inf, 1e3, 1e10, 0.3, ohm, 1e-8)
    light = np.array([0.0, 1e-5]), np.array([3e9]), np.array([3e9])
    found, solved = trains(circuit, light, np.full(5, 900.0))
    assert found.size == 5
    assert np.abs(found - solved).max() < CLAIM


def test_flashes_in_ten_seconds_of_dark_are_not_missed() -> None:
    circuit = Circuit(1e-14, 0.0, 1e3, 1e4, 1e9, 0.5, 1e4, 1e-8)
    for width in (1e-9, 1e-6):
        knots = np.array([0.0, 5.0, 5.0 + width, 10.0])
        flash = np.array([0.0, 150 / width, 0.0])
        train = spike_train(circuit, knots, flash, flash, np.full(5, 100.0))
        assert train.size == 1
        assert 5.0 < train[0] < 5.0 + 1e-6 + width


def test_a_changing_capacitance_costs_the_delay_what_the_overdrive_changes_of_it() -> None:
    # C is taken at the threshold during the delay: off by nonlinearity x overdrive of the delay.
    circuit = Circuit(1e-14, 0.2, math.inf, 1e2, 1e8, 1.0, 0.0, 1e-7)
    light = np.array([0.0, 1e-4]), np.array([4e9]), np.array([4e9])
    goals = np.full(4, 20_000.0)
    found = spike_train(circuit, *light, goals)
    solved = solved_train(circuit, *light, goals, tolerance=1e-11)
    ideal = goals[0] / 4e9
    delay = found[0] - ideal
    speed = 4e9 / circuit.electrons / (1 + 0.2 * circuit.swing(goals[0]))
    overdrive = speed * delay
    assert delay > 1e-8
    assert 0 < abs(solved[0] - found[0]) < 0.2 * overdrive * delay


def test_circuits_that_cannot_be_are_refused() -> None:
    for wrong, says in (
        ({"capacitance": 0.0}, "capacitance must be above 0, not 0"),
        ({"leak": -1.0}, "leak must be above 0"),
        ({"trip": math.nan}, "trip must be 0 or more"),
        ({"resistance": 1e3}, "reset_time must be above 0 where there is a resistance"),
        ({"trip": 1.0, "leak": 1e-5}, "leak must be at least .* s, 4 time constants"),
        ({"gain": math.inf}, "gain must be finite"),
    ):
        with pytest.raises(ValueError, match=says):
            Circuit(**({"capacitance": 1e-14} | wrong))
    with pytest.raises(ValueError, match="nonlinearity must leave a quarter of C"):
        Circuit(1e-15, -0.2).swing(1e6)
