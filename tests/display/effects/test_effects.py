"""The display's effects: changes of weights in closed form, and settings that leave them out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import gamma

from cosim import Summary
from cosim.spikes.viform import pack_planes
from display import CameraPlane, DisplaySetting, FixedEye, PursuingEye, SpikePanel
from display.effects.weights import delay_change, effective_planes, span_change, weight_steps
from display.observe.observers import STAGES, eye_time
from display.render.golden import GoldenRenderer
from tests.display.random_streams import CLOCK

PANEL = SpikePanel((4, 4), CLOCK, 0.6)
PLANES = 4096
MIDDLE = PANEL.start(2048)
EYE = FixedEye((MIDDLE,), 300.0, PANEL.start(0), PANEL.start(PLANES + 1))
PLANE_S = 1 / CLOCK.hz


def slope_squared() -> float:
    """Integral of the squared slope of the eye's response, 1 / s^3: for the Gamma density of k
    stages, (k - 1) ... of its own square's: 2 Gamma(2k - 3) (k - 1) / (Gamma(k)^2 2^(2k - 1))."""
    k, tau = STAGES, eye_time(300.0)
    # W = x^(k-1) e^-x / Gamma(k); W' = ((k-1) x^(k-2) - x^(k-1)) e^-x / Gamma(k).
    terms = (
        (k - 1) ** 2 * gamma(2 * k - 3) / 2 ** (2 * k - 3)
        - 2 * (k - 1) * gamma(2 * k - 2) / 2 ** (2 * k - 2)
        + gamma(2 * k - 1) / 2 ** (2 * k - 1)
    )
    return float(terms / gamma(k) ** 2 / tau**3)


def test_spans_of_an_eye_change_what_its_slope_says():
    """In a span of T seconds weights rise by W' (t - middle) a plane's time: sum of the squares
    W'^2 T^2 / 12 (1 - 1 / n^2), half the sum of the sizes W' T^2 / 8 a span."""
    for n in (8, 64):
        change = span_change(EYE, PANEL, PLANES, 1, n)
        span = n * PLANE_S
        root = np.sqrt(PLANE_S * span**2 / 12 * (1 - 1 / n**2) * slope_squared())
        assert change.root == pytest.approx(root, rel=0.01)
        spans = np.sqrt(slope_squared() / span) * span**2 / 8
        assert change.spans == pytest.approx(spans, rel=0.01)
        assert change.travel == 0 and change.lost == pytest.approx(0, abs=1e-12)
    eight = span_change(EYE, PANEL, PLANES, 8, 64).root
    whole, fine = (span_change(EYE, PANEL, PLANES, 1, n).root for n in (64, 8))
    assert eight == pytest.approx(np.sqrt(whole**2 - fine**2), rel=1e-9)  # they are orthogonal


def test_light_a_plane_late_changes_as_the_response_peaks():
    """Half the variation of W is its peak: half = peak times the delay."""
    k, tau = STAGES, eye_time(300.0)
    peak = (k - 1) ** (k - 1) * np.exp(-(k - 1)) / gamma(k) / tau
    late = round(PANEL.row_delay)
    change = delay_change(EYE, PANEL, PLANES, late)
    assert change.half == pytest.approx(peak * PLANE_S, rel=0.01)
    # What counts alike: 1 / integral of W^2.
    squared = gamma(2 * k - 1) / 2 ** (2 * k - 1) / gamma(k) ** 2 / tau
    assert effective_planes(EYE, PANEL, PLANES) == pytest.approx(1 / (squared * PLANE_S), rel=0.01)


def test_an_exposure_is_cut_at_its_edges():
    """40 planes from the third of a span of 8 on: the two spans at its ends give weight 1/40 to
    two planes of eight, or to six, that should have none: half = (2 * 6 / 8) / 40 at each end."""
    start, stop = PANEL.start(1002), PANEL.start(1042)
    camera = CameraPlane(((start + stop) // 2,), stop - start)
    change = span_change(camera, PANEL, PLANES, 1, 8)
    assert change.half == pytest.approx(2 * (2 * 6 / 8) / 40, rel=1e-6)
    assert change.jump == pytest.approx(2 * 6 / 8 / 40, rel=1e-6)
    assert change.unseen == 1000 and change.lost == pytest.approx(0, abs=1e-12)


def test_a_pursuing_eye_travels_within_a_span():
    """The mean distance from the middle of 8 places 1/8 T apart is T / 4; a pixel is the most."""
    for speed in (10.0, 800.0):
        eye = PursuingEye(EYE, (0.0, speed))
        change = span_change(eye, PANEL, PLANES, 1, 8)
        assert change.travel == pytest.approx(speed * 8 * PLANE_S / 4, rel=1e-3)
    assert span_change(PursuingEye(EYE, (0.0, 1e6)), PANEL, PLANES, 1, 8).travel <= 1.0000001
    late = delay_change(PursuingEye(EYE, (0.0, 800.0)), PANEL, PLANES, round(PANEL.row_delay))
    assert late.travel == pytest.approx(800 * PLANE_S, rel=0.01)


def test_what_an_unequal_emitter_makes_of_its_own_is_the_bound_s_second_part():
    """A packet at rise 0 and decay d planes, far apart: light 1 + d (1 - e^(-1/d)...) in closed
    form; the bound's size is that gain."""
    decay, pulse = 0.5, 0.25
    panel = replace(PANEL, shape=(1, 1), drive="impulse", pulse=pulse, decay=decay * PLANE_S)
    at = np.zeros((PLANES, 1, 1), np.uint8)
    at[::40] = 1
    renderer = GoldenRenderer(panel, 1, 1)
    renderer.step(pack_planes(at), PLANES, None)
    gain = renderer.light.sum() / at.sum() - 1
    assert gain == pytest.approx(decay / pulse, rel=1e-3)  # it decays from 1 / pulse
    effect = DisplaySetting(panel, EYE).acting_effects[-1]
    assert effect.name == "emission rise and decay"
    rate = np.array([1000.0 / 40])
    scene = Summary(rate, rate, 1000.0, 41, PLANES, 1e-3, 0.0, np.zeros(1))
    bound = effect.bound(scene)
    # Relative to the light without it, and a little for its being late.
    assert gain <= bound.value[0] < 1.2 * gain and bound.kind == "estimate"


def test_settings_leave_out_what_they_are_told():
    names = ["planes within 8", "planes within 64", "row timing", "emission rise and decay"]
    full = DisplaySetting(replace(PANEL, rise=1e-6), EYE)
    assert [e.name for e in full.acting_effects] == names
    assert full.without([]) == full
    assert full.without(["planes within 64"]) == full  # not before the finer
    eight = full.without(["planes within 8"])
    assert eight.batch == 8 and [e.name for e in eight.acting_effects] == names[1:]
    assert full.without(names[:2]) == eight.without(["planes within 64"])
    none = full.without(names)
    assert none.acting_effects == () and (none.batch, none.row_timing) == (64, False)
    assert (
        none.panel.rise == 0
        and none.simulated_panel.row_scan == 0
        and full.simulated_panel == full.panel
    )
    plain = DisplaySetting(replace(PANEL, row_scan=0.0), EYE)
    assert [e.name for e in plain.acting_effects] == names[:2]


def test_the_coarser_spans_cost_less_to_keep_and_all_effects_have_a_source():
    full = DisplaySetting(replace(PANEL, rise=1e-6), EYE)
    costs = {e.name: e.cost(None) for e in full.acting_effects}
    assert costs["planes within 8"] > 10 * costs["planes within 64"] > 0
    assert all(
        e.source and e.scope == "plane" and c > 0
        for e, c in zip(full.acting_effects, costs.values(), strict=True)
    )


def test_the_weights_of_an_exposure_step_at_its_ends():
    """Of 40 planes: two steps of 1 / 40. Light held for 4 planes steps by a quarter in 4 planes."""
    start, stop = PANEL.start(1002), PANEL.start(1042)
    camera = CameraPlane(((start + stop) // 2,), stop - start)
    still = replace(PANEL, row_scan=0.0)
    for held in (1, 4):
        steps = [(s, n) for s, n in weight_steps(camera, still, PLANES, held, False) if s > 1e-6]
        ((size, planes),) = steps
        assert 1 / 40 / held <= size < 2 / 40 / held and planes == 2 * held
    assert [n for s, n in weight_steps(camera, still, PLANES, 1, True) if s > 1e-6] == []
    # An exposure to the end of the run steps to zero there.
    last = CameraPlane(((PANEL.start(PLANES - 40) + PANEL.start(PLANES)) // 2,), stop - start)
    ((_, planes),) = [(s, n) for s, n in weight_steps(last, still, PLANES, 4, True) if s > 1e-6]
    assert planes == 4
