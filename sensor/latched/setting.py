"""The setting of a spike camera: everything but the light that determines its bits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.light.light import Light
from cosim.light.radiometry import photons_per_lux
from cosim.plan.effects import Effect
from cosim.plan.tiles import TileGrid
from sensor.device.chips import Chip
from sensor.device.pattern import FixedPattern
from sensor.latched.effects.catalogue import EFFECTS, acting, defaults, named
from sensor.latched.effects.effect import CommonGain, PixelEffect
from sensor.latched.effects.shot_noise import SHOT_NOISE
from sensor.latched.pixel.model import ExactModel, Reset
from sensor.latched.writes import Phase, Registers, Write, phases_of

_CLEARANCE: Final = 1.1
"""Safety factor of `CameraSetting.slack`."""


@dataclass(frozen=True, init=False)
class CameraSetting:
    """A spike camera and its operating point. Parameters of effects are attributes as well, such
    as `setting.dead_time`, and arguments of the constructor and of `dataclasses.replace`.

    Attributes:
        chip: preset of the chip.
        clock: clock of the latches.
        threshold: electrons.
        seed: seed of the run, below 2^32.
        wavelength_nm: wavelength at which lux is converted to photons.
        effects: the inherent effects that are kept, by default all of them.
        reset: rule for the charge beyond the threshold.
        parameters: parameters of the other effects, by name; an absent effect has its default.
            The effects in sensor/latched/effects/ have these:
            pattern: `DevicePattern`, None for a perfect device.
            threshold_noise: electrons.
            dead_time: seconds after each spike during which light is lost, at most a cycle.
            row_skew: share of a cycle over which the rows are sampled one after another.
            comparator_delay: seconds, at most a cycle.
            row_timing: `RowTiming`, None for sampling instants without noise.
            clock_moves: `ClockMoves` of a steered clock, None for ticks of one length.
            crosstalk: share of its light that a pixel loses to its neighbours.
            drift: RMS of the gain that all pixels have in common.
            circuit: circuit of the pixel, for the reference tier, None for none. The other tiers
                use its lumped form: its reset in dead_time, `overshoot` electrons beyond each
                threshold, and a dark current of `leak` electrons a second, below 0. The lumped
                form changes the rate by at most `lumped_error`, relative.
        writes: writes to the registers during the run, in the order of their cycles.
    """

    chip: Chip
    clock: Clock
    threshold: float
    seed: int
    wavelength_nm: float
    effects: tuple[PixelEffect, ...]
    reset: Reset
    parameters: Mapping[str, Any] = field(hash=False)
    writes: tuple[Write, ...] = ()

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
        writes: tuple[Write, ...] = (),
        **sizes: Any,
    ) -> None:
        absent = defaults()
        chosen = dict(parameters or {}) | sizes
        unknown = chosen.keys() - absent.keys()
        if unknown:
            raise TypeError(f"parameters must be of {sorted(absent)}, not {sorted(unknown)}")
        if effects is None:
            effects = tuple(EFFECTS.values())
        self.__dict__.update(
            chip=chip, clock=clock, threshold=threshold, seed=seed, wavelength_nm=wavelength_nm,
            effects=effects, reset=reset, parameters=absent | chosen, writes=writes,
        )  # fmt: skip

    def __getattr__(self, name: str) -> Any:
        """A parameter of an effect."""
        parameters = self.__dict__.get("parameters", {})
        if name not in parameters:
            raise AttributeError(f"a camera's setting has no {name}")
        return parameters[name]

    @cached_property
    def _acting(self) -> list[PixelEffect]:
        """The effects that act."""
        return acting(self)

    @property
    def electrons_per_lux(self) -> float:
        """Photoelectrons a second per lux on the pixel."""
        return self.chip.electrons_per_lux(photons_per_lux(self.wavelength_nm))

    def rate(self, lux: float) -> float:
        """Spikes a cycle under `lux` on the pixel; above 1 the pixel saturates."""
        gathered = lux * self.electrons_per_lux * float(self.clock.period)
        return gathered / self.model.mean

    def transfer(self, electrons: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Electrons of a cycle after the transfers, from the electrons before."""
        for transfer in self.model.transfers:
            electrons = transfer.share(electrons / self.threshold) * self.threshold
        return electrons

    @property
    def phases(self) -> tuple[Phase, ...]:
        """The registers between the writes."""
        return phases_of(self.writes, self.threshold, self.chip.height)

    @property
    def registers(self) -> Registers | None:
        """Thresholds and windows of the run; None without writes."""
        if not self.writes:
            return None
        return Registers(self.phases, self.threshold, self.chip.height)

    @property
    def levels(self) -> tuple[CameraSetting, ...]:
        """The setting at each threshold of the run, without writes."""
        thresholds = dict.fromkeys(phase.threshold for phase in self.phases)
        return tuple(replace(self, threshold=level, writes=()) for level in thresholds)

    @property
    def acting_effects(self) -> tuple[Effect, ...]:
        """The effects that act in this setting."""
        return tuple(effect.planned(self) for effect in self._acting)

    def without(self, names: Iterable[str]) -> CameraSetting:
        """The setting without these effects, which are named as in `acting_effects`."""
        names = frozenset(names)
        left = replace(self, effects=tuple(e for e in self.effects if e.name not in names))
        for effect in named(names):
            left = left.changed(**effect.removed(left))
        return left

    def changed(self, **sizes: Any) -> CameraSetting:
        """The setting with these parameters of effects changed."""
        return replace(self, parameters={**self.parameters, **sizes})

    @property
    def lumped(self) -> CameraSetting:
        """The setting with the lumped form of its circuit in all tiers."""
        return self if self.circuit is None else self.changed(circuit=None)

    @property
    def spread(self) -> float:
        """Relative standard deviation of an interval's threshold, from all noise sources."""
        shot = self.threshold if SHOT_NOISE in self.effects else 0.0
        return math.sqrt(shot + self.model.threshold_noise**2) / self.threshold

    @property
    def uneven(self) -> float:
        """Relative standard deviation of the gains of pixels: an upper limit, as those of all
        effects are added."""
        return float(sum(effect.gain_spread(self) for effect in self._acting))

    @property
    def slack(self) -> float:
        """Largest factor by which dead time, overshoot, leak, transfers and the spread of gains
        (six standard deviations) together can reduce a pixel's light; infinite if they can remove
        all of it."""
        uneven = self.uneven
        least = math.prod(transfer.least for transfer in self.model.transfers)
        if 6 * uneven >= 1 or least <= 0:
            return math.inf
        model = self.model
        longer = 1 + max(model.shift, 0) / self.threshold + model.dead_time
        leaks = -self.lumped_dark * float(self.clock.period) / self.threshold
        return float((longer + leaks) / ((1 - 6 * uneven) * least) * _CLEARANCE)

    @property
    def reach(self) -> tuple[int, int]:
        """Cycles before and after a block whose light the block needs as well. Effects that move
        the sampling instants add up."""
        reaches = [effect.reach for effect in self._acting]
        return sum(r[0] for r in reaches), sum(r[1] for r in reaches)

    @cached_property
    def model(self) -> ExactModel:
        """The pixel, with the lumped form of its circuit."""
        effects = self._acting
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
        """Electrons a second that the exact and the fast tier add, summed over all effects."""
        return sum(effect.lumped_dark(self) for effect in self._acting)

    @property
    def dark_charge(self) -> float:
        """Electrons a cycle that a pixel gathers in the dark, up to four standard deviations."""
        return sum(effect.dark_charge(self) for effect in self._acting)

    def dark_excess(self, numbers: npt.NDArray[np.uint32]) -> npt.NDArray[np.float64] | None:
        """Electrons a cycle that single pixels with these numbers gather in the dark beyond
        `dark_charge`, (n,); None if no pixel does."""
        parts = [effect.dark_excess(self, numbers) for effect in self._acting]
        known = [part for part in parts if part is not None]
        return sum(known[1:], known[0]) * float(self.clock.period) if known else None

    @cached_property
    def uneven_tiles(self) -> tuple[npt.NDArray[np.float64] | None, npt.NDArray[np.float64]]:
        """What differs between the tiles of the chip, (tiles,) each, the most of each: the
        `dark_excess` of its pixels, None if no pixel has any, and the RMS move of the sampling
        instants of its rows, cycles."""
        shape = self.chip.height, self.chip.width
        grid = TileGrid(*shape)
        excess = self.dark_excess(np.arange(shape[0] * shape[1], dtype=np.uint32))
        if excess is not None:
            excess = grid.reduce(excess.reshape(shape), np.maximum)
        moves = np.zeros(shape[0])
        if self.row_timing is not None:
            moves = self.row_timing.deviation(np.arange(shape[0]), shape[0])
        timing = grid.reduce(np.broadcast_to(moves[:, None], shape), np.maximum)
        return excess, timing

    @property
    def light_map(self) -> Callable[[Light], Light] | None:
        """Map of the light on the pixels, before integration; None for no map."""
        maps = [m for m in (effect.light_map(self) for effect in self._acting) if m is not None]
        if len(maps) < 2:
            return maps[0] if maps else None

        def chained(light: Light) -> Light:
            for step in maps:
                light = step(light)
            return light

        return chained

    @property
    def common_gain(self) -> CommonGain | None:
        """Gain that all pixels have in common; None for none. At most one effect has it."""
        gains = (effect.common_gain(self) for effect in self._acting)
        return next((gain for gain in gains if gain is not None), None)

    @property
    def sampling_offsets(self) -> npt.NDArray[np.int64] | None:
        """Picoseconds from a latch edge to the sampling instant of each row of the chip,
        (height,) int64; None if all rows are sampled at the edge."""
        effects = [effect for effect in self._acting if effect.reach != (0, 0)]
        if not effects:
            return None
        offsets = np.zeros(self.chip.height)
        for effect in effects:
            offsets = offsets + effect.sampling(self)
        return np.rint(offsets).astype(np.int64)

    def fixed_pattern(self, numbers: npt.NDArray[np.uint32], lumped: bool) -> FixedPattern | None:
        """Gains and dark currents of pixels, None if all are nominal.

        Args:
            numbers: (n,) numbers of the pixels on the chip.
            lumped: whether `lumped_dark` is added; a lumped leak is a dark current below zero.
        """
        patterns = [effect.fixed_pattern(self, numbers) for effect in self._acting]
        parts = [pattern for pattern in patterns if pattern is not None]
        dark = self.lumped_dark if lumped else 0.0
        if not parts:
            if not dark:
                return None
            return FixedPattern(np.ones(numbers.size), np.full(numbers.size, dark))
        whole = parts[0]
        for part in parts[1:]:
            whole = FixedPattern(whole.gain * part.gain, whole.dark + part.dark)
        return whole if not dark else FixedPattern(whole.gain, whole.dark + dark)
