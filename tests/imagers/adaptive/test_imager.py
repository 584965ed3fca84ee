"""The adaptive-exposure sensor as a whole: light in, frames and registers out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim import InputError
from cosim.clock import PS
from imagers.adaptive.device.controller import SteadySequencer
from imagers.adaptive.device.decision import Search
from imagers.adaptive.device.imager import AdaptiveExposure, latency
from imagers.adaptive.device.loop import light_for
from imagers.adaptive.device.timing import Timing
from imagers.adaptive.pixels import AdaptivePixels, CmosSetting
from imagers.common.registers import line_of
from imagers.common.scenery import Course, Still

NONE: frozenset[str] = frozenset()
TINY = Timing.of(4, 4)


def sensor(shape: tuple[int, int] = (4, 4)) -> AdaptiveExposure:
    return AdaptiveExposure(AdaptivePixels(shape))


def steady(lux: float, shape: tuple[int, int] = (4, 4)) -> Still:
    return Still(np.full(shape, lux))


def test_a_change_is_recorded_in_frame_n_plus_3_at_the_latest() -> None:
    """Random instants, exposures and falls that one decision can follow. N: the last frame with
    any row that saw light from before the change."""
    rng = np.random.default_rng(1)
    seen = set()
    for _ in range(60):
        exponent = int(rng.integers(0, 14))
        before = light_for(1 << exponent, float(rng.uniform(130, 254)))
        after = before / 2 ** float(rng.uniform(1.1, 8))
        change = int(rng.integers(30, 120) * PS // 1000 + rng.integers(0, PS // 1000))
        made = latency(TINY, change, before, after, multiplier=1 << exponent)
        assert 2 <= made.recorded - made.changed <= 3
        assert made.settled - made.changed <= 3
        seen.add(made.recorded - made.changed)
    assert seen == {2, 3}


def test_short_exposures_settle_within_three_frames_of_10_ms() -> None:
    rng = np.random.default_rng(2)
    for _ in range(30):
        lux = light_for(1 << 6, 200.0)
        change = int(rng.integers(40 * PS // 1000, 90 * PS // 1000))
        made = latency(TINY, change, lux, lux / 100, multiplier=1 << 6)
        assert made.settled - made.changed == 3
        assert 0.02 <= made.seconds <= 0.03 + 64e-6  # three frames and the former exposure


def test_rising_light_takes_a_new_exposure_by_frame_n_plus_3() -> None:
    for search in Search:
        for rise in (2.5, 40.0, 1e4):
            for change in (61 * PS // 1000, 65 * PS // 1000, 69 * PS // 1000):
                lux = light_for(1 << 8, 200.0)
                made = latency(
                    TINY, change, lux, lux * rise, multiplier=1 << 8, search=search, frames=40
                )
                assert made.recorded - made.changed <= 3


def test_rows_are_exposed_in_turn_for_what_was_commanded() -> None:
    imager = sensor()
    frames = list(imager.film(steady(50.0), PS // 4, seed=1, kept=NONE))
    for frame in frames:
        clocks = frame.state["exposure_clocks"]
        assert (frame.end - frame.begin == clocks * 50_000).all()
        assert clocks == 20 * frame.state["multiplier"]
        assert (np.diff(frame.end) == TINY.line * 50_000).all()
        held = frame.state["hold_clocks"] + clocks
        assert held == frame.state["period_clocks"] and frame.state["disturbed"] == 0
    for before, after in zip(frames, frames[2:], strict=False):
        assert after.state["multiplier"] == before.state["next_multiplier"]
    assert frames[-1].state["multiplier"] == 1 << 14  # 50 lx: 210 DN
    assert frames[-1].values.min() == frames[-1].values.max() == int(50 * (1 << 14) * 256e-6)
    assert imager.read("adaptive_last_largest") == frames[-1].values.max()


def test_a_film_in_parts_is_the_film_as_a_whole() -> None:
    pixels = AdaptivePixels((4, 4))
    course = Course(((0, 1.0), (PS // 10, 100.0), (PS // 5, 0.01)))
    scene = Still(np.arange(16.0).reshape(4, 4), course)
    one, two = AdaptiveExposure(pixels), AdaptiveExposure(pixels)
    whole = list(one.film(scene, PS // 2, seed=3, kept=pixels.everything))
    parts = []
    for until in range(0, PS // 2 + 1, PS // 37):
        parts += list(two.film(scene, until, seed=3, kept=pixels.everything))
    parts += list(two.film(scene, PS // 2, seed=3, kept=pixels.everything))
    assert len(parts) == len(whole) > 20 and two.now == one.now == PS // 2
    for a, b in zip(whole, parts, strict=True):
        assert (a.values == b.values).all() and a.ready == b.ready and a.state == b.state


def test_a_lamp_outside_the_window_does_not_hold_the_exposure() -> None:
    """Figure 3(a): a lamp that saturates in a dark scene. A threshold alone lets it saturate once
    it does; coming from shorter exposures the loop rests where the lamp is the largest value."""
    lux = np.full((8, 8), 40.0)
    lux[0, :4] = 1e5
    lux[1, :4] = 300.0  # its rim
    ends = {}
    for name, writes in {
        "all": {"adaptive_threshold": 0},
        "window": {"adaptive_rows": 7 << 16 | 4, "adaptive_threshold": 0},
        "window, whole scan": {
            "adaptive_rows": 7 << 16 | 4, "adaptive_threshold": 0, "adaptive_whole_scan": 1
        },
        "threshold": {"adaptive_threshold": 8},
        "threshold, from above": {"adaptive_threshold": 8, "adaptive_user": 1 << 14},
    }.items():  # fmt: skip
        imager = sensor((8, 8))
        for register, value in writes.items():
            imager.write(register, value)
        if "adaptive_user" in writes:
            imager.write("adaptive_automatic", 0)
            imager.write("adaptive_automatic", 1, at=1)
        frames = list(imager.film(Still(lux), PS // 2, seed=0, kept=NONE))
        ends[name] = int(frames[-1].state["multiplier"])
    assert ends["all"] == 1 << 3  # 1e5 lx: 205 DN
    assert ends["threshold"] == 1 << 3
    assert ends["window"] == ends["threshold, from above"] == 1 << 14
    assert ends["window, whole scan"] == 1 << 3  # as printed: the lamp is the largest value


def test_a_users_exposure_holds_from_the_decision_after_its_write() -> None:
    imager, scene = sensor(), steady(50.0)
    frames = list(imager.film(scene, PS // 10, seed=0, kept=NONE))
    imager.write("adaptive_user", 777)
    imager.write("adaptive_automatic", 0)
    imager.write("adaptive_minimum", 31)
    more = list(imager.film(scene, PS // 5, seed=0, kept=NONE))
    wanted = [frames[-1].state["next_multiplier"]] + [777.0] * (len(more) - 2)
    assert [f.state["multiplier"] for f in more[1:]] == wanted
    assert [f.exposure for f in more[2:]] == [777 * 31 * 50_000] * (len(more) - 2)
    imager.write("adaptive_automatic", 1, at=imager.now + 1)
    again = list(imager.film(scene, PS // 2, seed=0, kept=NONE))
    assert again[-1].values.min() >= 128 and again[-1].state["multiplier"] != 777


def test_a_window_written_while_a_frame_is_read_waits_for_the_next() -> None:
    timing = Timing.of(4, 4)
    clock, start = timing.clock.edge, 3 * timing.frame
    lux = np.full((4, 4), 1.0)
    lux[0] = 1e9  # saturates
    counts = {}
    for name, at in {"before": clock(start), "after": clock(start + 1)}.items():
        imager = sensor()
        imager.write("adaptive_rows", 3 << 16 | 1, at=at)
        frames = imager.film(Still(lux), 10 * clock(timing.frame), seed=0, kept=NONE)
        counts[name] = [f.state["saturated"] for f in frames][:5]
    assert counts == {"before": [4, 4, 0, 0, 0], "after": [4, 4, 4, 0, 0]}


def test_registers_refuse_what_they_cannot_hold() -> None:
    imager = sensor()
    for name, value in (
        ("adaptive_minimum", 256), ("adaptive_minimum", -1), ("adaptive_multiplier", 1),
        ("nothing", 0), ("adaptive_user", 1 << 25),
    ):  # fmt: skip
        with pytest.raises(InputError, match="must be"):
            imager.write(name, value)
    with pytest.raises(InputError, match="must be one of"):
        imager.read("nothing")
    list(imager.film(steady(1.0), PS // 50, seed=0, kept=NONE))
    with pytest.raises(InputError, match="time does not go back"):
        imager.write("adaptive_minimum", 20, at=0)
    with pytest.raises(ValueError, match="scene"):
        next(imager.film(steady(1.0, (4, 6)), PS, seed=0, kept=NONE))


def test_settings_at_their_ends_leave_it_running() -> None:
    """The longest exposure there is, no exposure, searches by no number, an empty window."""
    imager = sensor()
    imager.write("adaptive_longest", 31)
    frames = list(imager.film(steady(0.0), 60 * PS, seed=0, kept=NONE))
    assert frames[-1].state["multiplier"] == 1 << 24
    assert frames[-1].exposure == pytest.approx(16.777216 * PS)
    imager = sensor()
    for name, value in (
        ("adaptive_minimum", 0), ("adaptive_search", 0), ("adaptive_rows", 3), ("adaptive_user", 0),
    ):  # fmt: skip
        imager.write(name, value)
    frames = list(imager.film(steady(1e9), PS // 10, seed=0, kept=NONE))
    assert [f.exposure for f in frames] == [50_000] * len(frames)
    assert frames[-1].state["largest"] == 256 and frames[-1].state["saturated"] == 0


def test_the_trace_holds_the_sequencers_signals(tmp_path: Path) -> None:
    path = tmp_path / "a.vcd"
    list(sensor().film(steady(100.0), PS // 20, seed=0, kept=NONE, trace=path))
    text = path.read_text()
    for name in ("Vout", "Hout", "Hrst1", "Hrst2", "sampling", "Pout", "select", "row", "reset1"):
        assert f" {name}" in text
    times = [int(line[1:]) for line in text.splitlines() if line.startswith("#")]
    assert times[-1] > 2 * TINY.frame * 50_000 and times == sorted(times)
    with pytest.raises(InputError, match=r"\.fst or \.vcd"):
        next(sensor().film(steady(1.0), PS, seed=0, kept=NONE, trace=tmp_path / "a.png"))


def test_behind_its_serial_line_it_rests_where_the_whole_sensor_does() -> None:
    core = SteadySequencer(TINY, lux=50.0)
    bus = line_of(core).system
    address = {entry.name: entry.address for entry in core.registers.design.registers}
    bus.write(address["adaptive_search"], 3)
    bus.advance(40 * TINY.frame)
    assert bus.read(address["adaptive_multiplier"]) == 1 << 14
    assert bus.read(address["adaptive_last_largest"]) == CmosSetting().value(50, 16384e-6)[0]
    bus.write(address["ctrl_reset"], 1)
    assert bus.read(address["adaptive_multiplier"]) == 1
    bus.advance(80 * TINY.frame)
    assert bus.read(address["adaptive_multiplier"]) == 1 << 14
