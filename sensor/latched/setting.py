"""The setting of a spike camera: everything that decides its bits but the light."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light.light import Light
from cosim.light.radiometry import photons_per_lux
from cosim.plan.effects import Effect
from sensor.device.chips import Chip
from sensor.device.pattern import FixedPattern
from sensor.latched.effects.catalogue import EFFECTS, acting, defaults, named
from sensor.latched.effects.effect import PixelEffect
from sensor.latched.effects.shot_noise import SHOT_NOISE
from sensor.latched.pixel.model import ExactModel, Reset

__all__ = ["CameraSetting"]

_CLEARANCE: Final = 1.1
"""Beyond what the effects may take."""


@dataclass(frozen=True, init=False)
class CameraSetting:
    """A spike camera as it is operated. Parameters of effects are attributes as well, such as
    `setting.dead_time`, and arguments of the constructor and of `dataclasses.replace`.

    Attributes:
        chip: preset.
        clock: of the latches.
        threshold: electrons.
        seed: of the run, below 2^32.
        wavelength_nm: at which lux are counted as photons.
        effects: of those that every pixel has, the ones that are kept; all unless given.
        reset: what becomes of charge beyond the threshold.
        parameters: of the other effects, by name; an effect that is absent has its default there.
            Those of the effects that ship (sensor/latched/effects/) are:
            pattern: `DevicePattern`, None for a perfect device.
            threshold_noise: electrons.
            dead_time: seconds after each spike in which light is lost, at most a cycle.
            row_skew: share of a cycle in which the rows are sampled one after another.
            comparator_delay: seconds, at most a cycle.
            crosstalk: share of its light that a pixel loses to its neighbours.
            circuit: of the pixel, for the reference tier, None for none. The other tiers have its
                lumped form: its reset in dead_time, `overshoot` electrons beyond each threshold,
                `leak` electrons a second less than the light brings, with a relative error of the
                rate of at most `lumped_error`.
    """

    chip: Chip
    clock: Clock
    threshold: float
    seed: int
    wavelength_nm: float
    effects: tuple[PixelEffect, ...]
    reset: Reset
    parameters: Mapping[str, Any] = field(hash=False)

    def __init__(
        self,
        chip: Chip,
        clock: Clock,
        threshold: float,
        seed: int,
        wavelength_nm: float = 555.0,
        effects: tuple[PixelEffect, ...] | None = None,
        reset: Reset = "residual",
        parameters: Mapping[str, Any] | None = None,
        **sizes: Any,
    ) -> None:
        absent = defaults()
        given = dict(parameters or {}) | sizes
        unknown = given.keys() - absent.keys()
        if unknown:
            raise TypeError(f"parameters must be of {sorted(absent)}, not {sorted(unknown)}")
        if effects is None:
            effects = tuple(EFFECTS.values())
        self.__dict__.update(
            chip=chip, clock=clock, threshold=threshold, seed=seed, wavelength_nm=wavelength_nm,
            effects=effects, reset=reset, parameters=absent | given,
        )  # fmt: skip

    def __getattr__(self, name: str) -> Any:
        """A parameter of an effect."""
        parameters = self.__dict__.get("parameters", {})
        if name not in parameters:
            raise AttributeError(f"a camera's setting has no {name}")
        return parameters[name]

    @property
    def electrons_per_lux(self) -> float:
        """Photoelectrons a second for a lux on the pixel."""
        return self.chip.electrons_per_lux(photons_per_lux(self.wavelength_nm))

    def rate(self, lux: float) -> float:
        """Spikes a cycle (more than 1 saturates) under `lux` on the pixel."""
        gathered = lux * self.electrons_per_lux * float(self.clock.period)
        return gathered / self.model.mean

    def transferred(self, electrons: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Electrons of a cycle after the transfers, from those before."""
        for transfer in self.model.transfers:
            electrons = transfer.share(electrons / self.threshold) * self.threshold
        return electrons

    @property
    def kept(self) -> tuple[Effect, ...]:
        """Every effect that acts in this setting."""
        return tuple(effect.planned(self) for effect in acting(self))

    def without(self, names: Iterable[str]) -> CameraSetting:
        """The setting with these effects left out, named as in `kept`."""
        names = frozenset(names)
        left = replace(self, effects=tuple(e for e in self.effects if e.name not in names))
        for effect in named(names):
            left = left.changed(**effect.removed(left))
        return left

    def changed(self, **sizes: Any) -> CameraSetting:
        """The setting with these parameters of effects."""
        return replace(self, parameters={**self.parameters, **sizes})

    @property
    def spread(self) -> float:
        """Standard deviation of an interval's threshold, relative, with every noise."""
        shot = self.threshold if SHOT_NOISE in self.effects else 0.0
        return math.sqrt(shot + self.model.threshold_noise**2) / self.threshold

    @property
    def slack(self) -> float:
        """Factor that dead time, overshoot, leak, transfers and the spread of gains (six
        deviations) together may take off a pixel's light; infinite where they may take all."""
        uneven = 0.0 if self.pattern is None else self.pattern.prnu + self.pattern.threshold_fpn
        least = math.prod(transfer.least for transfer in self.model.transfers)
        if 6 * uneven >= 1 or least <= 0:
            return math.inf
        model = self.model
        late = 1 + max(model.shift, 0) / self.threshold + model.dead_time
        leaks = -self.lumped_dark * float(self.clock.period) / self.threshold
        return float((late + leaks) / ((1 - 6 * uneven) * least) * _CLEARANCE)

    @property
    def reach(self) -> tuple[int, int]:
        """Cycles before and after a block in which its light is needed as well."""
        reaches = [effect.reach for effect in acting(self)]
        return max((r[0] for r in reaches), default=0), max((r[1] for r in reaches), default=0)

    @property
    def model(self) -> ExactModel:
        """The pixel with its circuit lumped."""
        effects = acting(self)
        transfers = (effect.transfer(self) for effect in effects)
        return ExactModel(
            self.threshold,
            self.seed,
            self.effects,
            math.hypot(*(effect.threshold_noise(self) for effect in effects)),
            self.reset,
            sum(effect.dead_time(self) for effect in effects) * self.clock.hz,
            sum(effect.threshold_shift(self) for effect in effects),
            tuple(transfer for transfer in transfers if transfer is not None),
        )

    @property
    def lumped_dark(self) -> float:
        """Electrons a second that the exact and the fast tier add for all effects together."""
        return sum(effect.lumped_dark(self) for effect in acting(self))

    @property
    def light_map(self) -> Callable[[Light], Light] | None:
        """Map of the light on the pixels, None for none."""
        maps = [m for m in (effect.light_map(self) for effect in acting(self)) if m is not None]
        if len(maps) < 2:
            return maps[0] if maps else None

        def chained(light: Light) -> Light:
            for step in maps:
                light = step(light)
            return light

        return chained

    @property
    def sampling_offsets(self) -> npt.NDArray[np.int64] | None:
        """Picoseconds from a latch edge to the sampling instant of each row of the chip,
        (height,), None where all rows are sampled at the edge."""
        effects = [effect for effect in acting(self) if effect.reach != (0, 0)]
        if not effects:
            return None
        late = np.zeros(self.chip.height)
        for effect in effects:
            late = late + effect.sampling(self)
        return np.rint(late).astype(np.int64)

    def fixed_pattern(self, numbers: npt.NDArray[np.uint32], lumped: bool) -> FixedPattern | None:
        """Gains and dark currents of pixels with these numbers, None where all are nominal.

        lumped: whether `lumped_dark` is part of it; a lumped leak is a dark current below zero.
        """
        patterns = [effect.fixed_pattern(self, numbers) for effect in acting(self)]
        parts = [pattern for pattern in patterns if pattern is not None]
        if self.pattern is not None:
            parts.insert(0, self.pattern.at(numbers))
        dark = self.lumped_dark if lumped else 0.0
        if not parts:
            if not dark:
                return None
            return FixedPattern(np.ones(numbers.size), np.full(numbers.size, dark))
        whole = parts[0]
        for part in parts[1:]:
            whole = FixedPattern(whole.gain * part.gain, whole.dark + part.dark)
        return whole if not dark else FixedPattern(whole.gain, whole.dark + dark)
