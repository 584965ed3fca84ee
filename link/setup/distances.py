"""The rate of a link at other distances, predicted as the mode of a run is: by pilots.

A strip of the panel sends random data through the air and the camera at each distance
(`link.setup.modes`), and the best mode's goodput for the run's file is the rate there. The panel,
its lens and its light stay: the irradiance of a resolved panel does not fall with distance, but
the images of its pixels shrink.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from cosim import InputError
from cosim.compute.table_cache import cached_value
from cosim.run.progress import Progress
from link.mode import Mode
from link.setting import LinkSetting, link_setting
from link.setup.choosing import Choice
from link.setup.locking.loop import SOURCES
from link.setup.locking.model import at_lock
from link.setup.modes import choose_mode
from link.setup.setup import FileLinkSetup
from link.setup.truth import panel_in_view, tag_module

OTHERS: Final = 3
"""Number of distances beside the run's: each takes one to three pilots."""
_CLOSE: Final = 0.04
"""Difference of two distances, as a share, below which one stands for both."""
_STEP: Final = 1.005
"""Ratio of the distances at which a panel is looked for in the view."""


@dataclass(frozen=True)
class RateAt:
    """Predicted rate at a distance.

    Attributes:
        distance: m.
        rate: goodput of the best mode for the run's file, bit/s; 0 if none is predicted to work.
        mode: mode of that rate, None without one.
    """

    distance: float
    rate: float
    mode: Mode | None


def span_of(setting: LinkSetting, mode: Mode) -> tuple[float, float]:
    """Distances between which this panel can be read with this lens, m: nearer it does not fit into
    the view, and farther its tags are too small. The second may be the smaller."""
    chip, optics = setting.camera.chip, setting.optics
    here, focal = setting.air.distance, optics.focal_length
    # The image of a panel pixel is as large as the inverse of its distance from the focal point.
    tight = setting.scale * max(optics.height / chip.height, optics.width / chip.width)
    module, least = tag_module(setting, mode)
    near = max(focal + (here - focal) * tight, 2.1 * focal)
    far = focal + (here - focal) * module / least * (1 - 1e-9)
    while near < far and not panel_in_view(_moved(setting, near)):  # it stands aside, or is turned
        near *= _STEP
    return near, far


def _moved(setting: LinkSetting, distance: float) -> LinkSetting:
    """The link with its panel elsewhere, as far as its image is concerned."""
    return replace(setting, air=replace(setting.air, distance=distance))


def rates_over_distance(setup: FileLinkSetup, progress: Progress) -> list[RateAt]:
    """Predicted rates at the run's distance and at OTHERS, in the order of distance. Empty if the
    scenario gives the mode, which then is not chosen by pilots. They are kept for the next run of
    the same link."""
    if setup.mode_given:
        return []
    device = None if setup.device is None else setup.device.name
    size, link = len(setup.payload.data), repr(setup.scenario.link)
    return cached_value(
        "distances", (link, setup.setting, setup.choice, setup.lock is None, size, device),
        SOURCES, list[RateAt], lambda: _rates(setup, progress),
    )  # fmt: skip


def _rates(setup: FileLinkSetup, progress: Progress) -> list[RateAt]:
    here = setup.setting.air.distance
    near, far = span_of(setup.setting, setup.mode)
    others = np.geomspace(near, far, OTHERS) if far > near else np.empty(0)
    apart = [float(d) for d in others if abs(d / here - 1) > _CLOSE]
    rows = [_rate(here, setup.choice)]
    rows += [_rate(d, _choice(setup, d, progress)) for d in apart]
    return sorted(rows, key=lambda row: row.distance)


def _rate(distance: float, choice: Choice | None) -> RateAt:
    if choice is None or not choice.holds:
        return RateAt(distance, 0.0, None)
    rate = next(row.goodput for row in choice.rows if row.mode == choice.mode)
    return RateAt(distance, rate or 0.0, choice.mode)


def _choice(setup: FileLinkSetup, distance: float, progress: Progress) -> Choice | None:
    """The choice of a mode at a distance, with the clock locked if it is in the run; None where
    nothing can arrive."""
    link = setup.scenario.link
    aim = link.aim.model_copy(update={"f_number": setup.setting.optics.f_number})
    there = link.model_copy(update={"aim": aim, "distance": distance * 1e6})
    scenario = setup.scenario.model_copy(update={"link": there})
    try:
        setting = link_setting(scenario, setup.setting.camera.changed(clock_moves=None))
    except InputError:
        return None
    if setup.lock is not None:
        setting = at_lock(setting)
    size = len(setup.payload.data)
    return choose_mode(link.modem, setting, size, setup.device, progress)[1]
