"""Bounds of the air's effects hold on simulated light, and scintillation is left out at 10 m."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from cosim import Block, Summary
from cosim.plan.planner import make_plan
from link.air import (
    Aim,
    LinkSummary,
    Scene,
    air_effects,
    ber,
    ber_units,
    f_number_for,
    levels,
    link_summary,
)
from link.air.effects import charge_changes
from link.air.setting import NAMES
from tests.link.air.scenes import AIR, CAMERA, CLOCK, OPTICS, PANEL, make

FULL = Scene(
    replace(PANEL, rise=3e-6, decay=6e-6),
    replace(OPTICS, focus=1.99, f_number=4.0, blur=0.25),
    Aim((1.0, -1.0), 0.02, (0.1, -0.05), vibration=0.02, vibration_frequency=200.0),
    replace(
        AIR, ambient=800.0, visibility=40.0, structure=1e-11, sun=2e4, sun_angle=12.0, glare=0.01
    ),
)


@cache
def _light(effects: tuple[str, ...]) -> np.ndarray:
    scene = FULL
    air = make(
        panel=scene.panel,
        optics=scene.optics,
        aim=scene.aim,
        air=scene.air,
        effects=effects,
        planes=20,
    )
    light = air.step(None, Block(0, 24))
    return np.stack([piece.first for piece in light.pieces])


@pytest.mark.parametrize("name", NAMES)
def test_a_bound_holds_on_what_is_simulated(name: str) -> None:
    """The largest change of any pixel in any plane, over a lit pixel's light, with and without."""
    with_it = _light(NAMES)
    without = _light(tuple(n for n in NAMES if n != name))
    if name == "emitter response":  # one piece a symbol, and one a plane
        without = np.concatenate([without[:1], np.repeat(without[1:-1], 2, axis=0), without[-1:]])
    found = float(np.abs(with_it - without).max()) / levels(FULL.optics, FULL.air).on
    change = charge_changes(FULL, CAMERA)[name]
    most = change.size * (6 if change.duration else 1)
    assert 0 < found <= most * (1 + 1e-3) + 2e-3
    # It says something: what acts on every pixel is bounded to within a factor.
    if name in ("fog extinction", "airlight", "lens blur", "sun", "ambient on the panel"):
        assert found > most / 4


def _summary(**changes: Any) -> LinkSummary:
    given: dict[str, Any] = {
        "darkest": 0.0, "brightest": 140.0, "threshold": 100.0, "window": 1, "cycles": 600,
        "on": 140.0, "off": 1.0, "bits": 10_000_000,
    }  # fmt: skip
    return LinkSummary(**given | changes)


def test_the_pixels_error_rate_is_the_closed_form() -> None:
    """Q = 100, mean 140: P(Poisson(140) < 100) / 2 with reset to zero, as the table of the link's
    facts has it, 5e-5 with a hundredth of Q in the dark; a residual carried makes 5e-3."""
    from scipy.stats import poisson

    exact = (poisson.cdf(99, 140) + poisson.sf(99, 1)) / 2
    assert ber(_summary()) == pytest.approx(exact, rel=1e-9)
    assert ber(_summary(carried=True)) == pytest.approx(5e-3, rel=0.2)
    # Monte Carlo of two pixels with a neighbour, decided by likelihood.
    shares = ((0.8, 0.2), (0.7, 0.3))
    scene = _summary(on=125.0, shares=shares)
    rng = np.random.default_rng(3)
    n = 200_000
    own, other = rng.random(n) < 0.5, rng.random(n) < 0.5
    light = np.array([1 + 124 * (a * own + b * other) for a, b in shares])
    flags = (rng.poisson(light) >= 100).astype(int)
    outcome = flags[0] * 2 + flags[1]
    on = np.bincount(outcome[own], minlength=4) / own.sum()
    off = np.bincount(outcome[~own], minlength=4) / (~own).sum()
    rate = ber(scene)
    errors = np.where((on > off)[outcome], ~own, own).mean()
    assert abs(errors - rate) < 4.9 * np.sqrt(rate / n)


def test_units_count_what_an_interval_resolves() -> None:
    scene = _summary(on=120.0)
    rate = ber(scene)
    half = 3.29 * np.sqrt(rate / scene.bits)  # normal, 99.9 %
    change = max(abs(ber(scene, 0.01) - rate), abs(ber(scene, -0.01) - rate))
    assert ber_units(scene, 0.01) == pytest.approx(change / half, rel=0.01)
    # A change by chance of the same size matters less, the less the more often it comes anew.
    assert 0 < ber_units(scene, 0.01, 100) < ber_units(scene, 0.01, 1) < ber_units(scene, 0.02)
    assert ber_units(scene, 0.0) == 0
    assert ber_units(scene, 1.0) == float("inf")
    with pytest.raises(TypeError, match="LinkSummary"):
        air_effects(FULL, CAMERA)[0].bound(Summary(0, 1, 1, 1, 1))


@pytest.mark.parametrize(("distance", "out"), [(10.0, True), (1000.0, False)])
def test_scintillation_is_left_out_at_ten_metres(distance: float, out: bool) -> None:
    """Cn2 1e-14 at ten metres; 1e-13 at a kilometre through a lens of its own."""
    near = distance < 100
    optics = replace(OPTICS, focal_length=0.195 if near else 1.0, pitch=500e-6 if near else 9.76e-3)
    number = f_number_for(1.4, optics, distance, 1000.0, CAMERA.electrons_per_lux, CLOCK)
    air = replace(AIR, distance=distance, structure=1e-14 if near else 1e-13, ambient=500.0)
    if not near:
        optics = replace(optics, luminance=1e5)
        number *= 10
    scene = Scene(PANEL, replace(optics, f_number=number), Aim(vibration=0.05), air)
    summary = link_summary(scene, CAMERA, cell=2, ticks=2, bits=32_000_000, cycles=600)
    effects = air_effects(scene, CAMERA)
    bounds = {e.name: e.bound(summary).value for e in effects}
    plan = make_plan(effects, summary, 0.1)
    assert ("scintillation" in plan.left_out) == out
    assert "lens blur" not in plan.left_out
    assert (bounds["scintillation"] < 0.01) == out


def test_shares_of_a_cell() -> None:
    """Without blur a camera pixel of a panel pixel's size is all in a cell of two."""
    sharp = replace(OPTICS, blur=0.0, diffraction=False, pitch=2 * 10e-6 * (2 - 39e-3) / 39e-3 / 2)
    scene = Scene(PANEL, sharp, Aim(), AIR)
    summary = link_summary(scene, CAMERA, cell=2, ticks=2, bits=1000, cycles=10)
    assert np.array(summary.shares)[:, 0] == pytest.approx(np.ones(4), abs=0.02)
    one = link_summary(scene, CAMERA, cell=1, ticks=2, bits=1000, cycles=10)
    assert np.array(one.shares)[:, 0] == pytest.approx(np.full(4, 0.25), abs=0.02)
