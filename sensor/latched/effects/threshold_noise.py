"""Threshold noise: reset (kTC) and comparator noise, drawn anew for each spike.

One draw gives the sum of this normal variate and the Gamma variate of shot noise
(pixel/interval.py), so it adds no cost to shot noise. sqrt(kTC) is 28.4 electrons at 5 fF and 300
K.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Final

import numpy as np
from pydantic import Field

from cosim.compute.streams import Stream
from cosim.config.amounts import at_most
from cosim.config.quantity import Capacitance, Noise
from cosim.errors import InputError
from cosim.plan.effects import Bound, Summary
from sensor.circuit.circuit import ktc_electrons
from sensor.latched.effects.effect import Key, Operation, PixelEffect, Setting, Sized, noise_cost
from sensor.latched.effects.windows import bound_of, noise_error, shift_error
from sensor.latched.pixel.model import NOISIEST

_ZERO_CELSIUS: Final = 273.15
"""Kelvin at 0 degC."""


class _ThresholdNoise(PixelEffect):
    name = "threshold noise"
    source = "kTC: Johnson, Phys. Rev. 32:97, 1928; 0.5 to 1 % of Q fits a public recording"
    stream = Stream.SHOT_NOISE
    scope = "tile"
    group = "noise"
    parameters: ClassVar = {"threshold_noise": 0.0}
    keys: ClassVar = {
        "threshold_noise": Key(
            Noise,
            Field(default=0.0, examples=["5 e"], description="standard deviation, of each spike"),
            silicon=Sized(
                0.001,
                "assumed",
                "a recording of a 400 x 250 chip: 0.3 % of an interval at most, with shot noise",
            ),
            share_of_threshold=True,
            first=True,
        ),
        "capacitance": Key(
            Capacitance | None,
            Field(default=None, description="its kTC noise is added to the threshold noise"),
            reported=False,
            first=True,
        ),
    }

    def configure(self, section: Any, operation: Operation) -> Mapping[str, Any]:
        ktc, threshold = 0.0, operation.threshold
        if section.capacitance is not None:
            ktc = ktc_electrons(section.capacitance * 1e-15, operation.celsius + _ZERO_CELSIUS)
        noise = math.hypot(section.threshold_noise, ktc)
        if ktc >= threshold:  # it stays below NOISIEST by the ranges of the keys
            largest = at_most(section.capacitance * (threshold / ktc) ** 2, 3)
            raise InputError(
                "sensor.capacitance",
                f"at most {largest} fF, so that its kTC noise is within the threshold, "
                f"{threshold:g} e", f"{section.capacitance:g} fF", "lower it",
            )  # fmt: skip
        if noise > min(threshold, NOISIEST):
            limit = "the threshold" if threshold <= NOISIEST else f"{NOISIEST:g} e"
            less = f" less the kTC noise of {ktc:g} e" if ktc else ""
            most = at_most(math.sqrt(min(threshold, NOISIEST) ** 2 - ktc**2))
            raise InputError(
                "sensor.threshold_noise", f"at most {limit}{less}, {most} e",
                f"{section.threshold_noise:g} e", "lower it",
            )  # fmt: skip
        return {"threshold_noise": noise}

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # Independent draws of mean zero: over n intervals the count's spread is sqrt(n) sigma / Q.
        # The spikes move against their draws as a random walk.
        spread = setting.threshold_noise / scene.threshold
        walked = spread * np.sqrt(scene.brightest / scene.threshold * scene.cycles)
        return bound_of(scene, noise_error(scene, spread) + shift_error(scene, walked), False)

    def cost(self, scene: Summary) -> Any:
        return noise_cost(scene)

    def threshold_noise(self, setting: Setting) -> float:
        return float(setting.threshold_noise)


THRESHOLD_NOISE = _ThresholdNoise()
