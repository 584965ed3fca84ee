"""The pixel against closed forms: counts under constant light for each reset rule and clock."""

import numpy as np
import pytest

from rtl_model.cycle import Settings, System, planes
from rtl_model.cycle.array import rows_of
from rtl_model.cycle.planes import increments
from rtl_model.geometry import Geometry
from rtl_model.registers import MEMORIES, REGISTERS, quantum

ADDRESS = {register.name: register.address for register in REGISTERS}
PATTERN = next(memory.address for memory in MEMORIES if memory.name == "pattern_mem")
RESIDUAL, HARD, SUBTRACT = range(3)
STRIP = Geometry(rows=1, columns=256, clock_hz=48_000_000)
ALL_STEPS = np.arange(256)[None]  # one pixel of each number of electrons


def burst(settings, frames, pattern=ALL_STEPS, geometry=STRIP):
    return planes(geometry, settings, pattern, frames)


@pytest.mark.parametrize("level", range(16))
@pytest.mark.parametrize("rule", [RESIDUAL, SUBTRACT])
def test_constant_light_gives_floor_of_collected_over_threshold(level, rule):
    """Charge is conserved, so n ticks of p electrons give floor(n p / q) spikes; q > p always."""
    frames, q = 200, quantum(level)
    counted = burst(Settings(threshold=level, reset_rule=rule), frames).cumsum(axis=0)
    n = np.arange(1, frames + 1)[:, None]
    np.testing.assert_array_equal(counted[:, 0], n * ALL_STEPS // q)


@pytest.mark.parametrize("level", [0, 1, 7, 15])
def test_at_20_khz_a_tick_collects_twice(level):
    """floor(2 n p / q) spikes if 2p < q; a tick gives one at most, residual drops the rest."""
    q, frames = quantum(level), 150
    for rule in (RESIDUAL, SUBTRACT):
        settings = Settings(threshold=level, clock_select=1, reset_rule=rule)
        counted = burst(settings, frames).sum(axis=0)[0]
        below = 2 * ALL_STEPS[0] < q
        np.testing.assert_array_equal(counted[below], (2 * frames * ALL_STEPS[0] // q)[below])
        assert (counted[~below] >= frames // 2).all()


@pytest.mark.parametrize("level", range(16))
def test_hard_reset_has_an_interval_of_q_over_p_rounded_up(level):
    q, frames = quantum(level), 1400
    steps = np.array([3, 7, 50, 100, 200, 254, 255])
    geometry = STRIP._replace(columns=steps.size)
    fired = planes(geometry, Settings(threshold=level, reset_rule=HARD), steps[None], frames)
    for pixel, p in enumerate(steps):
        ticks = np.flatnonzero(fired[:, 0, pixel]) + 1
        interval = -(-q // p)
        np.testing.assert_array_equal(ticks, interval * np.arange(1, frames // interval + 1))


def test_a_saturated_charge_lasts_as_long_as_the_rule_says():
    """4095 electrons under the highest threshold, 4095, then the lowest, 255, in the dark."""
    geometry = STRIP._replace(columns=1)
    for rule, spikes in ((SUBTRACT, 4094 // 255), (HARD, 1), (RESIDUAL, 4094 // 510)):
        charge = np.array([[4094]])
        settings = Settings(threshold=0, reset_rule=rule)
        fired = planes(geometry, settings, np.zeros((1, 1)), 40, charge)
        assert fired.sum() == spikes
        assert charge[0, 0] == (0 if rule == HARD else 4094 % 255)


def test_patterns_are_as_drawn():
    row, column = np.ogrid[:3, :4]
    ramp = increments(2, 250, 5, row, column, 0)
    assert ramp[0, 0] == 255 and ramp[0, 1] == 0 and ramp[2, 3] == 4
    checker = increments(3, 9, 1, row, column, 0)
    assert checker.tolist() == [[9, 0, 9, 0], [0, 9, 0, 9], [9, 0, 9, 0]]


@pytest.mark.parametrize("geometry", [Geometry(rows=4, columns=70), Geometry(4, 70, 64)])
@pytest.mark.parametrize("pattern", range(4))
def test_the_system_gives_the_planes(geometry, pattern):
    rng = np.random.default_rng(pattern)
    image = rng.integers(256, size=(4, 70))
    wide = np.zeros((4, geometry.tiles * geometry.lanes), np.uint8)
    wide[:, :70] = image
    wide[:, 70:] = 255  # pixels that are not there do not fire
    system, frames = System(geometry), 30
    for n, word in enumerate(wide.view("<u4").reshape(-1)):
        system.write(PATTERN + 4 * n, int(word))
    settings = Settings(2, 1, 0, (1, 2), (3, 66), pattern, 200)
    for name, value in [
        ("threshold", 2),
        ("clock_select", 1),
        ("rows", 2 << 16 | 1),
        ("columns", 66 << 16 | 3),
        ("pattern", pattern),
        ("level", 200),
        ("tick_clocks", 0),
        ("run", 1),
    ]:
        system.write(ADDRESS[f"sensor_{name}"], value)
    tiles = system.run(frames * 2 * geometry.tick_minimum)
    made = rows_of(tiles, geometry).reshape(frames, 2, 70)
    truth = planes(geometry, settings, image, frames)
    np.testing.assert_array_equal(made, truth[:, 1:3])
    assert system.read(ADDRESS["sensor_spikes"]) == truth.sum() > 100
    assert system.read(ADDRESS["sensor_rows_read"]) == 2 * frames
    assert system.read(ADDRESS["sensor_frames"]) == frames + 1  # the next has just begun
