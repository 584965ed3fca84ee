"""Fixed pattern: PRNU, rows and columns, dark current and DSNU, threshold FPN, hot, dead and warm
pixels.

The effects share one `DevicePattern` (sensor/device/pattern.py), the parameter `pattern` of a
setting. Each effect has its own sizes in it. All random values of a pixel are drawn together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Final

import numpy as np
import numpy.typing as npt
from pydantic import Field

from cosim.config.quantity import Current, Share, Spread, Temperature
from cosim.plan.effects import Bound, Summary
from sensor.device.pattern import CORRELATED, DevicePattern, FixedPattern, dark_current
from sensor.latched.effects.effect import (
    ALL_PIXELS,
    USUAL,
    Dependence,
    Key,
    Operation,
    PixelEffect,
    Setting,
    Sized,
    pattern_cost,
)
from sensor.latched.effects.windows import bound_of, light_contrast, shift_error

_PATTERN: Final = (
    "a recording of a 400 x 250 chip: 2.9 % in all without its warm pixels, how much of it of the "
    "light is assumed"
)
_RECORDING: Final = (
    "fits the tail of a recording of a 400 x 250 chip: 57 pixels 15 % above the mean rate, the "
    "highest by 0.27 spikes a cycle"
)
_LINES: Final = "a recording of a 400 x 250 chip"
_OF_PRNU: Final = Dependence("prnu", "is of its spread", "0.02")
_NODES: Final = 201
"""Nodes of the integral over a normal variate."""
_DEVIATIONS: Final = 4
"""Standard deviations of the dark current that the survey of a scene allows for."""
_TILE_PIXELS: Final = 256
"""Pixels of a tile of the plan. If any pixel may be defective, a tile has at least one of them."""


def _inverse_spread(fpn: float) -> float:
    """RMS of 1 / max(1 + fpn z, 0.05) - 1 for normal z, the gain in `DevicePattern.at`."""
    z = np.linspace(-6, 6, _NODES)
    weight = np.exp(-z * z / 2)
    return float(np.sqrt(np.average((1 / np.maximum(1 + fpn * z, 0.05) - 1) ** 2, weights=weight)))


def _gain_bound(spread: float, scene: Summary) -> Bound:
    """Bound of a gain with this relative spread: the spread, times the contrast of the light."""
    shift = spread * scene.brightest * scene.cycles / scene.threshold
    value = spread * light_contrast(scene) + shift_error(scene, shift)
    return bound_of(scene, value, False, spread < 0.04)


class _PatternEffect(PixelEffect):
    """A part of the fixed pattern.

    Attributes:
        sizes: fields of `DevicePattern` that are 0 without the effect.
    """

    group = "pattern"
    parameters: ClassVar = {"pattern": None}
    sizes: ClassVar[tuple[str, ...]]

    def configure(self, section: Any, operation: Operation) -> Mapping[str, Any]:
        """The whole pattern, from the first of these effects. The others use the same one."""
        device = section.pattern
        if device is None or self is not PATTERN_EFFECTS[0]:
            return {}
        pattern = DevicePattern(
            rows=device.row_fpn,
            columns=device.column_fpn,
            along_row=device.neighbours_in_row,
            along_column=device.neighbours_in_column,
            prnu=device.prnu,
            dark=dark_current(device.dark_current, device.temperature),
            dsnu=device.dsnu,
            threshold_fpn=device.threshold_fpn,
            hot=device.hot_pixels,
            hot_current=device.hot_current,
            dead=device.dead_pixels,
            warm=device.warm_pixels,
            warm_current=device.warm_current,
            device_seed=device.device_seed,
        )
        return {"pattern": pattern}

    def size(self, pattern: DevicePattern) -> float:
        """Size of this part of the pattern, 0 if it is absent."""
        return float(getattr(pattern, self.sizes[0]))

    def acts(self, setting: Setting) -> bool:
        return setting.pattern is not None and self.size(setting.pattern) > 0

    def removed(self, setting: Setting) -> Mapping[str, Any]:
        if setting.pattern is None:
            return {}
        none: dict[str, Any] = dict.fromkeys(self.sizes, 0.0)
        return {"pattern": replace(setting.pattern, **none)}

    def cost(self, scene: Summary) -> Any:
        return pattern_cost(scene)

    def fixed_pattern(
        self, setting: Setting, numbers: npt.NDArray[np.uint32]
    ) -> FixedPattern | None:
        """The whole pattern, from the first of these effects that acts."""
        first = next(effect for effect in PATTERN_EFFECTS if effect.acts(setting))
        pattern: DevicePattern = setting.pattern
        if pattern.placed:
            pattern = replace(pattern, width=setting.chip.width)
        return pattern.at(numbers) if self is first else None


class _Prnu(_PatternEffect):
    name = "PRNU"
    source = "EMVA 1288 release 4.0"
    sizes = ("prnu",)
    pattern_keys: ClassVar = {
        "prnu": Key(
            Spread,
            Field(default=0.0, description="spread of the light's gain, relative"),
            pixels=ALL_PIXELS,
            silicon=Sized(0.025, "assumed", _PATTERN),
            first=True,
        ),
        "neighbours_in_row": Key(
            Annotated[float, Field(ge=0, le=CORRELATED)],
            Field(default=0.0, description="correlation of that gain between neighbours in a row"),
            silicon=Sized(0.33, "assumed", f"{_LINES}: 0.24 of the whole pattern"),
            needs=_OF_PRNU,
        ),
        "neighbours_in_column": Key(
            Annotated[float, Field(ge=0, le=CORRELATED)],
            Field(
                default=0.0, description="correlation of that gain between neighbours in a column"
            ),
            silicon=Sized(0.22, "assumed", f"{_LINES}: 0.16 of the whole pattern"),
            needs=_OF_PRNU,
        ),
    }

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        return _gain_bound(setting.pattern.prnu, scene)

    def gain_spread(self, setting: Setting) -> float:
        return float(setting.pattern.prnu)


class _Lines(_PatternEffect):
    """Gains that the pixels of a row, and of a column, have in common."""

    name = "row and column FPN"
    source = "EMVA 1288 release 4.0: row and column non-uniformity"
    sizes = ("rows", "columns")
    pattern_keys: ClassVar = {
        "row_fpn": Key(
            Spread,
            Field(
                default=0.0,
                description="spread of the light's gain that a row has in common, relative",
            ),
            silicon=Sized(8e-4, "assumed", f"{_LINES}: rows vary 1.85 times as independent pixels"),
        ),
        "column_fpn": Key(
            Spread,
            Field(
                default=0.0,
                description="spread of the light's gain that a column has in common, relative",
            ),
        ),
    }

    def size(self, pattern: DevicePattern) -> float:
        return math.hypot(pattern.rows, pattern.columns)

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        return _gain_bound(self.size(setting.pattern), scene)

    def gain_spread(self, setting: Setting) -> float:
        return self.size(setting.pattern)


class _Dark(_PatternEffect):
    name = "dark current and DSNU"
    source = "Huang 2022 section 4.4; EMVA 1288"
    sizes = ("dark", "dsnu")
    pattern_keys: ClassVar = {
        "dark_current": Key(
            Current,
            Field(default=0.0, examples=["100 e/s"], description="mean, at 25 degC"),
            pixels=ALL_PIXELS,
            silicon=Sized(100.0, "assumed", "Huang 2022 section 4.4: under 100 e/s in modern CMOS"),
        ),
        "dsnu": Key(
            Spread,
            Field(default=0.0, description="spread of the dark current, relative to it"),
            pixels=ALL_PIXELS,
            silicon=Sized(0.3, "assumed", USUAL),
            needs=Dependence("dark_current", "is a share of it", "100 e/s"),
        ),
        "temperature": Key(
            Temperature,
            Field(default=25.0, description="dark current doubles every 6.5 K"),
            pixels=ALL_PIXELS,
            reported=False,
        ),
    }

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        pattern, period = setting.pattern, float(setting.clock.period)
        charge = pattern.dark * period * math.hypot(1, pattern.dsnu)
        shift = charge * scene.cycles / scene.threshold
        proof = pattern.dsnu == 0 and pattern.threshold_fpn == 0
        return bound_of(scene, scene.relative(charge) + shift_error(scene, shift), proof)

    def dark_charge(self, setting: Setting) -> float:
        pattern, period = setting.pattern, float(setting.clock.period)
        return float(pattern.dark * period * (1 + _DEVIATIONS * pattern.dsnu))


class _ThresholdFpn(_PatternEffect):
    name = "threshold FPN"
    source = "comparator and capacitance mismatch"
    sizes = ("threshold_fpn",)
    pattern_keys: ClassVar = {
        "threshold_fpn": Key(
            Spread,
            Field(default=0.0, description="spread of the threshold, relative"),
            pixels=("latched", "asynchronous"),
            silicon=Sized(0.015, "assumed", _PATTERN),
            first=True,
        )
    }

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        return _gain_bound(_inverse_spread(setting.pattern.threshold_fpn), scene)

    def gain_spread(self, setting: Setting) -> float:
        return float(setting.pattern.threshold_fpn)


class _Defects(_PatternEffect):
    name = "hot and dead pixels"
    source = "EMVA 1288"
    sizes = ("hot", "hot_current", "dead")
    pattern_keys: ClassVar = {
        "hot_pixels": Key(
            Share,
            Field(default=0.0, description="share of pixels"),
            pixels=ALL_PIXELS,
            needs=Dependence("hot_current", "are those that have it", "100000 e/s"),
        ),
        "hot_current": Key(
            Current,
            Field(
                default=0.0,
                examples=["100000 e/s"],
                description="dark current that a hot pixel has on top",
            ),
            pixels=ALL_PIXELS,
        ),
        "dead_pixels": Key(
            Share,
            Field(default=0.0, description="share of pixels that see no light"),
            pixels=ALL_PIXELS,
            silicon=Sized(1e-5, "assumed", USUAL),
        ),
    }

    def size(self, pattern: DevicePattern) -> float:
        return pattern.hot * pattern.hot_current + pattern.dead

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        pattern, period = setting.pattern, float(setting.clock.period)
        share = [max(s, 1 / _TILE_PIXELS) if s else 0.0 for s in (pattern.hot, pattern.dead)]
        hot = math.sqrt(share[0]) * scene.relative(pattern.hot_current * period)
        value = np.hypot(hot, math.sqrt(share[1]) * light_contrast(scene))
        return bound_of(scene, value, False, False)

    def dark_excess(
        self, setting: Setting, numbers: npt.NDArray[np.uint32]
    ) -> npt.NDArray[np.float64] | None:
        hot = setting.pattern.hot * setting.pattern.hot_current
        return _excess(setting.pattern, numbers, ("hot", "hot_current")) if hot else None


class _Warm(_PatternEffect):
    """Pixels with excess dark current, whose distribution over a chip has a long tail."""

    name = "warm pixels"
    source = "exponential tail of dark currents: a recording of a 400 x 250 chip has kurtosis 66"
    sizes = ("warm", "warm_current")
    pattern_keys: ClassVar = {
        "warm_pixels": Key(
            Share,
            Field(
                default=0.0,
                description="share of pixels with an exponentially distributed excess of dark "
                "current",
            ),
            pixels=ALL_PIXELS,
            silicon=Sized(1.15e-3, "assumed", _RECORDING),
            needs=Dependence("warm_current", "are those that have it", "100000 e/s"),
        ),
        "warm_current": Key(
            Current,
            Field(default=0.0, examples=["100000 e/s"], description="mean of that excess"),
            pixels=ALL_PIXELS,
            silicon=Sized(2280.0, "assumed", _RECORDING + ", at 40 kHz"),
            share_of_threshold=True,
        ),
    }

    def size(self, pattern: DevicePattern) -> float:
        return pattern.warm * pattern.warm_current

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # The mean square of an exponential variate is twice its squared mean.
        pattern, period = setting.pattern, float(setting.clock.period)
        share = max(pattern.warm, 1 / _TILE_PIXELS)
        value = math.sqrt(2 * share) * scene.relative(pattern.warm_current * period)
        return bound_of(scene, value, False, False)

    def dark_excess(
        self, setting: Setting, numbers: npt.NDArray[np.uint32]
    ) -> npt.NDArray[np.float64]:
        return _excess(setting.pattern, numbers, self.sizes)


def _excess(
    pattern: DevicePattern, numbers: npt.NDArray[np.uint32], sizes: tuple[str, ...]
) -> npt.NDArray[np.float64]:
    """Dark current of a pattern with these sizes alone, electrons a second."""
    chosen = {name: getattr(pattern, name) for name in sizes}
    return DevicePattern(**chosen, device_seed=pattern.device_seed).at(numbers).dark


PRNU, LINES, DARK, THRESHOLD_FPN = _Prnu(), _Lines(), _Dark(), _ThresholdFpn()
DEFECTS, WARM = _Defects(), _Warm()
PATTERN_EFFECTS: Final[tuple[_PatternEffect, ...]] = (
    PRNU, LINES, DARK, THRESHOLD_FPN, DEFECTS, WARM
)  # fmt: skip
