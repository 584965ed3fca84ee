"""Small sensors and lights for the tests of continuous photographing."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from cosim import Clock, Intensities, Light, Piece, join_intensities
from sensor import CHIPS
from sensor.continuous.camera import ContinuousCamera
from sensor.continuous.setting import ContinuousSetting, Converter

FINE = Converter(24, 6, 1e12)
"""Its steps are 4e-6 of a value: what it does cannot be mistaken for what the monitor does."""
TAU = 1e-4


def setting(shape: tuple[int, int] = (1, 4), **changed: Any) -> ContinuousSetting:
    chip = dataclasses.replace(CHIPS["spikeone"], height=shape[0], width=shape[1])
    given: dict[str, Any] = {
        "chip": chip,
        "clock": Clock(10**12),
        "seed": 1,
        "time_constant": TAU,
        "contrast": 0.1,
        "floor": 1.0,
        "converter": FINE,
        "noise": False,
    }
    return ContinuousSetting(**{**given, **changed})


def lux(current: Any, shape: tuple[int, int]) -> np.ndarray:
    """Light that makes this current (electrons/s) of a pixel, but for float32."""
    gain = setting(shape).electrons_per_lux
    return np.ascontiguousarray(np.broadcast_to(np.float32(np.asarray(current) / gain), shape))


def current(plane: np.ndarray) -> np.ndarray:
    """What current light makes, exactly."""
    return plane.astype(np.float64) * setting().electrons_per_lux


def light(knots: Sequence[tuple[int, Any, Any]], stop: int, shape: tuple[int, int]) -> Light:
    """Pieces that begin at ps with one current and end with another (None: constant)."""
    ends = [k[0] for k in knots[1:]] + [stop]
    pieces = []
    for (start, first, last), end in zip(knots, ends, strict=True):
        a = lux(first, shape)
        pieces.append(Piece(start, end, a, a if last is None else lux(last, shape)))
    return Light(tuple(pieces))


def run(camera: ContinuousCamera, given: Light, edges: Sequence[int]) -> Intensities:
    """The reports of the time between the first and last edge, in steps between all."""
    return join_intensities([camera.step(given, a, b) for a, b in pairwise(edges)])
