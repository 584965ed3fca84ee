"""A link with its plan, and the check of the plan on patches before anything is recorded."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.run.machine import Finding
from cosim.run.progress import Progress
from link.air import Air
from link.prediction.light import cell_scene
from link.setup.setup import LinkSetup
from link.setup.truth import panel_in_view
from link.trial.check import LinkCheck, check_link
from link.trial.plan import LinkPlan, LinkSurvey, survey_link
from sensor import SpikeCamera

__all__ = ["PlannedLink", "check_plan", "plan_link"]

ARITHMETIC: Final = "32-bit arithmetic"
"""Name of the effect that the exact tier reinstates."""
_BLURRED: Final = 2.0
"""Sides of a cell, of blur above which the check is skipped: no bit would be decided right."""


@dataclass(frozen=True)
class PlannedLink:
    """A link that is planned.

    Attributes:
        setup: what is simulated.
        survey: what the bounds of plans depend on.
        plan: what is kept.
        check: what patches have measured of the plan; None before.
        beyond: one line for each promise that does not hold with every effect kept.
    """

    setup: LinkSetup
    survey: LinkSurvey
    plan: LinkPlan
    check: LinkCheck | None = None
    beyond: tuple[str, ...] = ()

    def make_air(self) -> Air:
        """The stage that makes the light."""
        sent = self.setup.sent
        return self.setup.setting.make_air(sent, sent.planes, self.plan.run_air)

    def make_camera(self, late: npt.NDArray[np.int64]) -> SpikeCamera:
        """The stage that makes the spikes. late: delay of the light of each row, ps."""
        return SpikeCamera(self.plan.camera, self.setup.device, tier=self.plan.tier, row_delay=late)

    def keep(self, effects: Sequence[str]) -> PlannedLink:
        """The same link planned with these effects kept."""
        return _planned(self.setup, self.survey, effects)


def _planned(setup: LinkSetup, survey: LinkSurvey, effects: Sequence[str]) -> PlannedLink:
    plan = survey.plan(
        setup.scenario.tolerance, setup.device,
        forced=[name for name in effects if name != ARITHMETIC],
        tier="exact" if ARITHMETIC in effects else None,
    )  # fmt: skip
    return PlannedLink(setup, survey, plan)


def plan_link(setup: LinkSetup) -> PlannedLink:
    """Plans a link."""
    survey = survey_link(setup.setting, setup.mode, setup.sent.symbols, setup.cycles)
    return _planned(setup, survey, ())


def check_plan(link: PlannedLink, progress: Progress) -> tuple[PlannedLink, list[Finding]]:
    """The link with its plan checked on patches, and the effect that must be reinstated, if any.

    The check is skipped where no bit can be decided right.
    """
    setup, plan = link.setup, link.plan
    setting, tolerance = setup.setting, setup.scenario.tolerance
    begin = time.perf_counter()
    if cell_scene(setting).blur > _BLURRED * setup.mode.cell * setting.scale or not panel_in_view(
        setting
    ):
        check = LinkCheck(None, dict.fromkeys(plan.left_out), None, 0, None)
    else:
        check = check_link(
            setting, setup.sent, plan, detector=setup.scenario.link.modem.detector,
            seed=setup.scenario.seed, device=setup.device, progress=progress,
        )  # fmt: skip
    spent = setup.seconds.get("plan and check", 0.0) + time.perf_counter() - begin
    setup.seconds["plan and check"] = spent
    link = replace(link, check=check)
    if not check.beyond(tolerance):
        return link, []
    assert check.paired is not None
    off = f"off by {check.paired.value:.2g} where {tolerance:g} was asked for"
    if plan.left_out:
        worst = max(plan.left_out, key=lambda name: check.measured.get(name) or 0.0)
        message = f"{worst} was put back: patches without it were {off}"
        return link, [Finding(worst, message, tolerance, check.paired.value)]
    if plan.tier == "fast":
        message = f"the exact tier was taken: patches in the fast one were {off}"
        return link, [Finding(ARITHMETIC, message, tolerance, check.paired.value)]
    return replace(link, beyond=(f"with every effect kept the run is {off}",)), []
