"""The camera that is called from Python: the bits of a run, its bounds, draws, and refusals."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import viform
from cosim import Bound, Events
from scenarios.cli.entry import _main
from sensor.latched import core
from sensor.latched.effects.fixed_pattern import PRNU

SMALL = {"width": 64, "height": 48, "threshold": "100 e"}
SENSOR = {f"sensor.{key}": value for key, value in SMALL.items()}


def frames(count: int = 6, colour: bool = False) -> np.ndarray:
    """Waves that move, sRGB codes from 100 to 250."""
    t, y, x = np.mgrid[:count, :48, :64]
    grey = (175 + 75 * np.sin((x + 2 * t) / 9) * np.cos(y / 11)).astype(np.uint8)
    return np.stack([grey, grey[:, ::-1], grey[:, :, ::-1]], axis=3) if colour else grey


def filmed_by_a_run(
    tmp_path: Path, given: np.ndarray, *sets: str, device: str | None = None
) -> viform.Viform:
    np.save(tmp_path / "clip.npy", given)
    own = [f"--set={key}={value}" for key, value in SENSOR.items()]
    more = [f"--set={each}" for each in sets] + ([f"--device={device}"] if device else [])
    assert not _main([
        "run", "film", f"--set=scene.path={tmp_path / 'clip.npy'}", "--set=duration=3 ms",
        "--set=scene.frame_rate=2000 Hz", "--out", str(tmp_path / "run"), *own, *more,
    ])  # fmt: skip
    return viform.open(tmp_path / "run")[:]


KINDS = {
    "silicon": ({"preset": "silicon"}, ["sensor.preset=silicon"]),
    "exact": ({"device": "numba", "preset": "silicon"}, ["sensor.preset=silicon"]),
    "quiet": ({"tolerance": 0.5}, ["tolerance=0.5"]),
    "colour": ({"colour.filter": "rggb"}, ["sensor.colour.filter=rggb"]),
    "writes": (
        {"writes": '[{"at": "1 ms", "threshold_level": 4}]'},
        ['sensor.writes=[{"at": "1 ms", "threshold_level": 4}]'],
    ),
    "rows": ({"duplicated_rows": "[[0, 2]]"}, ["sensor.duplicated_rows=[[0, 2]]"]),
}
ASYNCHRONOUS = {"pixel": "asynchronous", "preset": "silicon"}
UNLATCHED = {
    "asynchronous": ASYNCHRONOUS,
    "shared channel": {
        "pixel": "asynchronous", "channel.rate": "20 MHz", "channel.timestamp": "channel",
        "asynchronous.change": 3,
    },
    "continuous": {"pixel": "continuous", "preset": "silicon"},
    "continuous, no noise": {"pixel": "continuous", "continuous.shot_noise": False},
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_call_has_the_bits_of_a_run(kind: str, tmp_path: Path) -> None:
    keys, sets = KINDS[kind]
    given = frames(colour=kind == "colour")
    run = filmed_by_a_run(tmp_path, given, *sets, device=keys.get("device"))
    with viform.Camera(**{**SMALL, **keys}) as camera:
        seen = camera.film(given, frame_rate=2000)
        checked = camera.film(given, frame_rate=2000, call=0, check=True)
    assert seen.cycles == 120 and seen == run == checked and run.words.any()
    assert 0 <= seen.error.bound < 0.6
    assert seen.error == replace(checked.error, measured=None, law=seen.error.law)
    stated = viform.Run(tmp_path / "run").result["error"]
    measured = checked.error.measured
    assert measured is not None and measured.value == stated["value"]
    assert [measured.low, measured.high] == stated["ci"]
    assert (seen.error.better > 0) == (kind in ("silicon", "exact", "writes"))
    assert (seen.error.tier == "exact") == (kind in ("exact", "writes"))
    assert any("f/4" in note for note in seen.notes)
    assert any("sensor.writes" in note for note in seen.notes) == (kind == "writes")


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=[pytest.mark.slow] * (kind == "shared channel"))
        for kind in UNLATCHED
    ],
)
def test_a_call_of_pixels_without_a_latch_has_the_bits_of_a_run(kind: str, tmp_path: Path) -> None:
    keys, checks = UNLATCHED[kind], kind == "asynchronous" or kind.startswith("continuous")
    own = {f"sensor.{key}": value for key, value in {**SMALL, **keys}.items()}
    run = viform.film(frames(), frame_rate=2000, out=tmp_path / "run", **own)
    camera = viform.Camera(**SMALL, **keys)
    seen = camera.film(frames(), 2000, check=checks)
    assert seen == run == viform.film(frames(), frame_rate=2000, **own) and len(run) > 500
    assert seen != camera.film(frames(), 2000) or kind == "continuous, no noise"
    # Continuous pixels draw their noise in the limit of many electrons.
    assert (seen.error.bound > 0) == (kind == "continuous") and seen.white_rate == 0.6
    result = viform.Run(tmp_path / "run").result
    assert list(seen.error.kept) == result["plan"]["kept"]
    if checks:
        stated = result["error"]
        measured = seen.error.measured
        assert measured is not None and measured.value == stated["value"]
        assert [measured.low, measured.high] == stated["ci"]
    np.save(tmp_path / "clip.npy", frames())
    clip = viform.film(
        tmp_path / "clip.npy", frame_rate=2000, duration=f"{len(frames()) / 2000} s", **own
    )
    assert clip == seen and clip.error.kept == seen.error.kept and clip.white_rate == 0.6
    ending = "events" if isinstance(seen, Events) else "intensities"
    viform.save(seen, tmp_path / f"seen.{ending}.npz")
    opened = viform.open(tmp_path / f"seen.{ending}.npz")
    assert opened == seen == viform.open(tmp_path / "run") and repr(opened) == repr(seen)
    with pytest.raises(viform.InputError, match=f"ends in .{ending}.npz"):
        viform.save(seen, tmp_path / "seen.npz")


def test_an_effect_whose_bound_is_false_is_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    keys = {**SMALL, "pattern.prnu": 0.05}
    with viform.Camera(**keys) as camera:
        honest = camera.film(frames(), 2000)
    none = Bound(np.float64(1e-9), "proof")
    monkeypatch.setattr(PRNU, "bound", lambda setting, scene: none, raising=False)
    camera = viform.Camera(**keys)
    wrong, seen = camera.film(frames(), 2000, check=2, call=1), camera.film(frames(), 2000, check=2)
    assert "PRNU" in wrong.error.left_out
    assert wrong.error.measured is None  # call 1 of every second
    assert seen == honest and "PRNU" in seen.error.kept
    assert sum("PRNU kept: its absence changes" in note for note in seen.notes) == 1
    assert seen.error.measured is not None and seen.error.measured.high < 1e-3


def test_pixels_that_send_once_leave_out_what_their_light_does_not_need() -> None:
    """Light that does not change; a tile that is checked is one that leaves something out."""
    still = np.repeat(frames(1), 4, axis=0)
    keys = {
        "pixel": "asynchronous",
        "asynchronous.change": 8,
        "threshold": "10 ke",
        "illuminance": "50 klx",
    }
    camera = viform.Camera(**{**SMALL, **keys}, tolerance=0.1)
    seen = camera.film(still[:1], 10, check=True)
    assert seen.error.left_out and seen.error.bound > 0
    assert seen.error.measured is not None and 0 < seen.error.measured.high < 0.1
    exact = viform.Camera(**{**SMALL, **keys}, tolerance=0).film(still[:1], 10)
    assert not exact.error.left_out and exact.error.bound == 0


def test_every_tier_films_the_same_light() -> None:
    seen = {
        tier: viform.Camera(**SMALL, tier=tier, tolerance=0).film(frames(), frame_rate=2000)
        for tier in ("fast", "exact", "reference")
    }
    truth = seen["reference"].rate()
    for tier, spikes in seen.items():
        assert spikes.error.tier == tier
        assert np.sqrt(((spikes.rate() - truth) ** 2).mean()) < 0.01 * truth.mean()


@pytest.mark.parametrize("tier", [None, "exact"])
def test_the_blocks_in_which_a_call_is_exposed_change_no_bit(
    monkeypatch: pytest.MonkeyPatch, tier: Literal["exact"] | None
) -> None:
    """The light of a block is made while the one before it is exposed, tiles of a better tier
    too."""
    found = []
    for cycles in (1024, 32, 96):
        monkeypatch.setattr(core, "_TOGETHER", cycles)
        camera = viform.Camera(**SMALL | {"threshold": "400 e"}, preset="silicon", tier=tier)
        found.append(camera.film(frames(12), 2500, call=0))
    assert found[0] == found[1] == found[2] and found[0].cycles > 96
    assert tier is not None or found[0].error.better > 0


def test_calls_have_draws_of_their_own_whatever_the_threads() -> None:
    given = frames()
    camera = viform.Camera(**SMALL, seed=7)
    one, two = camera.film(given, 2000), camera.film(given, 2000)
    assert one != two and abs(one.rate().mean() - two.rate().mean()) < 0.01
    again = viform.Camera(**SMALL, seed=7)
    assert again.film(given, 2000, call=1) == two and again.film(given, 2000, call=0) == one
    with ThreadPoolExecutor(4) as pool:
        calls = [pool.submit(again.film, given, 2000, call=n) for n in (0, 1, 5, 0, 1, 5)]
        seen = [each.result() for each in calls]
    assert seen[:3] == seen[3:] and seen[0] == one and seen[1] == two
    many = list(again.film_many((given for _ in range(9)), 2000))
    assert len(many) == 9 and many[0][0] == one and many[1][0] == two and many[5][0] == seen[2]
    truth = many[0][1]
    assert truth.shape == (1, 48, 64) and truth.dtype == np.float32 and truth.min() >= 0


@pytest.mark.parametrize("kind", ["asynchronous", "continuous", "continuous, no noise"])
def test_frames_pushed_to_pixels_without_a_latch_become_the_stream_of_the_whole(kind: str) -> None:
    camera = viform.Camera(**SMALL, **UNLATCHED[kind])
    given, rate = frames(7), 1234.5
    whole, stream = camera.film(given, rate, call=3), camera.open(rate, call=3)
    parts = [stream.push(frame) for frame in given]
    assert parts[0] is None and (stream.error.bound > 0) == (kind == "continuous")
    first, columns = 0, ("row", "column", "time", "value" if "cont" in kind else "width")
    for part in parts[1:]:
        assert part is not None and part.start == first and part.white_rate == 0.6
        first += part.ticks
    until = int(np.searchsorted(whole.time, first))
    for name in columns:
        joined = np.concatenate([getattr(part, name) for part in parts[1:] if part is not None])
        assert np.array_equal(joined, getattr(whole, name)[:until]), name
    assert first >= 6 / rate * whole.clock.hz - 1 and until > 3000
    camera.close()
    with pytest.raises(viform.InputError, match="the camera must be open"):
        stream.push(given[0])


@pytest.mark.parametrize("kind", ["asynchronous", "continuous"])
def test_calls_without_a_latch_have_draws_of_their_own_whatever_the_threads(kind: str) -> None:
    keys = {**SMALL, "pixel": kind, "seed": 7}
    given, camera = frames(), viform.Camera(**keys)
    many = list(camera.film_many((given for _ in range(5)), 2000))
    again = pickle.loads(pickle.dumps(camera))
    with ThreadPoolExecutor(4) as pool:
        calls = [pool.submit(again.film, given, 2000, call=n) for n in (0, 1, 4, 0)]
        seen = [each.result() for each in calls]
    assert [many[n][0] for n in (0, 1, 4, 0)] == seen and seen[0] != seen[1]
    spikes, truth, at = again.film_with_truth(given, 2000, instants=[0, 119], call=1)
    assert spikes == seen[1] and truth.shape == (2, 48, 64) and at == (0, 119)
    assert many[0][1].shape == (1, 48, 64)
    dark = camera.film(np.zeros((2, 48, 64)), 2000)  # each continuous pixel reports once
    assert len(dark) == (0 if kind == "asynchronous" else 48 * 64)


@pytest.mark.parametrize("tier", ["exact", "fast"])
def test_frames_that_are_pushed_become_the_spikes_of_the_whole(tier: str) -> None:
    given = frames(9)
    camera = viform.Camera(**SMALL, preset="silicon", tier=tier, tolerance=0)
    whole = camera.film(given, 2000, call=3)
    stream = camera.open(2000, call=3)
    parts = [stream.push(frame) for frame in given]
    assert parts[0] is None and all(part is not None for part in parts[1:])
    first = 0
    for part in parts[1:]:
        assert part.start == first and part == whole[first : first + part.cycles]
        first += part.cycles
    assert first >= 8 * 20 - 2 and stream.error.tier == tier
    assert any("f/" in note for note in stream.notes)
    camera.close()
    with pytest.raises(viform.InputError, match="the camera must be open"):
        stream.push(given[0])


def test_clips_may_share_the_memory_of_their_giver() -> None:
    camera, buffer = viform.Camera(**SMALL, tolerance=1e-2), np.empty((6, 48, 64), np.uint8)

    def clips():
        for code in (50, 120, 200, 250):
            buffer[:] = code
            yield buffer

    seen = [spikes for spikes, _ in camera.film_many(clips(), 2000)]
    for number, code in enumerate((50, 120, 200, 250)):
        assert camera.film(np.full((6, 48, 64), code, np.uint8), 2000, call=number) == seen[number]


def test_a_film_plans_for_the_images_that_are_asked_for(tmp_path: Path) -> None:
    """With register writes the plan depends on the windows of the images."""
    writes = '[{"at": "2.5 ms", "threshold_level": 4}]'
    run = filmed_by_a_run(tmp_path, frames(), f"sensor.writes={writes}", "image.at=[20, 118]")
    own = {"sensor.writes": writes, "image.at": [20, 118]}
    assert viform.film(frames(), frame_rate=2000, **SENSOR, **own) == run


def test_a_plan_is_that_of_its_own_light() -> None:
    """Two clips of one range, of which one changes fast: its plan is not that of the slow one."""
    level = np.concatenate([np.linspace(0.2, 0.8, 20), np.linspace(0.8, 0.2, 20)])
    slow, fast = (
        np.broadcast_to(each[:, None, None], (40, 48, 64)).astype(np.float32)
        for each in (level, np.where(np.arange(40) % 2, 0.8, 0.2))
    )
    keys = {**SMALL, "threshold": "1000 e", "preset": "silicon", "tolerance": 2e-4}
    camera = viform.Camera(**keys)
    before, seen = camera.film(slow, 2000), camera.film(fast, 2000, call=0)
    alone = viform.Camera(**keys).film(fast, 2000, call=0)
    assert seen == alone and seen.error == alone.error
    assert before.error.arithmetic < seen.error.arithmetic


def test_a_refused_call_has_no_number() -> None:
    camera = viform.Camera(**SMALL)
    for given, keys in ((frames(), {"white_rate": 5}), (frames(), {"frame_rate": 0})):
        with pytest.raises(viform.InputError):
            camera.film(given, **({"frame_rate": 2000} | keys))
    with pytest.raises(viform.InputError):
        camera.film_with_truth(frames(), 2000, instants=[10**6])
    assert camera.film(frames(), 2000) == viform.Camera(**SMALL).film(frames(), 2000, call=0)


def test_white_fires_at_the_rate_asked_for() -> None:
    camera = viform.Camera(**SMALL, tolerance=1e-2)
    white = np.full((6, 48, 64), 255, np.uint8)
    for rate in (0.25, 0.6, 0.8):
        seen = camera.film(white, 2000, white_rate=rate)
        assert seen.rate().mean() == pytest.approx(rate, rel=0.02)
        assert any("f/" in note for note in seen.notes)
    light = camera.film(np.full((6, 48, 64), 0.5), 2000)
    assert light.rate().mean() == pytest.approx(0.3, rel=0.02)


def test_what_cannot_be_filmed_is_one_line() -> None:
    camera = viform.Camera(**SMALL)
    closed = viform.Camera(**SMALL)
    closed.close()
    stream = camera.open(2000)
    stream.push(frames()[0])
    calls = {
        "sensor.treshold": lambda: viform.Camera(treshold="1 e"),
        "sensor.threshold must be": lambda: viform.Camera(threshold="1000 s"),
        "tier must be one of fast, exact": lambda: viform.Camera(tier="slow"),
        "tier must be exact or reference": lambda: viform.Camera(tier="fast", device="numba"),
        "a Camera must be a simulated one": lambda: viform.Camera(
            **{"sub_threshold.limit": "5 ms"}
        ),
        "sensor.pixel must be": lambda: viform.Camera(pixel="slow"),
        "check must be True, False or a whole": lambda: camera.film(frames(), 2000, check=-1),
        "the camera must be open, not closed": lambda: closed.film(frames(), 2000),
        "frame_rate must be frames/s above 0": lambda: camera.film(frames(), 0),
        "frame_rate must be frames/s as": lambda: camera.film(frames(), None),
        "a frame must be .* not .6, 48. int64": lambda: camera.film(np.zeros((2, 6, 48), int), 9),
        "from 0 to 1, a share of white, not -1 to 0": lambda: camera.film(
            np.full((2, 4, 4), -1.0), 25
        ),
        "without NaN, not 16 of 16": lambda: camera.film(np.full((2, 4, 4), np.nan), 25),
        "frames must be at least a cycle": lambda: camera.film(frames(1), 1e9),
        "a frame must be an array .H, W., not .* inhomogeneous": lambda: camera.film(
            [[[0.1, 0.2], [0.3]]], 2000
        ),
        "a frame must be an array without masked pixels": lambda: camera.film(
            np.ma.masked_greater(frames(), 100), 2000
        ),
        "white_rate must be above 0 .* not True": lambda: camera.film(
            frames(), 2000, white_rate=True
        ),
        'or write [*][*]{"lens.f_number": "1000"}': lambda: camera.film(
            frames(), 2000, white_rate=1e-12
        ),
        "white_rate must be above 0": lambda: camera.film(frames(), 2000, white_rate=2),
        "call must be a whole number": lambda: camera.film(frames(), 2000, call=-1),
        "call must be a whole number from 0, not 1.0": lambda: camera.film(frames(), 9, call=1.0),
        "white_rate must be above 0 .* not '0.5'": lambda: camera.film(
            frames(), 2000, white_rate="0.5"
        ),
        "clips must be frames of several": lambda: camera.film_many(None, 2000),
        "instants must be numbers of cycles": lambda: camera.film_many([frames()], 9, instants=()),
        "the spikes of .* must be": lambda: camera.film(frames(2), 1e-5),
        "instants must be cycles from 0 to 119": lambda: list(
            camera.film_many([frames()], 2000, instants=[120])
        ),
        "a frame must be as the first": lambda: stream.push(frames()[0, 1:]),
        "^frame_rate must be given, not absent; write frame_rate=": lambda: camera.film(frames()),  # type: ignore[call-arg]
        "^frames and frame_rate must be given": lambda: camera.film(),  # type: ignore[call-arg]
        "^at must be given": lambda: viform.reconstruct(closed),  # type: ignore[call-arg]
    }
    for says, call in calls.items():
        with pytest.raises(viform.InputError, match=says) as raised:
            call()
        assert "\n" not in str(raised.value) and "--" not in str(raised.value)
    text = repr(camera)
    assert "64 x 48 pixels at 40 kHz" in text and "closed" in repr(closed)
    told = repr(stream)
    assert told.startswith("LiveStream: 64 x 48 pixels, frames (48, 64) uint8, bound ")
    told = repr(viform.SpikeStream([frames()] * 3, camera, 2000))
    assert told == f"SpikeStream: 3 clips at 2000 frames/s, epoch 0 next, by {text}"
    with pytest.raises(TypeError, match="unexpected keyword"):  # no such argument is Python's own
        camera.film(frames(), 2000, nothing=1)  # type: ignore[call-arg]


@pytest.mark.parametrize("readout", ["asynchronous", "continuous"])
def test_what_cannot_be_filmed_without_a_latch_is_one_line(readout: str) -> None:
    keys = {**SMALL, "pixel": readout}
    camera, closed = viform.Camera(**keys), viform.Camera(**keys)
    closed.close()
    stream = camera.open(2000)
    stream.push(frames()[0])
    section = f"{readout}.most_{'events' if readout == 'asynchronous' else 'reports'}"
    calls = {
        "sensor.reset must be residual": lambda: viform.Camera(**keys, reset="hard"),
        "sensor.colour must be given with": lambda: viform.Camera(
            **keys, **{"colour.filter": "rggb"}
        ),
        "tier must be absent with pixel": lambda: viform.Camera(**keys, tier="exact"),
        "device must be numba with pixel": lambda: viform.Camera(**keys, device="0"),
        "the camera must be open, not closed": lambda: closed.film(frames(), 2000),
        "frame_rate must be frames/s as": lambda: camera.film(frames(), None),
        "a frame must be .* not .6, 48. int64": lambda: camera.film(np.zeros((2, 6, 48), int), 9),
        "from 0 to 1, a share of white, not -1 to 0": lambda: camera.film(
            np.full((2, 4, 4), -1.0), 25
        ),
        "without NaN, not 16 of 16": lambda: camera.film(np.full((2, 4, 4), np.nan), 25),
        "frames must be at least a cycle of": lambda: camera.film(frames(1), 1e11),
        "must be at most 100, not more": lambda: viform.Camera(**keys, **{section: 100}).film(
            frames(), 2000
        ),
        "a frame must be as the first": lambda: stream.push(frames()[0, 1:]),
        "without NaN, not 16 of 16 ": lambda: camera.open(9).push(np.full((4, 4), np.nan)),
        "camera must be one with pixel = latched": lambda: viform.SpikeStream(
            [frames()], camera, 2000
        ),
    }
    if readout == "asynchronous":
        shared = viform.Camera(**keys, **{"channel.rate": "1 MHz"})
        calls["channel must be absent for a live camera"] = lambda: shared.open(2000)
    for says, call in calls.items():
        with pytest.raises(viform.InputError, match=says) as raised:
            call()
        assert "\n" not in str(raised.value) and "--" not in str(raised.value)
    assert f"64 x 48 pixels at 40 kHz, {readout}" in repr(camera) and "closed" in repr(closed)


@pytest.mark.parametrize(
    ("keys", "remedy"),
    [
        ({"pixel": "async"}, 'write pixel="latched"'),
        ({"threshold": "1000"}, 'write threshold="1000 e"'),
        ({"illuminance": "50"}, 'write illuminance="700 lux"'),
        ({"writes": 3}, 'write writes=[{"cycle": 400, "threshold_level": 8}]'),
        ({"sensor.threshold": "1000"}, 'write threshold="1000 e"'),
    ],
)
def test_what_an_error_says_to_write_is_an_argument(keys: dict[str, str], remedy: str) -> None:
    with pytest.raises(viform.InputError) as refused:
        viform.Camera(**keys)  # type: ignore[call-overload]
    assert refused.value.remedy == remedy


def test_what_is_closed_does_not_go_to_other_processes_and_files_are_no_frames() -> None:
    camera = viform.Camera(**SMALL)
    with pytest.raises(viform.InputError, match=r"use viform\.film for files"):
        camera.film("clip.mp4", 2000)  # type: ignore[arg-type]
    with pytest.raises(viform.InputError, match=r"^first must be a whole number"):
        camera.film_many([frames()], 2000, first="a")  # type: ignore[arg-type]
    camera.close()
    with pytest.raises(viform.InputError, match="make another Camera"):
        pickle.dumps(camera)


def test_frames_last_as_long_as_they_say() -> None:
    """The last one as any other: nothing is lacking."""
    seen = viform.Camera(**SMALL).film(frames(), 2000)
    assert seen.degraded == () and not any("held" in note for note in seen.notes)
