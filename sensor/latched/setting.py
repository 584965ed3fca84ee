"""The setting of a spike camera: everything that decides its bits but the light."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any, Final

from cosim.clock import Clock
from cosim.light.radiometry import photons_per_lux
from cosim.plan.effects import Effect
from sensor.circuit import Circuit
from sensor.device.chips import Chip
from sensor.device.pattern import DevicePattern
from sensor.latched.effects import (
    EFFECTS,
    comparator_delay_effect,
    crosstalk_effect,
    dead_time_effect,
    leak_effect,
    overshoot_effect,
    pattern_effects,
    row_sampling_effect,
    threshold_noise_effect,
)
from sensor.latched.pixel.model import ExactModel, Reset

__all__ = ["CameraSetting"]

_CLEARANCE: Final = 1.1
"""Beyond what the effects may take."""
_SIZES: Final = (
    ("threshold noise", "threshold_noise", 0.0),
    ("reset dead time", "dead_time", 0.0),
    ("row-by-row sampling", "row_skew", 0.0),
    ("comparator delay", "comparator_delay", 0.0),
    ("optical cross-talk", "crosstalk", 0.0),
    ("comparator overshoot", "overshoot", 0.0),
    ("leak", "leak", 0.0),
)
"""Effects that a setting has by a size: (effect, field, what leaves it out)."""
_PATTERN: Final = (
    ("PRNU", ("prnu",)),
    ("dark current and DSNU", ("dark", "dsnu")),
    ("threshold FPN", ("threshold_fpn",)),
    ("hot and dead pixels", ("hot", "hot_current", "dead")),
)
"""The same of its pattern."""


@dataclass(frozen=True)
class CameraSetting:
    """chip: preset. clock: of the latches. threshold: electrons. seed: of the run, below 2^32.
    wavelength_nm: at which lux are counted as photons. effects: those kept. pattern: of the device,
    None for a perfect one. threshold_noise: electrons. reset: rule. dead_time: seconds after each
    spike in which light is lost, at most a cycle. row_skew: share of a cycle in which the rows are
    sampled one after another. comparator_delay: seconds, at most a cycle. crosstalk: share of its
    light that a pixel loses to its neighbours. circuit: of the pixel, for the reference tier; the
    others have its lumped form (`sensor.stiff.Circuit.lumped`): its reset in dead_time, `overshoot`
    electrons beyond each threshold, and `leak` electrons a second less than the light brings, right
    to a rate error of `lumped_error`."""

    chip: Chip
    clock: Clock
    threshold: float
    seed: int
    wavelength_nm: float = 555.0
    effects: tuple[Effect, ...] = tuple(EFFECTS.values())
    pattern: DevicePattern | None = None
    threshold_noise: float = 0.0
    reset: Reset = "residual"
    dead_time: float = 0.0
    row_skew: float = 0.0
    comparator_delay: float = 0.0
    crosstalk: float = 0.0
    circuit: Circuit | None = None
    overshoot: float = 0.0
    leak: float = 0.0
    lumped_error: float = 0.0

    @property
    def electrons_per_lux(self) -> float:
        """Photoelectrons a second for a lux on the pixel."""
        return self.chip.electrons_per_lux(photons_per_lux(self.wavelength_nm))

    def rate(self, lux: float) -> float:
        """Spikes a cycle (more than 1 saturates) under `lux` on the pixel."""
        gathered = lux * self.electrons_per_lux * float(self.clock.period)
        return gathered / (self.threshold + self.overshoot)

    @property
    def kept(self) -> tuple[Effect, ...]:
        """Every effect that acts in this setting."""
        made = list(self.effects)
        if self.reset != "residual":
            made = [e for e in made if e is not EFFECTS["residual carried"]]
        if self.threshold_noise > 0:
            made.append(threshold_noise_effect(self.threshold_noise))
        if self.dead_time > 0:
            made.append(dead_time_effect(self.dead_time * self.clock.hz))
        if self.row_skew > 0:
            made.append(row_sampling_effect(self.row_skew))
        if self.comparator_delay > 0:
            made.append(comparator_delay_effect(self.comparator_delay * self.clock.hz))
        if self.crosstalk > 0:
            made.append(crosstalk_effect(self.crosstalk))
        if self.overshoot:
            made.append(overshoot_effect(self.overshoot))
        if self.leak:
            made.append(leak_effect(self.leak * float(self.clock.period)))
        if self.pattern is not None:
            made += pattern_effects(self.pattern, float(self.clock.period))
        return tuple(made)

    def without(self, names: Collection[str]) -> CameraSetting:
        """The setting with these effects left out, named as in `kept`."""
        none: dict[str, Any] = {name: size for effect, name, size in _SIZES if effect in names}
        if self.pattern is not None:
            parts: dict[str, Any] = {
                n: 0.0 for effect, sizes in _PATTERN if effect in names for n in sizes
            }
            none["pattern"] = replace(self.pattern, **parts)
        left = tuple(e for e in self.effects if e.name not in names)
        return replace(self, effects=left, **none)

    @property
    def spread(self) -> float:
        """Standard deviation of an interval's threshold, relative, with every noise."""
        shot = self.threshold if EFFECTS["shot noise"] in self.effects else 0.0
        return math.sqrt(shot + self.threshold_noise**2) / self.threshold

    @property
    def slack(self) -> float:
        """Factor that dead time, overshoot, leak and the spread of gains (six deviations) together
        may take off a pixel's light; infinite where they may take all."""
        uneven = 0.0 if self.pattern is None else self.pattern.prnu + self.pattern.threshold_fpn
        if 6 * uneven >= 1:
            return math.inf
        late = 1 + max(self.overshoot, 0) / self.threshold + self.dead_time * self.clock.hz
        leaks = -self.leak * float(self.clock.period) / self.threshold
        return (late + leaks) / (1 - 6 * uneven) * _CLEARANCE

    @property
    def reach(self) -> tuple[int, int]:
        """Cycles before and after a block in which its light is needed as well."""
        return int(self.comparator_delay > 0), int(self.row_skew > 0)

    @property
    def model(self) -> ExactModel:
        return ExactModel(
            self.threshold,
            self.seed,
            self.effects,
            self.threshold_noise,
            self.reset,
            self.dead_time * self.clock.hz,
            self.overshoot,
        )
