"""The plan of a latched camera and of the display that its stream drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.plan.effects import Effect, Summary
from cosim.plan.paired import Span
from display import DisplaySetting
from display.effects import BASE_COST, effective_planes, weight_steps
from sensor import CameraSetting
from sensor.latched.arithmetic import moved_spikes
from sensor.latched.effects.windows import SHARES, rare_error
from sensor.latched.planning import CameraPlan, plan_camera
from sensor.latched.survey import SceneSurvey
from sensor.latched.tiers import Tier

HELD: Final = (1, 2, 4, 8, 16, 64)
"""Numbers of planes over which a drive holds a packet at least, by the brightest rate of a tile."""


class _Shown:
    """A display behind a camera; see `sensor.latched.planning.Behind`."""

    base_cost = BASE_COST

    def __init__(self, display: DisplaySetting) -> None:
        self._display = display

    @property
    def acting_effects(self) -> tuple[Effect, ...]:
        return self._display.acting_effects

    def seen(self, scene: Summary) -> Summary:
        """The survey with the effective number of planes in the images of the display's observer as
        its window, if that is smaller."""
        planes = effective_planes(self._display.observer, self._display.panel, scene.cycles)
        return replace(scene, window=max(1, min(scene.window, round(planes))))

    def moved_light(
        self, setting: CameraSetting, scene: Summary, tier: Tier, *, end: bool
    ) -> npt.NDArray[np.float64]:
        """See `Behind`.

        A packet that moves by a plane changes an image by the difference of the weights. A drive
        that holds the light spreads a packet over its interval, and with it the difference. The
        planes are taken in classes of similar differences; the number of moved spikes in each is
        Poisson distributed (`rare_error`).
        """
        panel, observer = self._display.panel, self._display.observer
        moved = moved_spikes(setting, scene, tier)
        moved = np.exp2(np.ceil(4 * np.log2(np.maximum(moved, 1e-300))) / 4)  # few distinct values
        rate = np.asarray(scene.brightest, np.float64) / scene.threshold
        error = np.zeros(np.broadcast(scene.darkest, scene.brightest).shape)
        held = (1,) if panel.packets else HELD
        for least, longer in zip(held, (*held[1:], None), strict=True):
            tiles = rate * least <= 1 if least > 1 else np.ones(rate.shape, bool)
            if longer is not None:
                tiles &= rate * longer > 1
            square = np.zeros(error.shape)
            for size, planes in weight_steps(observer, panel, scene.cycles, least, end):
                # At the end of the run a single interval changes, 1 / tau to 1 / (tau + 1).
                change = size * scene.window * (0.5 if end and not panel.packets else 1.0)
                shares = (1.0,) if end else SHARES
                square += rare_error(scene, moved * planes, change, shares) ** 2
            error = np.where(tiles, np.sqrt(square), error)
        return error


@dataclass(frozen=True, eq=False)
class RunPlan(CameraPlan):
    """The plan of a camera and of the display that its stream drives.

    Attributes:
        display: the simulated display, None without one.
        full_display: the display with every effect, None without one.
    """

    display: DisplaySetting | None = None
    full_display: DisplaySetting | None = None


def plan_run(
    survey: SceneSurvey,
    setting: CameraSetting,
    tolerance: float,
    spans: Sequence[Span],
    device: Device | None,
    *,
    display: DisplaySetting | None = None,
    **choice: Any,
) -> RunPlan:
    """Plans the run of a camera over a scene.

    The bounds of the display and of the camera add up and share the tolerance. A bound of the
    camera is a relative change of a pixel's rate over a window (the window of the observer if that
    is shorter). An image of the panel is a weighted mean of its light, which follows the rate. This
    argument neglects that spikes are integers: the impulse drive needs many spikes in a window;
    hold and causal drives need intervals that are short compared with it. The check measures the
    effect of one spike more or less at the ends of the weights, and of 1 / tau over a longer
    interval.

    Args:
        survey, setting, tolerance, spans, device, **choice: see `plan_camera`.
        display: the display with every effect, None without one.
    """
    behind = None if display is None else _Shown(display)
    made = plan_camera(survey, setting, tolerance, spans, device, behind=behind, **choice)
    absent = [name for name, tiles in made.plan.kept.items() if not tiles.any()]
    left = None if display is None else display.without(absent)
    return RunPlan(**vars(made), display=left, full_display=display)
