"""Light in pieces between any knots, and the charge of each cycle from an exposure."""

from __future__ import annotations

import itertools

import numpy as np

from cosim import Light, Piece
from sensor.latched.exposure import Exposure


def level(shape: tuple[int, int], seed: int, peak: float = 700.0) -> np.ndarray:
    """A plane of random light up to `peak`."""
    return (np.random.default_rng(seed).random(shape) * peak).astype(np.float32)


def light_between(shape: tuple[int, int], knots: list[int], jumps: bool) -> Light:
    """Pieces between knots, every third of them constant. Without `jumps` they are continuous."""
    made: list[Piece] = []
    for n, (a, b) in enumerate(itertools.pairwise(knots)):
        first = level(shape, 2 * n) if jumps or not made else made[-1].last
        made.append(Piece(a, b, first, first if n % 3 == 2 else level(shape, 2 * n + 1)))
    return Light(tuple(made))


def charges(exposure: Exposure, light: Light, start: int, cycles: int) -> np.ndarray:
    """Charge of each cycle, (cycles, n) integers. Asserts that each cycle is in one span only."""
    rows = np.zeros((cycles, light.shape[0] * light.shape[1]), np.int64)
    filled = np.zeros(cycles, int)
    for span in exposure.spans(light, start, cycles):
        for i in range(span.cycles):
            slope = 0 if span.slope is None else span.slope * (span.elapsed + i)
            rows[span.first + i] = span.charge + slope
            filled[span.first + i] += 1
    assert (filled == 1).all()
    return rows
