"""Optical cross-talk as an effect; sensor/device/crosstalk.py has the map of the light."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar

from pydantic import Field

from cosim.light.light import Light
from cosim.plan.effects import Bound, Summary
from sensor.device.crosstalk import crosstalk_map
from sensor.latched.effects.effect import (
    ALL_PIXELS,
    USUAL,
    Key,
    PixelEffect,
    Setting,
    Sized,
    crosstalk_cost,
)
from sensor.latched.effects.windows import bound_of, shift_error


class _Crosstalk(PixelEffect):
    name = "optical cross-talk"
    source = "Estribeau and Magnan, Proc. SPIE 5251:315, 2004, as one step of a random walk"
    parameters: ClassVar = {"crosstalk": 0.0}
    keys: ClassVar = {
        "crosstalk": Key(
            Annotated[float, Field(ge=0, le=0.5)],
            Field(
                default=0.0, description="share of its light that a pixel loses to its neighbours"
            ),
            pixels=ALL_PIXELS,
            silicon=Sized(0.01, "assumed", USUAL),
        )
    }

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # A dark pixel among the brightest receives the share `crosstalk` of the difference.
        gained = setting.crosstalk * (scene.brightest - scene.darkest)
        moved = shift_error(scene, gained * scene.cycles / scene.threshold)
        return bound_of(scene, scene.relative(gained) + moved, True)

    def cost(self, scene: Summary) -> Any:
        return crosstalk_cost(scene)

    def light_map(self, setting: Setting) -> Callable[[Light], Light]:
        return crosstalk_map(setting.crosstalk)


CROSSTALK = _Crosstalk()
