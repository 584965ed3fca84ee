"""A physical effect of the latched pixel: schema keys, parameters, hooks, bound and cost.

An effect is one subclass of `PixelEffect` in one file, and one line in the catalogue. It acts on
the pixel through hooks. Every tier calls only the hooks of the effects that a plan keeps, so an
effect that is left out costs nothing.

By the costs, in nanoseconds a pixel-cycle, the planner decides what to leave out. They were
measured by `viform bench sensor` on two cores at 2.5 GHz with AVX-512 under PoCL 3.1. The planner
uses this table on every machine, so that a scenario gives the same bits everywhere. Predicted run
times are measured on the device.

`sensor.preset = "silicon"` gives an effect a size. Nothing is published of the faults of SpikeOne
or SpikeTwo. The sizes are those of the one public calibration of a spike sensor (the simulator
SCSim), of a public recording, of a patent and of the principle's paper; what none of them gives is
a round number usual for CMOS. So all are assumed for the chips here, and each key says on what
ground.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.compute.streams import Stream
from cosim.light.light import Light
from cosim.plan.effects import Bound, Effect, Summary
from sensor.device.chips import Chip
from sensor.device.pattern import FixedPattern
from sensor.latched.pixel.charge import Transfer

QUIET: Final = 0.03
"""A pixel-cycle without effects: phase and carry."""
NOISE_SPIKE: Final = 4.0
"""Threshold noise, a spike: one draw."""
NOISE_CYCLE: Final = 0.01
"""Threshold noise, a cycle without spikes: the estimate of the next spike, over a block."""
BANK_FROM: Final = 5e-4
"""Spikes a cycle from which thresholds from the bank cost less than one draw for each spike. They
cost the same at all rates."""
DEAD_SPIKE: Final = 0.5
"""Dead time, a spike."""
PATTERN_PLANE: Final = 0.3
"""Gain and dark charge, a pixel of a new plane of light."""
SAMPLING_PLANE: Final = 1.0
"""Row-wise sums in the cycle in which planes meet, a pixel of a new plane."""
CROSSTALK_PLANE: Final = 8.0
"""Nine neighbours, a pixel of a new plane."""
EXACT: Final = 6.0
"""A pixel-cycle of the exact tier, whatever its effects."""
REFERENCE_CYCLE: Final = 4.0
"""The reference tier, a cycle without spikes."""
REFERENCE_SPIKE: Final = 60.0
"""The reference tier, a spike."""
REFERENCE_CIRCUIT: Final = 1000.0
"""The reference tier, a cycle of a pixel whose circuit it integrates."""
REFERENCE_MOST: Final = 6.0
"""Most spikes a cycle that the reference simulates one by one."""
ALL_PIXELS: Final = ("latched", "asynchronous", "continuous")
USUAL: Final = "no source for a spike chip: a round number usual for CMOS image sensors"


@dataclass(frozen=True)
class Sized:
    """A size.

    Attributes:
        value: value in the unit of the key.
        provenance: whether it was published for this chip.
        source: source of the value.
    """

    value: float
    provenance: Literal["published", "assumed"]
    source: str


class Dependence(NamedTuple):
    """A key of [sensor.pattern] that another key requires in order to have an effect.

    Attributes:
        key: the required key, which must be above 0.
        reason: relation of the dependent key to it, for messages, such as "is a share of it".
        example: a valid value of the required key, as text.
    """

    key: str
    reason: str
    example: str


@dataclass(frozen=True)
class Key:
    """A key that an effect adds to [sensor] or [sensor.pattern].

    Attributes:
        annotation: type of the field, for pydantic.
        field: `pydantic.Field(...)` with default and description.
        pixels: kinds of pixel that have the effect. With any other kind the key must keep its
            default.
        silicon: value under `sensor.preset = "silicon"`, None if the preset does not set it.
        share_of_threshold: whether that value is a share of the threshold.
        needs: the key that this one depends on, None for none.
        reported: whether the machine table of the report has a row for it.
        first: whether a written scenario lists it before the other keys of effects.
        section: whether it is a subsection, which a written scenario lists after all plain keys.
    """

    annotation: Any
    field: Any
    pixels: tuple[str, ...] = ("latched",)
    silicon: Sized | None = None
    share_of_threshold: bool = False
    needs: Dependence | None = None
    reported: bool = True
    first: bool = False
    section: bool = False


class Operation(NamedTuple):
    """Operating point of a chip, which effects read when a scenario is turned into a setting.

    Attributes:
        clock: clock of the latches.
        threshold: electrons, at the selected level.
        celsius: temperature of the chip, degC.
    """

    clock: Clock
    threshold: float
    celsius: float


class Setting(Protocol):
    """The part of a `CameraSetting` that effects read. Parameters of effects are attributes too."""

    @property
    def chip(self) -> Chip: ...
    @property
    def clock(self) -> Clock: ...
    @property
    def threshold(self) -> float: ...
    @property
    def effects(self) -> tuple[PixelEffect, ...]: ...
    def __getattr__(self, name: str) -> Any: ...


class CommonGain(Protocol):
    """A gain of all pixels over time."""

    def on(
        self, light: Light, start: int, cycles: int, late: int = 0, *, products: bool = False
    ) -> Light:
        """The light of these cycles, and of one before and after, times the gain. late: most time,
        ps, by which it reaches a row later; products: whether planes may be `Scaled`."""
        ...


class PixelEffect:
    """A physical effect of the latched pixel. Subclasses override the methods that they need.

    Attributes:
        name: name in plans and reports.
        source: source of its equation.
        keys, pattern_keys: fields that it adds to [sensor] and to [sensor.pattern].
        parameters: attributes that it adds to a `CameraSetting`, each with the value that means
            that the effect is absent.
        inherent: whether every pixel has it. It then has no parameter and is listed in
            `setting.effects`.
        stream: random stream of its draws.
        scope: "tile" if the fast tier can keep it tile by tile, "plane" otherwise.
        group: effects of one group share their cost.
        reach: cycles before and after a block whose light its hooks read.
    """

    name: ClassVar[str]
    source: ClassVar[str]
    keys: ClassVar[Mapping[str, Key]] = {}
    pattern_keys: ClassVar[Mapping[str, Key]] = {}
    parameters: ClassVar[Mapping[str, Any]] = {}
    inherent: ClassVar[bool] = False
    stream: ClassVar[Stream] = Stream.NONE
    scope: ClassVar[Literal["tile", "plane"]] = "plane"
    group: ClassVar[str] = ""
    reach: ClassVar[tuple[int, int]] = (0, 0)

    # From the scenario to the setting.

    def configure(self, section: Any, operation: Operation) -> Mapping[str, Any]:
        """Parameters from the [sensor] section. By default a key sets the parameter of its name.

        Raises InputError for a value that cannot be simulated.
        """
        return {name: getattr(section, name) for name in self.keys if name in self.parameters}

    def acts(self, setting: Setting) -> bool:
        """Whether the effect is present in a setting."""
        if self.inherent:
            return self in setting.effects
        return any(getattr(setting, n) != absent for n, absent in self.parameters.items())

    def removed(self, setting: Setting) -> Mapping[str, Any]:
        """Parameters that remove the effect from a setting."""
        return self.parameters

    # For the planner.

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        """Bound of the relative error of a rate if the effect is left out of a scene."""
        raise NotImplementedError

    def cost(self, scene: Summary) -> Any:
        """Cost of keeping the effect, ns per pixel-cycle. An effect without cost is always kept."""
        return 0.0

    def planned(self, setting: Setting) -> Effect:
        """The effect in the form that the planner reads."""
        return Effect(
            self.name, self.source, self.stream, lambda scene: self.bound(setting, scene),
            self.cost, self.scope, self.group,
        )  # fmt: skip

    # Hooks of the pixel, in the order of the signal. They are called for acting effects only.

    def light_map(self, setting: Setting) -> Callable[[Light], Light] | None:
        """Map of the light on the pixels, before integration."""
        return None

    def common_gain(self, setting: Setting) -> CommonGain | None:
        """Gain that all pixels have in common, after the map of the light."""
        return None

    def sampling(self, setting: Setting) -> npt.NDArray[np.float64] | float:
        """Picoseconds from a latch edge to the sampling instant: (rows of the chip,), or one value
        for all rows. The sum over effects is rounded."""
        return 0.0

    def fixed_pattern(
        self, setting: Setting, numbers: npt.NDArray[np.uint32]
    ) -> FixedPattern | None:
        """Gain and dark current of the pixels with these numbers, (n,), in charge scaled to the
        nominal threshold. Gains multiply and dark currents add up over effects."""
        return None

    def gain_spread(self, setting: Setting) -> float:
        """Standard deviation of the pixels' gains, relative; spreads add up over effects."""
        return 0.0

    def dark_charge(self, setting: Setting) -> float:
        """Electrons a cycle that a pixel gathers in the dark, up to four standard deviations."""
        return 0.0

    def dark_excess(
        self, setting: Setting, numbers: npt.NDArray[np.uint32]
    ) -> npt.NDArray[np.float64] | None:
        """Electrons a second that single pixels with these numbers, (n,), gather in the dark beyond
        `dark_charge`; None for none."""
        return None

    def lumped_dark(self, setting: Setting) -> float:
        """Electrons a second that the exact and the fast tier add to every pixel, in place of a
        current that the reference tier integrates in detail; negative for a loss."""
        return 0.0

    def transfer(self, setting: Setting) -> Transfer | None:
        """Pointwise map of the charge of a cycle, before accumulation."""
        return None

    def threshold_noise(self, setting: Setting) -> float:
        """Standard deviation of each spike's threshold, electrons; variances add over effects."""
        return 0.0

    def threshold_shift(self, setting: Setting) -> float:
        """Electrons that each interval needs beyond its threshold."""
        return 0.0

    def dead_time(self, setting: Setting) -> float:
        """Seconds after each spike during which light is lost."""
        return 0.0


def _rate(scene: Summary) -> Any:
    """Approximate spikes a cycle."""
    return (scene.darkest + scene.brightest) / 2 / scene.threshold


def noise_cost(scene: Summary) -> Any:
    """Cost of a threshold drawn for each spike."""
    return NOISE_CYCLE + NOISE_SPIKE * _rate(scene)


def bank_cost(scene: Summary) -> Any:
    """Cost of a threshold for each spike from the bank, where that is cheaper than a draw."""
    return np.minimum(noise_cost(scene), NOISE_CYCLE + NOISE_SPIKE * BANK_FROM)


def dead_time_cost(scene: Summary) -> Any:
    """Cost of charge lost at each spike."""
    return 1e-3 + DEAD_SPIKE * _rate(scene)


def pattern_cost(scene: Summary) -> Any:
    """Cost of a gain and a dark current of each pixel."""
    return 1e-6 + PATTERN_PLANE * scene.planes


def sampling_cost(scene: Summary) -> Any:
    """Cost of a sampling instant of each row."""
    return 1e-6 + SAMPLING_PLANE * scene.planes


def crosstalk_cost(scene: Summary) -> Any:
    """Cost of the light of neighbours."""
    return 1e-6 + CROSSTALK_PLANE * scene.planes


def reference_cost(scene: Summary) -> Any:
    """Cost of full physics."""
    return REFERENCE_CYCLE + REFERENCE_SPIKE * np.minimum(_rate(scene), REFERENCE_MOST)


def circuit_cost(scene: Summary) -> Any:
    """Cost of a lumped circuit: it is part of sums that are computed anyway."""
    return 1e-6
