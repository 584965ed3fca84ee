"""The catalogue of pixel effects: one line each, in the order in which reports print them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any, Final

from sensor.latched.effects.circuit import LEAK, OVERSHOOT
from sensor.latched.effects.crosstalk import CROSSTALK
from sensor.latched.effects.dead_time import DEAD_TIME
from sensor.latched.effects.drift import COMMON_DRIFT
from sensor.latched.effects.effect import Key, PixelEffect, Setting
from sensor.latched.effects.fixed_pattern import PATTERN_EFFECTS
from sensor.latched.effects.initial_charge import INITIAL_CHARGE
from sensor.latched.effects.residual import RESIDUAL
from sensor.latched.effects.row_timing import ROW_TIMING
from sensor.latched.effects.sampling import COMPARATOR_DELAY, ROW_SAMPLING
from sensor.latched.effects.shot_noise import SHOT_NOISE
from sensor.latched.effects.steering import CLOCK_STEERING
from sensor.latched.effects.threshold_noise import THRESHOLD_NOISE

CATALOGUE: Final[list[PixelEffect]] = [
    RESIDUAL,
    INITIAL_CHARGE,
    SHOT_NOISE,
    THRESHOLD_NOISE,
    DEAD_TIME,
    ROW_SAMPLING,
    COMPARATOR_DELAY,
    ROW_TIMING,
    CLOCK_STEERING,
    CROSSTALK,
    COMMON_DRIFT,
    OVERSHOOT,
    LEAK,
    *PATTERN_EFFECTS,
]
EFFECTS: Final = {effect.name: effect for effect in CATALOGUE if effect.inherent}
"""Inherent effects, which every pixel has, by name."""


def register(effect: PixelEffect) -> None:
    """Adds an effect to the catalogue. Its keys join the schema if it is registered before
    `sensor.sections.sensor` is imported. Raises ValueError if a name or key is already in use."""
    taken = {e.name for e in CATALOGUE} | set(defaults()) | {name for name, _ in all_keys()}
    names = {effect.name, *effect.parameters, *effect.keys, *effect.pattern_keys}
    if names & taken:
        raise ValueError(f"names of an effect must be new, not {sorted(names & taken)}")
    CATALOGUE.append(effect)


def all_keys() -> Iterator[tuple[str, Key]]:
    """All keys of [sensor] and of [sensor.pattern] that belong to effects."""
    for effect in CATALOGUE:
        yield from effect.keys.items()
        yield from effect.pattern_keys.items()


def silicon_sizes() -> dict[str, float]:
    """Value of every key under `sensor.preset = "silicon"`, by name; see `Key.silicon`."""
    return {name: key.silicon.value for name, key in all_keys() if key.silicon is not None}


def defaults() -> dict[str, Any]:
    """All parameters of a setting, with the values that mean that the effect is absent."""
    return {name: absent for effect in CATALOGUE for name, absent in effect.parameters.items()}


def acting(setting: Setting) -> list[PixelEffect]:
    """The effects that act in a setting."""
    return [effect for effect in CATALOGUE if effect.acts(setting)]


def named(names: Collection[str]) -> list[PixelEffect]:
    """The effects with these names; unknown names are ignored."""
    return [effect for effect in CATALOGUE if effect.name in names]
