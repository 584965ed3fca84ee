"""The lock of a camera's clock over the windows of its model, and what a run takes from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim import PS, Clock, InputError
from cosim.compute.opencl import Device
from cosim.compute.table_cache import described
from cosim.run.shown import SilentProgress
from link.layout import TRAINING
from link.mode import Mode
from link.receiving.phasing import Delay
from link.receiving.steering import PhaseDetector
from link.receiving.synthesis import Levels
from link.section import LinkScenario
from link.sending import FileTransmission
from link.setting import LEAD, LinkSetting, link_setting, steering_of
from link.setup.locking.choice import Spent, choose_and_lock
from link.setup.locking.loop import INTERVAL, WINDOW, ClockLock, Locking
from link.setup.locking.model import PhaseModel, at_lock
from link.setup.modes import _delays
from link.setup.setup import ChosenLink
from link.setup.truth import true_timing
from scenarios.assemble.schema.loading import linked, load
from scenarios.assemble.source.link import link_camera
from sensor.device.chips import BOARD

SMALL = (
    "link.panel.width=128", "link.panel.height=128", "sensor.width=150", "sensor.height=150",
    "sensor.row_jitter=0.02", "sensor.row_band_width=1000",
)  # fmt: skip
"""A panel of 128 x 128 before 150 x 150 pixels, whose sampling instants jitter by 1/50 tick."""
MODE = Mode(128, 128, 2, 1, "scrambled", 16)


def scenario_of(*more: str) -> LinkScenario:
    return linked(load("light-link", [*SMALL, *more])[1], "test")


def setting_of(scenario: LinkScenario) -> LinkSetting:
    return link_setting(scenario, link_camera(scenario))


def locked(
    phase: float, ppm: float, ticks: int, device: Device | None, *more: str, mode: Mode = MODE
) -> tuple[LinkSetting, ClockLock]:
    setting = setting_of(
        scenario_of(f"link.panel.phase={phase}", f"link.panel.clock_offset={ppm}", *more)
    )
    locking = Locking(setting, mode, BOARD, "joint", device)
    assert locking.acquire()
    held, lock = locking.hold(locking.setting, ticks, SilentProgress())
    assert lock is not None
    return held, lock


def test_a_transmission_lasts_a_day_at_most() -> None:
    """As a scene does: the clock that is proposed suffices."""
    day = 86_400

    def hold(hz: float) -> None:
        part = SimpleNamespace(clock=Clock.from_hz(hz))
        setting = SimpleNamespace(camera=part, panel=part)
        chosen: Any = SimpleNamespace(setting=setting, locking=None)
        ChosenLink.held(chosen, day + 3600, SilentProgress())

    with pytest.raises(InputError, match=r"^sensor.clock must be at least 1.05 Hz, for a tr") as it:
        hold(1.0)
    hold(float(str(it.value).split()[5]))


@pytest.mark.parametrize(("phase", "ppm"), [(0.0, 20), (0.31, 0), (0.5, -100), (0.72, 100)])
def test_a_clock_is_locked_from_any_phase_and_held(
    phase: float, ppm: float, device: Device
) -> None:
    setting, lock = locked(phase, ppm, 1400, device)
    assert lock.acquired <= 10 * INTERVAL
    assert lock.phase.size > 1400 and lock.most < 0.1 and lock.rms < 0.05
    # What the loop measures is what it then corrects; its errors are those of single windows.
    assert np.nanmax(np.abs(lock.measured - lock.truth)) < 0.05
    # The edges that the run takes are those phases: planes begin with the ticks.
    moves = setting.camera.clock_moves.at(0, lock.phase.size)
    middle = true_timing(setting, np.zeros(150, np.int64), 1).start(0, 75)
    skewed = true_timing(setting, rows_delay(setting), 1).start(0, 75)
    assert middle != skewed
    panel = PS / setting.panel.clock.hz
    expected = skewed % 1 - moves / panel
    expected -= np.round(expected)
    assert np.abs(expected - lock.phase).max() < 0.01


def test_symbols_of_two_ticks_are_locked_on_either_side(device: Device) -> None:
    """Their likelihood has a maximum on each side of the lock; the nearest one may be false."""
    mode = replace(MODE, ticks=2, line="8b10b")
    _, lock = locked(0.6, 20, 2500, device, mode=mode)
    assert lock.most < 0.1


def rows_delay(setting: LinkSetting) -> np.ndarray:
    sent = FileTransmission(MODE, b"0", "a.bin")
    return setting.make_air(sent, sent.planes).row_delay


@pytest.mark.slow
@pytest.mark.parametrize("ppm", [20, 100])
def test_the_lock_holds_over_fifty_thousand_ticks(ppm: float, device: Device) -> None:
    setting, lock = locked(0.44, ppm, 50_000, device)
    assert lock.phase.size > 50_000 and lock.most < 0.1
    assert setting.camera.clock_moves.most < PS / 40_000 / 4


def test_the_first_light_comes_as_late_as_without_a_lock(device: Device) -> None:
    for phase in (0.2, 0.9):
        setting, _ = locked(phase, 20, 40, device)
        first = true_timing(setting, rows_delay(setting), 1).start(0, 75)
        assert first == pytest.approx(LEAD, abs=0.1)
        assert setting.camera.clock == setting.panel.clock


def test_counts_of_a_tick_stay_within_the_boards(device: Device) -> None:
    """Rows over the whole tick leave a blank rest of 1/150 of it: 16 counts; 25 make it longer."""
    setting, _ = locked(0.3, 20, 300, device)
    clock = setting.panel.clock
    mean = np.array([clock.edge(k) for k in range(setting.camera.clock_moves.ps.size)])
    lengths = np.diff(mean + setting.camera.clock_moves.ps)
    counts = (lengths - PS // 40_000) / BOARD.step
    assert (counts == np.round(counts)).all() and -16 <= counts.min() <= counts.max() <= 25


def test_a_lock_is_the_same_each_time(device: Device) -> None:
    """An interrupted run goes on with the same ticks."""
    one, two = (locked(0.6, 20, 200, device)[0].camera.clock_moves.ps for _ in range(2))
    assert (one == two).all()


def test_hidden_planes_are_not_measured_and_the_clock_goes_on(device: Device) -> None:
    """The panel is hidden from 5 to 12 ms: the intervals that begin within it are 2, 3."""
    _, lock = locked(0.25, 20, 900, device, 'link.aim.blocked=[["5 ms", "12 ms"]]')
    assert np.flatnonzero(np.isnan(lock.measured)).tolist() == [2, 3]
    assert lock.most < 0.1


def test_a_clock_that_is_not_steered_is_as_it_was(device: Device) -> None:
    for more in (["sensor.clock_steering=false"], ["sensor.reset=residual"],
                 ["sensor.chip=spikeone"]):  # fmt: skip
        scenario = scenario_of(
            "link.modem.cell=2", "link.modem.ticks=1", "link.modem.line=scrambled",
            "link.modem.parity=16", *more,
        )  # fmt: skip
        setting, spent = setting_of(scenario), Spent()
        mode, choice, locking = choose_and_lock(
            scenario.link.modem,
            setting,
            steering_of(scenario.sensor),
            1000,
            device,
            SilentProgress(),
            spent,
        )
        assert (mode, choice, locking, spent) == (MODE, None, None, Spent())
        assert setting.camera.clock_moves is None


def test_a_mode_is_tried_at_the_locked_phase_alone() -> None:
    setting = setting_of(scenario_of("link.panel.phase=0.4"))
    at = at_lock(setting)
    late = true_timing(at, rows_delay(setting), 1).start(0, 75)
    assert late == pytest.approx(round(late), abs=1e-3)
    mode = replace(MODE, width=960, height=960)
    assert len(_delays(setting, mode, 10**9)) > 1
    assert _delays(at, mode, 10**9) == [0]


@pytest.fixture(scope="module")
def shipped() -> LinkSetting:
    scenario = linked(load("light-link", [])[1], "test")
    return link_setting(scenario, link_camera(scenario))


def test_the_phase_is_measured_to_a_fiftieth_of_a_tick(
    shipped: LinkSetting, device: Device
) -> None:
    """At the setting that ships, with the panel's own decisions, in any phase near the lock."""
    model = PhaseModel(shipped, Mode(960, 960, 2, 1, "scrambled", 16), device)
    sees = PhaseDetector(model.layout, "joint", model.registration)
    expected = model.timing(0.0, 0.0, model.slope)
    begun = model.film(sees.training, 0.03, 0.0, 0, 0)
    sees.learn(model.film(sees.training, 0.0, 0.0, 1, 0), expected)
    found = sees.trained(begun, expected, Levels(1.4, 0.02, "hard", 0.0), TRAINING)
    assert found is not None and len(sees.training) == TRAINING
    off, errors = [found[0].ticks - 0.03], [found[0].error]
    for n, phase in enumerate((-0.08, -0.04, -0.01, 0.0, 0.02, 0.05, 0.09)):
        recording = model.film(model.data(n, WINDOW), phase, 0.0, 2 + n, 0)
        delay = sees.decided(recording, expected, found[1], WINDOW)
        assert isinstance(delay, Delay)
        off.append(delay.ticks - phase)
        errors.append(delay.error)
    assert np.sqrt(np.mean(np.square(off))) < 0.01 and np.abs(off).max() < 0.02
    # By chance alone the limit of Cramer and Rao is some .0025 ticks.
    assert max(errors) < 0.004


def test_data_are_not_decided_before_the_training_is_learned(shipped: LinkSetting) -> None:
    model = PhaseModel(shipped, Mode(960, 960, 4, 1, "scrambled", 16), None)
    sees = PhaseDetector(model.layout, "joint", model.registration)
    recording = model.film(sees.training[:6], 0.0, 0.0, 0, 0)
    with pytest.raises(ValueError, match="before the training"):
        sees.decided(recording, model.timing(0.0, 0.0, 0.0), Levels(1.4, 0.02, "hard", 0.0), 6)


def test_a_loop_that_keeps_its_measurements_has_the_same_ticks_and_learns_when_it_must(
    device: Device, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VIFORM_CACHE", str(tmp_path))
    filmed = []
    film = PhaseModel.film
    monkeypatch.setattr(PhaseModel, "film", lambda *given: filmed.append(1) or film(*given))
    setting = setting_of(scenario_of("link.panel.phase=0.4"))

    def hold(keeps: bool, seed: int | None = None) -> tuple[LinkSetting, ClockLock]:
        locking = Locking(setting, MODE, BOARD, "joint", device, keeps)
        assert locking.acquire()
        own = locking.setting
        if seed is not None:
            own = replace(own, air=replace(own.air, seed=seed))
        held, lock = locking.hold(own, 300, SilentProgress(), seed is None)
        assert lock is not None
        return held, lock

    plain, first = hold(False), hold(True)
    assert filmed
    filmed.clear()
    again = hold(True)
    assert not filmed  # all of it was known
    for setting_held, lock in (first, again):
        assert described(setting_held) == described(plain[0])
        assert lock.acquired == plain[1].acquired
        for name in ("phase", "measured", "error", "truth"):
            np.testing.assert_array_equal(getattr(lock, name), getattr(plain[1], name))
    called, other = hold(True, seed=7), hold(False, seed=7)
    assert described(called[0]) == described(other[0]) and filmed
