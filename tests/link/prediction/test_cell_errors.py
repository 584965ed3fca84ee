"""The theory beside a run's raw error rate, held against runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from link.mode import Mode
from link.plan.patches import true_timing
from link.prediction.cell_errors import cell_errors
from link.prediction.error_bound import predict_errors
from link.prediction.light import cell_scene, cell_sight
from link.setting import link_setting
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import load


def _setting(scenario):
    return link_setting(scenario, camera_setting(scenario))


def _sight(*assignments):
    setting = _setting(load("light-link", [*assignments])[1])
    late = np.zeros(setting.camera.chip.height, np.int64)
    return setting, cell_sight(setting, true_timing(setting, late, 2), 400)


def test_where_stray_light_alone_fires_every_pixel_a_bit_is_a_coin_to_the_coarse_estimate():
    setting, _ = _sight()
    mode = Mode(960, 960, 2, 2, "8b10b", 32)
    assert predict_errors(replace(cell_scene(setting), background=10.0), mode) == 0.5
    assert predict_errors(cell_scene(setting), mode) < 1e-3


def test_without_light_a_bit_is_a_coin():
    _, sight = _sight()
    found = cell_errors(
        replace(sight, scene=replace(sight.scene, on=0.0)), Mode(960, 960, 2, 2, "8b10b", 32), 512
    )
    assert found.rate == pytest.approx(0.5, abs=1e-9)
    assert found.promise == pytest.approx(0.5, abs=1e-3)


def test_twice_the_light_that_a_tick_needs_and_no_blur_make_no_errors_in_large_cells():
    """Whatever the phase, one tick of a symbol has half of the light of a tick, or more. With 1.6
    times, all pixels may carry .95 of a threshold into the next symbol, where stray light then
    fires most of them."""
    _, sight = _sight("link.aim.on_level=2.2")
    few = cell_errors(sight, Mode(960, 960, 4, 2, "8b10b", 32))
    assert few.rate < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("on", [1.4, 3.0])
def test_rows_that_meet_all_phases_err_as_often_as_in_a_film(on):
    """The panel shows all rows at once, so that symbols begin at every phase. With one law for all
    of them, as no detector has it, 3 thresholds a tick would make 20 times the errors."""
    from link.setup.pilot import film_pilot, strip_of

    setting = _setting(load("light-link", [f"link.aim.on_level={on}", "link.panel.row_scan=0"])[1])
    strip, mode = strip_of(setting), Mode(128, 960, 2, 2, "8b10b", 32)
    film = film_pilot(strip, mode, "joint", 7, None)
    measured = ((film.soft > 0) != film.sent)[:-2].mean()
    late = np.zeros(strip.camera.chip.height, np.int64)
    sight = cell_sight(strip, true_timing(strip, late, 2), 100)
    assert np.ptp(sight.phases) > 0.9
    assert 1 / 2 < measured / cell_errors(sight, mode).rate < 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ticks", "missed"), [(2, 4), (3, 20)]
)  # the coarse estimate misses errors by more than so many times
def test_small_cells_err_as_often_as_in_a_film(ticks, missed):
    from link.setup.pilot import film_pilot, strip_of

    setting = _setting(load("light-link", ["link.distance=5 m"])[1])
    strip = strip_of(setting)
    mode = Mode(128, 960, 4, ticks, "8b10b", 32)
    film = film_pilot(strip, mode, "joint", 7, None)
    soft, sent = film.soft[:-2], film.sent[:-2]  # the last ones have dark symbols behind them
    measured = ((soft > 0) != sent).mean()
    late = np.zeros(strip.camera.chip.height, np.int64)
    theory = cell_errors(cell_sight(strip, true_timing(strip, late, ticks), 100), mode)
    assert theory.low < theory.rate < theory.high
    assert 1 / 2 < measured / theory.rate < 2
    assert measured > missed * predict_errors(cell_scene(strip), mode)
