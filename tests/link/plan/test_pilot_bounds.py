"""Bounds of a link's constant effects where the pilots' error rate is far above the closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cosim import Effect
from cosim.run.progress import QuietProgress
from link.air import ber
from link.mode import Mode
from link.plan.check import compare
from link.plan.patches import LinkPatches, Variant
from link.plan.plan import Compared, LinkSurvey, half_width, survey_link
from link.plan.planned import survey_of
from link.setting import LinkSetting, link_setting
from link.setup.setup import set_up_link
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import linked, load

CHOSEN = [
    "sensor.chip=spikeone", "link.panel.width=384", "link.panel.height=224", "link.size=20000",
]  # fmt: skip
MODE = Mode(384, 224, 2, 1, "scrambled", 64)
PILOTS = Compared(47_248, 2.7e-3)
DRAWS = 400_000


def bounds(survey: LinkSurvey) -> dict[str, float]:
    every: list[Effect] = [*survey.air_effects, *survey.camera_effects]
    return {effect.name: effect.bound(survey.scene).value for effect in every}


def surveyed(compared: Compared | None) -> tuple[LinkSetting, LinkSurvey]:
    scenario = linked(load("light-link", CHOSEN)[1], "test")
    setting = link_setting(scenario, camera_setting(scenario))
    return setting, survey_link(setting, MODE, 66, 79, compared)


def test_a_constant_change_moves_the_bits_at_the_threshold() -> None:
    """Glare against draws: the mean of the charges of a bit's spikes decides. A tenth of it is
    drawn, where the normal density is flat."""
    setting, survey = surveyed(PILOTS)
    scene = survey.scene
    assert setting.air.glare == 0.005 and PILOTS.rate is not None
    spikes = (2 * setting.scale) ** 2 * 2
    deviation = math.sqrt((scene.threshold + scene.noise**2) / spikes)
    more = 0.005 * scene.on / 10
    charge = np.random.default_rng(4).normal(scene.threshold, deviation, DRAWS)
    moved = int(np.sum((charge < scene.threshold) & (charge + more >= scene.threshold)))
    each = PILOTS.rate / half_width(PILOTS.rate, scene.bits)
    expected = 10 * moved / DRAWS * each
    assert bounds(survey)["glare"] == pytest.approx(expected, rel=4 / math.sqrt(moved))


def test_bounds_follow_the_pilots_only_where_they_are_above_the_closed_form() -> None:
    _, without = surveyed(None)
    closed, pilots = bounds(without), bounds(surveyed(PILOTS)[1])
    assert ber(without.scene) < 1e-4 * 2.7e-3
    assert closed == bounds(surveyed(Compared(47_248))[1])  # a mode that no pilots were sent in
    for name in ("glare", "threshold noise", "optical cross-talk", "ambient on the panel"):
        assert closed[name] < 0.2 and pilots[name] > 1
    # Larger ones by the closed form, random ones and those without a bound stay.
    same = {name for name, value in closed.items() if pilots[name] == value}
    assert {"scintillation", "vibration", "shot noise", "lens blur"} <= same
    assert all(pilots[name] >= value for name, value in closed.items())
    assert "glare" in without.plan(0.1, None).left_out
    assert "glare" not in surveyed(PILOTS)[1].plan(0.1, None).left_out


def test_no_noise_takes_more_errors_away_than_there_are() -> None:
    none = Compared(59_584, 0.0)  # its rate is that of one error in the run
    setting, _ = surveyed(None)
    wide = Mode(384, 224, 4, 1, "scrambled", 64)  # of 4 x 4: the closed form is 0
    survey = survey_link(setting, wide, 66, 79, none)
    bits = survey.scene.bits
    assert ber(survey.scene) * bits < 1e-9
    found = bounds(survey)
    assert found["shot noise"] == pytest.approx(1 / bits / half_width(1 / bits, bits))
    assert 0 < found["threshold noise"] < found["shot noise"] < found["diffraction"]


@pytest.mark.slow
@pytest.mark.parametrize(("given", "seeds"), [(CHOSEN, 6), (["link.size=65536"], 4)])
def test_what_effects_change_is_within_their_bounds(given: list[str], seeds: int) -> None:
    """The change of the nearly wrong bits without each constant effect, on patches of full physics,
    is within its bound, which the planner counts twice. By the closed form alone it is not."""
    scenario = linked(load("light-link", given)[1], "test")
    setup = set_up_link(scenario, camera_setting(scenario), None, QuietProgress())
    survey, camera = survey_of(setup), setup.setting.camera
    bound, bits = bounds(survey), survey.scene.bits
    closed = bounds(survey_link(setup.setting, setup.mode, setup.symbols, setup.cycles))
    air = frozenset(effect.name for effect in survey.air_effects)
    names = ("glare", "ambient on the panel", "diffraction", "optical cross-talk",
             "threshold noise", "shot noise")  # fmt: skip
    ways = {name: Variant("exact", camera, air - {name}) for name in names if name in air}
    ways |= {name: Variant("exact", camera.without({name})) for name in names if name not in air}
    moved, count, errors, compared = dict.fromkeys(names, 0), 0, 0, 0
    for seed in range(1, seeds + 1):
        patches = LinkPatches(setup.setting, setup.sent, seed)
        decided = patches.film({"full": Variant("exact", camera)} | ways, None, QuietProgress())
        full = decided["full"]
        for name in names:
            other = decided[name]
            pair = compare(full.wrong, other.wrong, bits, (full.lead, other.lead))
            # Errors themselves where there are more of them than the check's nearly wrong bits.
            both = pair if pair.near is None else pair.near
            moved[name] += both.more - both.fewer
        count += pair.full if pair.near is None else pair.near.count
        errors, compared = errors + pair.full, compared + pair.bits
    rate = max(errors / compared, 1 / bits)
    each = rate / half_width(rate, bits)
    change = {name: abs(moved[name]) / count * each for name in names}
    assert all(change[name] <= bound[name] for name in names), (change, bound)
    assert change["glare"] > 2 * closed["glare"]
    assert change["ambient on the panel"] > 2 * closed["ambient on the panel"]
