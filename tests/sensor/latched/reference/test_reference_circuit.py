"""Reference pixels with a circuit: bits of closed-form spike trains, for any split of a run."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from cosim import PS, Clock, Light, Piece
from sensor.circuit.circuit import Circuit
from sensor.circuit.phases import spike_train
from sensor.circuit.solvers import solved_train
from sensor.latched.effects import EFFECTS, RESIDUAL
from sensor.latched.pixel.model import ExactModel
from sensor.latched.reference import ReferencePixels
from tests.sensor.latched.piecewise import light_between

CLOCK = Clock(40_000)
PERIOD = PS // 40_000
SHAPE, N, CYCLES = (4, 5), 20, 100
NUMBERS = np.arange(N, dtype=np.uint32)


def bits(words: np.ndarray, cycles: int) -> np.ndarray:
    return np.unpackbits(words.T.copy().view(np.uint8), axis=1, bitorder="little")[:, :cycles]


def course(light: Light, p: int, start: int, stop: int) -> tuple[np.ndarray, ...]:
    """Knots in seconds and light at both ends of pixel p from start to stop; before 0 as at 0."""
    knots, first, last = [], [], []
    for piece in light.pieces:
        a, b = max(piece.start, start), min(piece.stop, stop)
        if a >= b:
            continue
        u, w = float(piece.first.ravel()[p]), float(piece.last.ravel()[p])
        if not knots and start < 0:
            knots, first, last = [start], [u], [u]
        knots.append(a)
        first.append(u + (w - u) * (a - piece.start) / (piece.stop - piece.start))
        last.append(u + (w - u) * (b - piece.start) / (piece.stop - piece.start))
    return np.array([*knots, stop]) / PS, np.array(first), np.array(last)


def random_case(seed: int) -> tuple[Circuit, ExactModel, Light, float, np.ndarray]:
    random = np.random.default_rng(seed)
    q = float([50.0, 1000.0, 20_000.0][seed % 3])
    circuit = Circuit(
        1e-14, [0.0, 0.1][seed % 2], [math.inf, 1e-3][seed // 2 % 2], 1e3,
        10 ** random.uniform(9, 11), 0.5 * (seed % 3 > 0), 1e5 * (seed % 4 > 0),
        random.uniform(1e-8, 2e-6),
    )  # fmt: skip
    inner = np.unique(random.integers(1, (CYCLES + 2) * PERIOD, 8)).tolist()
    light = light_between(SHAPE, [0, *inner, (CYCLES + 3) * PERIOD], bool(seed % 2))
    gain = q * 10 ** random.uniform(-1.2, -0.2) * 40e3 / 700
    return circuit, ExactModel(q, 7, (RESIDUAL,)), light, gain, random.integers(-PERIOD, PERIOD, N)


@pytest.mark.parametrize("seed", range(6))
def test_the_bits_are_those_of_the_train_and_of_any_split(seed: int) -> None:
    circuit, model, light, gain, offsets = random_case(seed)
    made = ReferencePixels(model, NUMBERS, CLOCK, gain, None, offsets, circuit)
    whole = bits(made.expose(light, 1, CYCLES), CYCLES)
    split = ReferencePixels(model, NUMBERS, CLOCK, gain, None, offsets, circuit)
    parts = [
        bits(split.expose(light, 1 + a, b - a), b - a)
        for a, b in itertools.pairwise([0, 1, 17, 64, 90, CYCLES])
    ]
    assert np.array_equal(np.concatenate(parts, axis=1), whole)
    for key, value in made.state().items():
        assert np.array_equal(value, split.state()[key]), key
    assert (made.fraction() >= 0).all() and (made.fraction() <= 1).all()
    for p in range(N):
        start, stop = PERIOD + int(offsets[p]), (1 + CYCLES) * PERIOD + int(offsets[p])
        knots, first, last = course(light, p, start, stop)
        train = spike_train(
            circuit, knots, first * gain, last * gain, np.full(2000, model.threshold)
        )
        expected = np.zeros(CYCLES, np.uint8)
        latched = np.ceil((train * PS - start) / PERIOD).astype(int) - 1
        expected[np.clip(latched, 0, CYCLES - 1)] = 1
        assert np.array_equal(expected, whole[p])
    assert whole.sum() >= 50


def test_the_bits_are_those_of_cvode() -> None:
    circuit, model, light, gain, offsets = random_case(2)
    made = ReferencePixels(model, NUMBERS, CLOCK, gain, None, offsets, circuit)
    whole = bits(made.expose(light, 1, 40), 40)
    for p in (3, 11):
        start = PERIOD + int(offsets[p])
        knots, first, last = course(light, p, start, 41 * PERIOD + int(offsets[p]))
        train = solved_train(
            circuit, knots, first * gain, last * gain, np.full(60, model.threshold)
        )
        latched = np.ceil((train * PS - start) / PERIOD).astype(int) - 1
        assert np.array_equal(np.unique(latched), np.flatnonzero(whole[p]))
        assert latched.size >= 3


def test_a_circuit_without_faults_is_the_pixel_without_one() -> None:
    _, _, light, gain, offsets = random_case(1)
    model = ExactModel(1000.0, 7, tuple(EFFECTS.values()))
    ideal = ReferencePixels(model, NUMBERS, CLOCK, gain, None, offsets)
    given = ReferencePixels(model, NUMBERS, CLOCK, gain, None, offsets, Circuit(1e-14))
    assert np.array_equal(ideal.expose(light, 1, CYCLES), given.expose(light, 1, CYCLES))
    assert np.allclose(ideal.fraction(), given.fraction(), rtol=0, atol=1e-9)


@pytest.mark.parametrize("brightness", [0.1, 0.8, 300.0])
def test_a_reset_that_empties_the_pixel_is_dead_time(brightness: float) -> None:
    # Beyond saturation both skip whole intervals.
    rate = np.full((1, N), 1000.0 * 40e3, np.float32) * np.linspace(0.5, 1, N, dtype=np.float32)
    light = Light((Piece(0, PS, rate, rate),))
    share = 0.02 / max(brightness, 1)
    model = ExactModel(1000.0, 7, tuple(EFFECTS.values()), dead_time=share)
    dead = ReferencePixels(model, NUMBERS, CLOCK, brightness)
    circuit = Circuit(1e-14, reset_time=share / 40e3)
    model = ExactModel(1000.0, 7, tuple(EFFECTS.values()))
    reset = ReferencePixels(model, NUMBERS, CLOCK, brightness, None, None, circuit)
    assert np.array_equal(dead.expose(light, 0, 500), reset.expose(light, 0, 500))
    assert np.abs(
        dead.state()["spikes"].astype(float) - reset.state()["spikes"].astype(float)
    ).max() <= (0 if brightness < 1 else 500)


def test_a_hundred_thousand_lux_fire_in_every_cycle_at_their_inner_rate() -> None:
    # 7000 spikes a cycle (numerics.md, case 4): inner rate 1 / (Q / light + delay + reset).
    rate, q, cycles = 2.9e10, 100.0, 200
    circuit = Circuit(1e-14, 0.0, math.inf, 1e3, 1e12, 0.5, 0.0, 5e-11)
    plane = np.full((1, 3), rate, np.float32)
    made = ReferencePixels(
        ExactModel(q, 7, (RESIDUAL,)), NUMBERS[:3], CLOCK, 1.0, None, None, circuit
    )
    words = made.expose(Light((Piece(0, PS, plane, plane),)), 0, cycles)
    assert bits(words, cycles).all()
    steady = np.full(1, float(plane[0, 0]))
    train = spike_train(circuit, np.array([0.0, 1.0]), steady, steady, np.full(50, q))
    each = (train[-1] - train[0]) / 49
    assert each > q / rate + 5e-11
    count = made.state()["spikes"].astype(float)
    assert np.abs(count - cycles / 40e3 / each).max() <= 1.01
    assert count[0] > 3e5


def test_charge_that_the_resistance_holds_above_the_threshold_ends_in_bounded_work() -> None:
    # I R > threshold: the reset is incomplete, and comparator and switch limit the rate.
    circuit = Circuit(1e-15, 0.0, math.inf, 1e3, 1e10, 0.5, 1e9, 1e-8)
    plane = np.full((1, 2), 1e9, np.float32)
    made = ReferencePixels(
        ExactModel(100.0, 7, (RESIDUAL,)), NUMBERS[:2], CLOCK, 1.0, None, None, circuit
    )
    words = made.expose(Light((Piece(0, PS, plane, plane),)), 0, 64)
    assert bits(words, 64).all()
    assert (made.state()["spikes"] > 64 * 300).all()


def test_a_leak_that_wins_is_silent_for_ever() -> None:
    tau, q = 1e-3, 1000.0
    plane = (q / tau * np.array([[0.5, 0.999, 1.001]])).astype(np.float32)
    circuit = Circuit(1e-14, leak=tau)
    model = ExactModel(q, 7, (RESIDUAL,))
    made = ReferencePixels(model, NUMBERS[:3], CLOCK, 1.0, None, None, circuit)
    words = made.expose(Light((Piece(0, PS, plane, plane),)), 0, 4000)
    expected = 0.1 / (-tau * math.log1p(-q / (float(plane[0, 2]) * tau)))
    assert np.bitwise_count(words).sum(axis=0).tolist() == [0, 0, math.floor(expected)]
    assert made.fraction()[:2] == pytest.approx(plane[0, :2].astype(float) * tau / q, rel=1e-12)


def test_what_does_not_go_together_is_refused() -> None:
    for model in (ExactModel(5.0, 1, (), reset="hard"), ExactModel(5.0, 1, (), dead_time=0.1)):
        with pytest.raises(ValueError, match="a circuit must stand with reset 'residual'"):
            ReferencePixels(model, NUMBERS, CLOCK, 1.0, circuit=Circuit(1e-14))
    with pytest.raises(ValueError, match="nonlinearity must leave a quarter"):
        ReferencePixels(ExactModel(1e6, 1, ()), NUMBERS, CLOCK, 1.0, circuit=Circuit(1e-15, -0.5))
