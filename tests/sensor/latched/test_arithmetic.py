"""The bounds of the tiers' arithmetic against the reference."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cosim import PS, Block, Clock, Light, Piece, Summary
from cosim.compute.opencl import Device
from cosim.plan.tiles import TILE
from sensor import CHIPS, CameraSetting
from sensor.circuit.circuit import Circuit
from sensor.circuit.lumped import lump
from sensor.device.pattern import DevicePattern
from sensor.latched.arithmetic import (
    FLOAT_RMS,
    LAW_BIAS,
    LAW_RMS,
    TABLE_BIAS,
    TABLE_RMS,
    exact_error,
    fast_error,
)
from sensor.latched.camera import SpikeCamera
from sensor.latched.fast.units import quantile, units_of
from sensor.latched.pixel.charge import ONE
from sensor.latched.pixel.interval import interval_table, threshold
from sensor.latched.reference.law import draw_all, law_of
from sensor.latched.sampling import RowTiming
from sensor.latched.tiers import Tier, tier_pixels
from sensor.latched.written import pending_of
from tests.sensor.latched.random_scenes import PERIOD, Scene, random_scene, rates

CLOCK = Clock.from_hz(40e3)


def setting(**more: object) -> CameraSetting:
    chip = more.pop("chip", CHIPS["spiketwo"])
    return CameraSetting(chip, CLOCK, 1000.0, 3, **more)  # type: ignore[arg-type]


def scene(camera: CameraSetting, low: object, high: object, planes: float = 0.1) -> Summary:
    """Tiles whose light lies between `low` and `high` thresholds a cycle."""
    least, most = (np.atleast_1d(np.asarray(x, float)) * 1000.0 for x in (low, high))
    return Summary(
        least, most, 1000.0, 41, 400, 1 / 41, camera.spread, planes, camera.slack,
        camera.dead_time * CLOCK.hz, camera.uneven,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("q", "sigma"),
    [(10.0, 0.0), (1000.0, 0.0), (20_000.0, 0.0), (1000.0, 5.8), (200.0, 20.0), (2e6, 3e4)],
)
def test_the_table_of_thresholds_errs_as_stated(q: float, sigma: float) -> None:
    words = np.random.default_rng(1).integers(0, 2**32, 500_000, dtype=np.uint32)
    off = threshold(interval_table(q, sigma), words) / ONE - draw_all(law_of(q, sigma), words)
    spread = np.hypot(np.sqrt(q), sigma) / q
    assert 0.7 * TABLE_RMS < off.std() / (spread * q) < 1.1 * TABLE_RMS
    assert abs(off.mean()) / q < TABLE_BIAS * spread**2


@pytest.mark.parametrize("q", [1.0, 3.0, 10.0, 100.0, 1000.0, 30_000.0])
def test_thresholds_of_the_fast_tier_err_as_stated(q: float) -> None:
    model = replace(setting(), threshold=q).model
    units, table = units_of(model), model.table()
    words = np.random.default_rng(1).integers(0, 2**32, 500_000, dtype=np.uint32)
    off = quantile(units.table, words) - threshold(table, words) * (units.one / model.q)
    assert 0.6 * LAW_RMS < off.std() / units.error < LAW_RMS
    assert abs(off.mean()) / units.error < LAW_BIAS


@pytest.mark.parametrize("uneven", [False, True])
@pytest.mark.parametrize("moving", [False, True])
def test_light_of_the_fast_tier_is_rounded_as_stated(
    device: Device, moving: bool, uneven: bool
) -> None:
    """Phases of both tiers after 4000 cycles, without noise and dead time."""
    case = random_scene(7)
    pattern = DevicePattern(prnu=0.01, dark=1000.0, dsnu=0.1, threshold_fpn=0.01, device_seed=1)
    camera = setting(chip=case.setting.chip, pattern=pattern if uneven else None)
    camera = camera.without(["shot noise"])
    rng, planes = np.random.default_rng(2), []
    for _ in range(101):
        share = rng.uniform(0.2, 0.4, case.light.pieces[0].first.shape)
        planes.append((share * 40e6 / camera.electrons_per_lux).astype(np.float32))
    if not moving:
        planes = planes[:1] * 101
    light = Light(tuple(
        Piece(40 * n * PERIOD - PS * (n == 0), 40 * (n + 1) * PERIOD, first, last)
        for n, (first, last) in enumerate(itertools.pairwise(planes))
    ))  # fmt: skip
    case = replace(case, setting=camera, light=light, window=(0, 4000))
    off = (rates(case, camera, "fast", device) - rates(case, camera)) / 0.3
    rms = float(np.sqrt((off**2).mean()))
    assert (0.0 if moving else 0.5 * FLOAT_RMS) < rms < FLOAT_RMS


def _actual(case: Scene, tier: Tier = "exact", device: Device | None = None) -> float:
    """RMS error of a tier, relative to the mean rate or the floor."""
    truth = rates(case, case.setting, "reference")
    error = rates(case, case.setting, tier, device) - truth
    return float(np.sqrt((error**2).mean()) / max(truth.mean(), case.summary.floor))


def _exceeded(seeds: range) -> list[int]:
    return [
        seed for seed in seeds
        if _actual(case := random_scene(seed)) > exact_error(case.setting, case.summary).max()
    ]  # fmt: skip


def test_the_exact_tier_keeps_its_bound() -> None:
    assert len(_exceeded(range(100))) <= 1


@pytest.mark.slow
def test_the_exact_tier_keeps_its_bound_in_a_thousand_scenes() -> None:
    assert len(_exceeded(range(100, 1100))) <= 5


def _exceeded_by_fast(seeds: range, device: Device) -> list[int]:
    return [
        seed for seed in seeds
        if _actual(case := random_scene(seed), "fast", device)
        > fast_error(case.setting, case.summary).max()
    ]  # fmt: skip


def test_the_fast_tier_keeps_its_bound(device: Device) -> None:
    assert len(_exceeded_by_fast(range(100), device)) <= 1


@pytest.mark.slow
def test_the_fast_tier_keeps_its_bound_in_a_thousand_scenes(device: Device) -> None:
    assert len(_exceeded_by_fast(range(100, 1100), device)) <= 5


def _steady(light: float, **more: object) -> tuple[Scene, float]:
    """A tile of full size under uniform light, thresholds a cycle, and the RMS difference of its
    rates between the exact tier and the reference."""
    case = random_scene(7)
    camera = setting(**more)
    lux = np.full((3 * TILE, 3 * TILE), light * 1000 / camera.electrons_per_lux * 40e3, np.float32)
    case = replace(
        case, setting=camera, light=Light((Piece(-PS, 2**60, lux, lux),)), window=(15, 56),
        summary=replace(scene(camera, light, light, planes=0.0), window=41),
    )  # fmt: skip
    error = rates(case, camera) - rates(case, camera, "reference")
    return case, float(np.sqrt((error**2).mean()))


@pytest.mark.parametrize("reset", ["subtract", "hard", "residual"])
@pytest.mark.parametrize("light", [0.1, 0.4, 0.8])
def test_a_dead_time_over_the_end_of_a_window_counts_in_it(reset: str, light: float) -> None:
    """Steady light: a dead time that has yet to pass is charged as in the other tiers. Else the
    difference of both ends would be dead x light x sqrt(2 p (1 - p)), with p spikes a cycle."""
    dead = 0.04
    case, error = _steady(light, reset=reset, dead_time=dead / CLOCK.hz)
    share = light / (1 + light * dead)
    assert error < dead * light * np.sqrt(2 * share * (1 - share)) / 41 / 20
    assert error < exact_error(case.setting, case.summary).max() * light


@pytest.mark.parametrize("light", [0.1, 0.7])
@pytest.mark.parametrize("trip", [0.0, 0.5])
def test_a_reset_of_a_circuit_over_the_end_of_a_window_counts_in_it(
    light: float, trip: float
) -> None:
    """The exact tier has it lumped, as a dead time."""
    circuit = Circuit(1e-14, reset_time=0.3 / CLOCK.hz, trip=trip, gain=1e3, bandwidth=1e10)
    one = lump(circuit, 1000.0, 40.0, 40e6)
    case, error = _steady(
        light, circuit=circuit, dead_time=one.dead_time, overshoot=one.shift, leak=one.dark_current,
        lumped_error=one.bound,
    )  # fmt: skip
    assert error < 1e-5 < exact_error(case.setting, case.summary).max() * light


def test_what_a_dead_time_has_yet_to_lose_is_the_light_of_its_latch() -> None:
    """Hard reset: a pixel that fired in the last cycle loses the dead time at the light of the
    latch, in each piece of the light and at its end."""
    dead, chip = 0.5, replace(CHIPS["spiketwo"], width=8, height=8)
    camera = setting(reset="hard", dead_time=dead / CLOCK.hz, chip=chip)
    camera = camera.without(["shot noise", "threshold noise"])
    lux = 1000 / camera.electrons_per_lux * 40e3
    high, low = (np.full((8, 8), x * lux, np.float32) for x in (0.9, 0.3))
    light = Light((
        Piece(-PERIOD, 10 * PERIOD, high, high), Piece(10 * PERIOD, 20 * PERIOD, high, low),
        Piece(20 * PERIOD, 2**60, low, low),
    ))  # fmt: skip
    numbers = np.arange(64, dtype=np.uint32)
    pixels, counts = tier_pixels("reference", camera, (8, 8), numbers, np.arange(8)), np.zeros(32)
    for cycle in range(32):
        level = np.interp(cycle + 1, [10, 20], [0.9, 0.3])
        fired = pixels.expose(light, cycle, 1)[0] > 0
        np.testing.assert_allclose(pending_of(pixels), np.where(fired, dead * level, 0), rtol=1e-6)
        counts[cycle] = fired.sum()
    assert all(part.any() for part in np.split(counts, [10, 20]))


def test_light_that_changes_near_one_spike_a_cycle_is_out_of_reach() -> None:
    camera = setting(dead_time=1e-7)
    steady = scene(camera, [0.5, 0.95], [0.5, 0.95], planes=0.0)
    assert exact_error(camera, steady).max() < 1e-2 > exact_error(camera, steady)[0] > 0
    moving = exact_error(camera, scene(camera, [0.1, 0.1], [0.5, 0.95]))
    assert moving[0] < 1e-3 < moving[1]
    # Without dead time only the tables differ, and a spike is lost in few tiles.
    still = setting()
    assert exact_error(still, scene(still, 0.1, 0.6)).max() < 1e-5


def test_light_without_jumps_is_off_by_less_in_dead_time() -> None:
    """A ramp over the window: the phase that dead time is off by, in closed form, and the bound."""
    dead, cycles, low, high = 32 / 65536, 8, 0.2, 0.7  # short, as its rest at the end matters else
    case = random_scene(7)
    camera = setting(dead_time=dead / CLOCK.hz).without(["shot noise", "threshold noise"])
    lux = 1000 / camera.electrons_per_lux * 40e3
    first, last = (np.full((3 * TILE, 3 * TILE), x * lux, np.float32) for x in (low, high))
    light = Light((
        Piece(-PERIOD, 0, first, first), Piece(0, cycles * PERIOD, first, last),
        Piece(cycles * PERIOD, 2**60, last, last),
    ))  # fmt: skip
    tile = replace(scene(camera, low, high), cycles=cycles, window=cycles)
    ramp = replace(tile, slope=(high - low) * 1000 / cycles)
    case = replace(case, setting=camera, light=light, window=(0, cycles), summary=ramp)
    off = (rates(case, camera) - rates(case, camera, "reference")) * cycles
    spikes = (low + high) / 2 * cycles
    rms = float(np.sqrt((off**2).mean()))
    # Of each spike, uniform within its cycle: the light half a cycle away, with either sign.
    assert 0 < rms < 1.5 * dead * (high - low) / cycles * np.sqrt(spikes / 12)
    assert rms / spikes < exact_error(camera, ramp)[0]
    # Noise spreads the phases, and spikes at the ends of a window matter less.
    noisy = setting(dead_time=dead / CLOCK.hz)
    tile = replace(tile, spread=noisy.spread, window=400, cycles=400)
    ramp = replace(tile, slope=(high - low) * 1000 / 400)
    assert exact_error(noisy, ramp)[0] < exact_error(noisy, tile)[0] / 2


@pytest.mark.parametrize("tier", ["exact", "fast"])
def test_spikes_fall_into_the_brighter_part_of_a_cycle(tier: Tier, device: Device) -> None:
    """Light that goes up and down within each cycle: the mean of what dead time is off by is the
    variance of the light, in closed form, and the bound holds it."""
    dead, cycles, low, high = 0.08, 400, 0.05, 0.95
    case = random_scene(7)
    camera = setting(dead_time=dead / CLOCK.hz, threshold_noise=200.0)  # it mixes the phases
    lux = 1000 / camera.electrons_per_lux * 40e3
    dark, lit = (np.full((3 * TILE, 3 * TILE), x * lux, np.float32) for x in (low, high))
    half = PERIOD // 2
    light = Light((
        Piece(-2 * PERIOD, 0, dark, dark),
        *(Piece(n * half, (n + 1) * half, *((lit, dark) if n % 2 else (dark, lit)))
          for n in range(2 * cycles)),
        Piece(2 * cycles * half, 2**60, dark, dark),
    ))  # fmt: skip
    tile = replace(
        scene(camera, low, high), cycles=cycles, window=cycles,
        moved=2000.0 * cycles * (high - low),
    )  # fmt: skip
    case = replace(case, setting=camera, light=light, window=(0, cycles), summary=tile)
    given = device if tier == "fast" else None
    off = (rates(case, camera, tier, given) - rates(case, camera, "reference")).mean() * cycles
    expected = dead * (high - low) ** 2 / 12 * cycles
    assert 0.6 * expected < off < 1.3 * expected
    error = exact_error if tier == "exact" else fast_error
    assert off / cycles / ((low + high) / 2) < error(camera, tile)[0] < 0.2


@pytest.mark.parametrize("tier", ["exact", "fast"])
def test_dead_time_stays_where_the_length_of_a_cycle_has_noise(tier: Tier, device: Device) -> None:
    """Timing noise moves what is compared, not the light that a spike loses."""
    chip = replace(CHIPS["spiketwo"], width=TILE, height=TILE)
    camera = setting(
        chip=chip, dead_time=0.1 / CLOCK.hz, row_timing=RowTiming(0.1, 0.0, 0.5, 100.0)
    ).without(["shot noise"])  # fmt: skip
    lux = np.full((TILE, TILE), 500 / camera.electrons_per_lux * 40e3, np.float32)
    light, phases = Light((Piece(-PS, 2**60, lux, lux),)), []
    for each in (tier, "reference"):
        one = SpikeCamera(camera, device if each == "fast" else None, tier=each)
        bits = one.step(light, Block(0, 2000)).planes().sum(axis=0).ravel()
        phases.append(bits + one.fraction() - pending_of(one._pixels))
    off = phases[0] - phases[1]
    # If it were of the light that is compared, as more spikes fall into longer cycles:
    lost = 0.1 * 0.5 * 2 * 0.1**2 * (0.5 / 1.05) * 2000
    assert np.sqrt((off**2).mean()) < 0.01 * lost


def test_gains_bring_pixels_of_dimmer_tiles_near_one_spike_a_cycle() -> None:
    camera = setting(dead_time=1e-7)
    tile = scene(camera, 0.1, 0.85)
    assert exact_error(camera, tile)[0] < 1e-3 < exact_error(camera, replace(tile, uneven=0.08))[0]


def test_saturated_tiles_have_errors_of_fractions_alone() -> None:
    camera = setting(dead_time=1e-7)
    assert 0 < exact_error(camera, scene(camera, 20.0, 30.0))[0] < 1e-7
    assert 0 < fast_error(camera, scene(camera, 20.0, 30.0))[0] < 1e-4


def test_the_fast_tier_errs_more_than_the_exact_one_but_for_the_dead_time() -> None:
    camera = setting(dead_time=262 / 65536 / CLOCK.hz)  # the exact tier rounds it to 2^-16
    tiles = scene(camera, [0.01, 0.1, 0.3], [0.02, 0.5, 0.6])
    fast, exact = fast_error(camera, tiles), exact_error(camera, tiles)
    assert (fast > exact).all() and (fast < 1e-3).all()
    camera = setting(dead_time=262.4 / 65536 / CLOCK.hz)
    assert (fast_error(camera, tiles) < exact_error(camera, tiles))[1:].all()


def test_a_hard_reset_with_dead_time_under_moving_light_is_out_of_reach() -> None:
    camera = setting(dead_time=1e-6, reset="hard")
    assert exact_error(camera, scene(camera, 0.1, 0.5)).max() > 1e-3
    assert np.isinf(fast_error(setting(reset="hard"), scene(setting(), 0.0, 0.5))).all()
