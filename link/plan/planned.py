"""A planned link, and the check of its plan on patches before the recording."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.error import ARITHMETIC, Finding, beyond, reinstated, required
from cosim.run.progress import Progress
from link.air import Air
from link.plan.check import LinkCheck, check_link
from link.plan.patches import LinkPatches
from link.plan.plan import Compared, LinkPlan, LinkSurvey, survey_link
from link.prediction.light import cell_scene
from link.setup.setup import LinkSetup
from link.setup.truth import panel_in_view
from sensor import SpikeCamera

_BLURRED: Final = 2.0
"""Blur above which the check is skipped, in sides of a cell: no bit would be decided correctly."""


@dataclass(frozen=True)
class PlannedLink:
    """A planned link.

    Attributes:
        setup: the link.
        survey: input of the plans.
        plan: effects that are simulated.
        check: result of the check on patches; None before it.
        beyond: lines for the user, one for each bound that is exceeded although every effect is
            simulated.
    """

    setup: LinkSetup
    survey: LinkSurvey
    plan: LinkPlan
    check: LinkCheck | None = None
    beyond: tuple[str, ...] = ()

    def make_air(self) -> Air:
        """Stage that makes the light."""
        sent = self.setup.sent
        return self.setup.setting.make_air(sent, sent.planes, self.plan.air_effects)

    def make_camera(self, row_delay: npt.NDArray[np.int64]) -> SpikeCamera:
        """Stage that makes the spikes. row_delay: (H,) delay of the light of each row, ps."""
        return SpikeCamera(
            self.plan.camera, self.setup.device, tier=self.plan.tier, row_delay=row_delay
        )

    def keep(self, effects: Sequence[str]) -> PlannedLink:
        """The same link, planned with these effects."""
        return _planned(self.setup, self.survey, effects)


def _planned(setup: LinkSetup, survey: LinkSurvey, effects: Sequence[str]) -> PlannedLink:
    forced, tier = required(effects)
    plan = survey.plan(setup.tolerance, setup.device, forced=forced, tier=tier)
    return PlannedLink(setup, survey, plan)


def survey_of(setup: LinkSetup, patches: LinkPatches | None = None) -> LinkSurvey:
    """Surveys the run of a link, and what its check can tell. patches: of the check, where they
    are made."""
    compared = None
    if is_checked(setup):
        patches = patches or LinkPatches(
            setup.setting, setup.sent, setup.seed, setup.modem.detector
        )
        pilots = () if setup.choice is None else setup.choice.rows
        rates = [row.errors for row in pilots if row.mode == setup.mode]
        compared = Compared(patches.bits, rates[0] if rates else None)
    return survey_link(setup.setting, setup.mode, setup.symbols, setup.cycles, compared)


def plan_link(setup: LinkSetup) -> PlannedLink:
    """Plans a link."""
    return _planned(setup, survey_of(setup), ())


def is_checked(setup: LinkSetup) -> bool:
    """Whether a plan is checked: not where no bit can be decided correctly."""
    setting = setup.setting
    blurred = cell_scene(setting).blur > _BLURRED * setup.mode.cell * setting.scale
    return not blurred and panel_in_view(setting)


def check_plan(link: PlannedLink, progress: Progress) -> tuple[PlannedLink, list[Finding]]:
    """Checks the plan on patches. Returns the link with the result, and the effect to reinstate, if
    any. See `is_checked`."""
    setup, plan = link.setup, link.plan
    setting, tolerance = setup.setting, setup.tolerance
    begin = time.perf_counter()
    if not is_checked(setup):
        check = LinkCheck(None, dict.fromkeys(plan.left_out), None, 0, None)
    else:
        check = check_link(
            setting, setup.sent, plan, detector=setup.modem.detector,
            seed=setup.seed, device=setup.device, progress=progress,
        )  # fmt: skip
    wall = setup.times.wall
    wall["plan and check"] = wall.get("plan and check", 0.0) + time.perf_counter() - begin
    link = replace(link, check=check)
    if not check.beyond(tolerance):
        return link, []
    assert check.paired is not None
    error = check.paired.error
    if plan.left_out:
        worst = max(plan.left_out, key=lambda name: check.measured.get(name) or 0.0)
        return link, [reinstated(worst, tolerance, error.high)]
    if plan.tier == "fast":
        return link, [reinstated(ARITHMETIC, tolerance, error.high)]
    return replace(link, beyond=(beyond(error, tolerance),)), []
