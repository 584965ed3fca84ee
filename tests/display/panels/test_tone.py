"""Laws of tone mapping, the threshold of an eye, and the range that an eye sees of discs."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from display.panels.tone import LAWS, Law, Tone, closed_form, seen_range, visible_difference

PEAK = 1000.0
TONES = [
    Tone("clip", 300.0, PEAK, 5.0), Tone("clip", 4000.0, PEAK, 5.0), Tone("log", 300.0, PEAK, 5.0),
    Tone("reinhard", 300.0, PEAK, 2.0), Tone("reinhard", 300.0, PEAK, 8.0),
]  # fmt: skip


@pytest.mark.parametrize("tone", TONES)
def test_a_law_rises_from_dark_to_at_most_the_peak_and_is_inverted(tone: Tone) -> None:
    light = np.geomspace(1e-9, tone.brightest, 400)
    share = tone.share(light)
    assert tone.share(0.0) == 0 and (np.diff(share) > 0).all() and share[0] > 0
    assert share.max() <= 1 + 1e-12 and tone.white == tone.share(1.0)
    back = [tone.light(float(each)) for each in share]
    np.testing.assert_allclose(back, light, rtol=1e-6)  # of a flat law near white
    assert tone.share(100.0) <= 1


def test_known_points_of_the_laws() -> None:
    assert Tone("clip", 300.0, PEAK, 5.0).white == pytest.approx(0.3)
    assert Tone("clip", 4000.0, PEAK, 5.0).brightest == pytest.approx(0.25)
    log = Tone("log", 300.0, PEAK, 4.0)
    assert all(Tone("log", 300.0, PEAK, decades).brightest == 1 for decades in (2.0, 5.0, 8.0))
    # Far above 10^-4 of white, a decade has the same share everywhere.
    steps = np.diff(log.share([1e-2, 1e-1, 1.0]))
    assert steps == pytest.approx([0.25, 0.25], abs=0.001)
    reinhard = Tone("reinhard", 300.0, PEAK, 3.0)
    # White at the peak; a thousandth of it at about a half.
    assert reinhard.white == pytest.approx(1.0) and reinhard.share(1e-3) == pytest.approx(
        0.5, abs=1e-5
    )


@pytest.mark.parametrize(
    ("adapted", "threshold"),
    [
        (1e-6, 10**-2.86),  # dark light of the rods
        (0.1, 0.1 * 10**-0.395),  # rods follow Weber's law
        (1000.0, 1000 * 10**-1.255),  # cones do
    ],
)
def test_the_threshold_of_an_eye(adapted: float, threshold: float) -> None:
    assert visible_difference(adapted) == pytest.approx(threshold, rel=1e-9)


def test_the_threshold_rises_and_has_no_large_steps() -> None:
    """The published pieces join within .013 of a decade."""
    at = np.geomspace(1e-6, 1e4, 2000)
    log = np.log10([visible_difference(each) for each in at])
    assert np.diff(log).min() > -0.013 and np.diff(log).max() < 0.02
    assert log[-1] - log[0] > 5


@pytest.mark.parametrize("tone", TONES)
@pytest.mark.parametrize("per_decade", [1, 5])
def test_an_ideal_panel_is_seen_as_the_closed_form_says(tone: Tone, per_decade: int) -> None:
    light = 10.0 ** -(np.arange(9 * per_decade + 1) / per_decade)
    shown = tone.share(light) * PEAK
    adapted = float(shown.mean())
    found = seen_range(tone, light, shown, 0.0, adapted)
    top, dim = closed_form(tone, 1.0, float(light[-1]), adapted)
    assert found.scene == pytest.approx(9) and found.clipped == top
    assert found.eye == pytest.approx(dim, abs=1e-5) and found.camera == pytest.approx(0, abs=1e-5)
    assert found.seen == pytest.approx(9 - top - dim, abs=1e-5)
    least = tone.light(visible_difference(adapted) / PEAK)
    assert dim == pytest.approx(max(math.log10(least / light[-1]), 0.0))


def test_what_the_planes_lack_is_lost_before_the_panel() -> None:
    tone = Tone("log", 300.0, PEAK, 8.0)
    light = 10.0 ** -np.arange(10.0)
    shown = np.where(light > 1e-4, tone.share(light) * PEAK, 0.0)
    found = seen_range(tone, light, shown, 0.0, 100.0)
    _, dim = closed_form(tone, 1.0, 1e-9, 100.0)
    assert found.eye == pytest.approx(dim) and dim < 2
    assert found.seen == pytest.approx(3) and found.camera == pytest.approx(6 - dim)
    assert "3.00 of the scene's 9.00 decades" in found.told


def test_an_eye_that_sees_nothing_sees_no_range() -> None:
    tone = Tone("clip", 300.0, 300.0, 8.0)
    light = np.array([1.0, 0.1])
    found = seen_range(tone, light, np.zeros(2), 0.0, 1e4)
    assert found.seen == 0 and found.eye == pytest.approx(1)


def test_the_laws_are_those_of_the_key() -> None:
    made: list[Law] = ["clip", "log", "reinhard"]
    assert tuple(LAWS[1:]) == tuple(made)
    for law in made:
        assert dataclasses.replace(TONES[0], law=law).share(0.5) > 0
