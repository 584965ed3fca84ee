"""Error rates of symbols of one tick: the law of the drawn spikes, and rates held against film."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from link.mode import Mode
from link.prediction.cell_errors import cell_errors
from link.prediction.chain_errors import _spikes, chain_errors
from link.prediction.drawn_cells import CellSight
from link.prediction.light import cell_sight
from link.sending import FileTransmission
from link.setting import LinkSetting, link_setting
from link.setup.pilot import film_pilot, strip_of
from link.setup.truth import true_timing
from link.theory import hard_patterns
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import load

MODE = Mode(128, 960, 2, 1, "scrambled", 32)


def _strip(phase: float) -> LinkSetting:
    scenario = load("light-link", [f"link.panel.phase={phase}", "link.panel.clock_offset=0"])[1]
    return strip_of(link_setting(scenario, camera_setting(scenario)))


def _sight(strip: LinkSetting) -> CellSight:
    sent = FileTransmission(MODE, b"0", "x")
    late = strip.make_air(sent, sent.planes).row_delay
    return cell_sight(strip, true_timing(strip, late, 1), 60)


def test_drawn_spikes_have_the_closed_law() -> None:
    rng, charge = np.random.default_rng(1), np.array([0.9, 0.3, 1.0, 0.55, 0.5])
    q, noise, count = 50.0, 5.0, 100_000
    spikes = np.empty((count, 5), np.bool_)
    normal = rng.standard_normal(spikes.shape, np.float32)
    _spikes(np.tile(charge, (count, 1)), normal, q * q / (q + noise * noise), spikes)
    found = np.bincount(spikes @ (1 << np.arange(5)), minlength=32) / count
    law = hard_patterns(charge, 5, q, noise)
    assert np.abs(found - law).max() < 5 * np.sqrt(0.25 / count)
    assert 0.1 < law.max() < 0.9


def test_without_light_a_bit_is_a_coin() -> None:
    sight = _sight(_strip(0.25))
    dark = replace(sight, scene=replace(sight.scene, on=0.0))
    assert chain_errors(dark, MODE, 1024).rate == pytest.approx(0.5, abs=0.02)


def test_longer_symbols_are_refused() -> None:
    with pytest.raises(ValueError, match="must be of 1 tick, not 2"):
        chain_errors(_sight(_strip(0.25)), replace(MODE, ticks=2))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("phase", "within", "missed"), [(0.25, 1.25, 1.5), (0.5, 1.2, 1.0), (0.75, 1.2, 1.5),
                                    (0.0, 3.0, 1.5)]
)  # fmt: skip
def test_cells_err_as_often_as_in_a_film(phase: float, within: float, missed: float) -> None:
    """`missed`: the estimate that takes the bits around as known misses so much at least. With the
    clock locked (phase 0) film has more errors than theory, by up to `within`."""
    strip = _strip(phase)
    film = film_pilot(strip, MODE, "packed", 7, None)
    measured = ((film.soft > 0) != film.sent)[:-2].mean()
    sight = _sight(strip)
    found, known = chain_errors(sight, MODE), cell_errors(sight, MODE)
    assert found.low < found.rate < found.high
    assert 1 / within < measured / found.rate < within
    assert measured > missed * known.rate
