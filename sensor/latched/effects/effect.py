"""What a physical effect of the latched pixel is: schema keys, parameters, hooks, bound and cost.

An effect is one subclass of `PixelEffect` in one file, and one line in the catalogue. It acts on
the pixel at hooks; every tier calls the hooks of the effects that are kept and no others, so that
an effect that is left out costs nothing.
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
from sensor.device.silicon import Sized
from sensor.latched.pixel.transfer import Transfer

__all__ = ["ALL_READOUTS", "Dependence", "Key", "Operation", "PixelEffect", "Setting"]

ALL_READOUTS: Final = ("synchronous", "asynchronous", "continuous")


class Dependence(NamedTuple):
    """A key of [sensor.pattern] without which another one changes nothing.

    Attributes:
        key: that must be above 0.
        reason: what the dependent key is of it, such as "is a share of it".
        example: a value of the key, as text.
    """

    key: str
    reason: str
    example: str


@dataclass(frozen=True)
class Key:
    """A key that an effect adds to [sensor] or [sensor.pattern].

    Attributes:
        annotation: type of the field, as pydantic takes it.
        field: `pydantic.Field(...)` with default and description.
        readouts: readouts whose pixels have the effect; the key must have its default in others.
        silicon: size under `sensor.preset = "silicon"`, None if the preset has none.
        share_of_threshold: whether that size is a share of the threshold.
        needs: another key that this one depends on, None for none.
        reported: whether the machine table of the report has a row for it.
        first: whether it stands before the other keys of effects where a scenario is written.
        section: whether it is a section of its own, which is written after all plain keys.
    """

    annotation: Any
    field: Any
    readouts: tuple[str, ...] = ("synchronous",)
    silicon: Sized | None = None
    share_of_threshold: bool = False
    needs: Dependence | None = None
    reported: bool = True
    first: bool = False
    section: bool = False


class Operation(NamedTuple):
    """How a chip is operated, as far as effects read it when a scenario becomes a setting.

    Attributes:
        clock: of the latches.
        threshold: electrons, at the chosen level.
        celsius: temperature of the chip.
    """

    clock: Clock
    threshold: float
    celsius: float


class Setting(Protocol):
    """What effects read of a `CameraSetting`; the parameters of effects are further attributes."""

    @property
    def chip(self) -> Chip: ...
    @property
    def clock(self) -> Clock: ...
    @property
    def threshold(self) -> float: ...
    @property
    def effects(self) -> tuple[PixelEffect, ...]: ...
    def __getattr__(self, name: str) -> Any: ...


class PixelEffect:
    """A physical effect of the latched pixel. Subclasses override what they need.

    Attributes:
        name: as plans and reports print it.
        source: of its equation.
        keys, pattern_keys: fields that it adds to [sensor] and to [sensor.pattern].
        parameters: its attributes of a `CameraSetting`, with their values where it is absent.
        inherent: whether every pixel has it, with no parameter; it is then in `setting.effects`.
        stream: of its random draws.
        scope: "tile" where the fast tier can keep it tile by tile, "plane" otherwise.
        group: effects of one group share their cost.
        reach: cycles before and after a block in which its hooks read light as well.
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
        """Parameters from the [sensor] section: keys and parameters of one name, unless overridden.

        Raises InputError for a value that cannot be simulated.
        """
        return {name: getattr(section, name) for name in self.keys if name in self.parameters}

    def acts(self, setting: Setting) -> bool:
        """Whether the effect is present in a setting."""
        if self.inherent:
            return self in setting.effects
        return any(getattr(setting, n) != absent for n, absent in self.parameters.items())

    def removed(self, setting: Setting) -> Mapping[str, Any]:
        """Parameters of the setting without this effect."""
        return self.parameters

    # What the planner reads.

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        """What leaving the effect out can change in a scene."""
        raise NotImplementedError

    def cost(self, scene: Summary) -> Any:
        """Of keeping the effect, ns per pixel-cycle; an effect that costs nothing is kept."""
        return 0.0

    def planned(self, setting: Setting) -> Effect:
        """The effect as the planner takes it."""
        return Effect(
            self.name, self.source, self.stream, lambda scene: self.bound(setting, scene),
            self.cost, self.scope, self.group,
        )  # fmt: skip

    # Hooks of the pixel, in the order of the signal. Only effects that act are asked.

    def light_map(self, setting: Setting) -> Callable[[Light], Light] | None:
        """Map of the light on the pixels before they integrate it."""
        return None

    def sampling(self, setting: Setting) -> npt.NDArray[np.float64] | float:
        """Picoseconds from a latch edge to the sampling instant, of each row of the chip or of
        all; the sum over effects is rounded."""
        return 0.0

    def fixed_pattern(
        self, setting: Setting, numbers: npt.NDArray[np.uint32]
    ) -> FixedPattern | None:
        """Gain and dark current of the pixels with these numbers, (n,), in charge scaled to the
        nominal threshold. Gains multiply and dark currents add up over effects."""
        return None

    def lumped_dark(self, setting: Setting) -> float:
        """Electrons a second that the exact and the fast tier add to every pixel, for what the
        reference tier integrates by itself; negative for a loss."""
        return 0.0

    def transfer(self, setting: Setting) -> Transfer | None:
        """Pointwise map of the charge that a cycle brings, before it is accumulated."""
        return None

    def threshold_noise(self, setting: Setting) -> float:
        """Standard deviation of each spike's threshold, electrons; variances add up."""
        return 0.0

    def threshold_shift(self, setting: Setting) -> float:
        """Electrons that each interval takes beyond its threshold."""
        return 0.0

    def dead_time(self, setting: Setting) -> float:
        """Seconds after each spike in which light is lost."""
        return 0.0
