"""Readings below threshold, and rejection of the dark (Huang 2022, 4.4 and 4.5)."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import PS, Block, Clock, InputError, Light, Piece
from cosim.compute.opencl import Device
from cosim.spikes.viform import Viform
from scenarios.assemble.source.latched.dim import dark_cycles
from scenarios.cli.entry import _main
from sensor import CHIPS, CameraSetting, SpikeCamera
from sensor.device.pattern import DevicePattern
from sensor.dynamic_range import (
    dark_limit,
    longest_width,
    seen_dark_share,
    spike_dynamic_range,
)
from sensor.latched.reading import ReadingCamera, joined
from sensor.reconstruct.readings import DimLight, Readings, read_readings, write_readings
from sensor.sections.sensor import SensorSection
from tests.sensor.latched import test_fine_tiles as chip

SHAPE = (64, 96)
EVERY, LEVELS, Q = 64, 50, 1000.0


def setting(**more: Any) -> CameraSetting:
    small = replace(CHIPS["spikeone"], height=SHAPE[0], width=SHAPE[1])
    return CameraSetting(small, Clock.from_hz(40e3), Q, 5, **more)


def uniform(made: CameraSetting, rate: float) -> Light:
    lux = np.full(SHAPE, rate / made.rate(1.0), np.float32)
    return Light((Piece(-PS, PS, lux, lux),))


def camera(made: CameraSetting, device: Device | None, tier: Any = "exact") -> ReadingCamera:
    used = device if tier == "fast" else None
    return ReadingCamera(SpikeCamera(made, used, tier=tier), made, EVERY, LEVELS)


@pytest.mark.parametrize("tier", ["exact", "fast"])
def test_levels_have_the_law_of_poisson_electrons(device: Device, tier: str) -> None:
    """Pixels that do not fire between two readings: the difference of levels has the mean
    m = rate T N and the variance of m Q/N electrons, (N/Q)^2, plus that of two roundings, 1/6."""
    made = setting()
    rate = 0.1 / EVERY  # a tenth of a threshold between readings
    taken = camera(made, device, tier)
    parts = [taken.step(uniform(made, rate), Block(n * 40, 40)) for n in range(16)]
    stream = joined(parts)
    more = []
    for at in (100, 300, 500):
        read, light = taken.readings().rate(stream, at)
        assert 0.85 < read.mean() < 0.95  # a tenth fires
        more.append(light[read] * EVERY * LEVELS)
    levels = np.concatenate(more)
    mean, electrons = 0.1 * LEVELS, 0.1 * Q
    variance = electrons * (LEVELS / Q) ** 2 + 1 / 6
    n = levels.size
    # Pixels that come near the threshold fire, so the others' mean is below by less than 1 %.
    assert levels.mean() == pytest.approx(mean, abs=5 * math.sqrt(variance / n) + 0.01 * mean)
    assert levels.var() == pytest.approx(variance, rel=6 * math.sqrt(2 / n) + 0.02)


def test_a_reading_is_the_charge_without_noise() -> None:
    """Without shot noise a reading is floor(N charge / Q): every pixel gains 6.4 levels of 50 in 64
    cycles at 0.002 spikes a cycle."""
    made = setting().without(["shot noise"])
    taken = camera(made, None)
    stream = taken.step(uniform(made, 0.002), Block(0, 5 * EVERY))
    readings = taken.readings()
    charge = readings.level.astype(int) + LEVELS * np.stack(
        [stream.planes()[:cycle].sum(axis=0) for cycle in readings.cycle]
    )
    gained = charge - charge[0]
    expected = 0.002 * readings.cycle * LEVELS
    assert np.all(np.abs(gained - expected[:, None, None]) <= 1)
    assert gained[-1].mean() == pytest.approx(expected[-1], abs=0.05)


@pytest.mark.parametrize("tier", ["reference", "exact", "fast"])
def test_spikes_are_those_of_the_camera_without_readings(device: Device, tier: Any) -> None:
    """Also over blocks that end between readings, and from a state of the middle."""
    made = chip.camera()
    used, shown = device if tier == "fast" else None, chip.light(made)
    plain = SpikeCamera(made, used, tier=tier).step(shown, Block(0, 90))

    def reading() -> ReadingCamera:
        return ReadingCamera(SpikeCamera(made, used, tier=tier), made, 7, LEVELS)

    whole, first, second = reading(), reading(), reading()
    assert whole.step(shown, Block(0, 90)) == plain
    parts = [first.step(shown, Block(0, 33))]
    second.restore(first.state())
    parts.append(second.step(shown, Block(33, 57)))
    assert joined(parts) == plain
    one, other = whole.readings(), second.readings()
    np.testing.assert_array_equal(one.cycle, np.arange(13) * 7)
    np.testing.assert_array_equal(one.level, other.level)


def test_joined_is_the_whole() -> None:
    random = np.random.default_rng(2)
    planes = random.integers(0, 2, (203, 3, 5), dtype=np.uint8)
    cuts = [0, 1, 31, 64, 65, 130, 203]
    clock = Clock(40_000)
    parts = [replace(Viform.from_planes(planes[a:b], clock), start=a) for a, b in pairwise(cuts)]
    assert joined(parts) == Viform.from_planes(planes, clock)


def test_intervals_as_long_as_the_dark_current_s_are_dark() -> None:
    planes = np.zeros((100, 1, 4), np.uint8)
    planes[[10, 30], 0, 0] = 1  # 20 cycles
    planes[[10, 80], 0, 1] = 1  # 70 cycles
    planes[60, 0, 2] = 1  # at least 61 before and 40 after
    stream = Viform.from_planes(planes, Clock(40_000))
    for cycles, dark in ((71.0, [0, 0, 0, 1]), (70.0, [0, 1, 0, 1]), (15.0, [1, 1, 1, 1])):
        assert DimLight(dark=cycles).at(stream, 25).dark[0].tolist() == dark, cycles
    level = np.array([[[0, 0, 0, 5]], [[9, 9, 9, 9]]], np.uint16)
    readings = Readings(np.array([0, 100]), level, 10)
    dim = DimLight(readings, 240.0).at(stream, 25)
    assert dim.read[0].tolist() == [0, 0, 0, 1]
    assert dim.rate[0, 3] == pytest.approx(4 / (10 * 100))  # a width of 250 cycles: dark
    assert dim.dark[0, 3] and dim.put(np.ones((1, 4), np.float32))[0].tolist() == [1, 1, 1, 0]
    # No reading after the cycle: from spikes alone.
    assert not DimLight(Readings(np.array([0]), level[:1], 10)).at(stream, 25).read.any()


@pytest.mark.parametrize(
    ("limit", "share", "dsnu"),
    [("dark current", 0.0, 0.0), ("1 sigma", 0.0, 0.0), ("2 sigma", 0.0, 0.05), ("2 %", 0.02, 0.0),
     ("2 %", 0.02, 0.15)],
)  # fmt: skip
def test_a_margin_leaves_its_share_of_a_dark_scene(limit: str, share: float, dsnu: float) -> None:
    """A dark scene is filmed: the pixels whose interval is below the limit are as many as the law
    says, within five deviations of the binomial distribution, at instants that share no interval;
    at the stated share or just below it."""
    electrons, width = 400.0, 60.3
    pattern = DevicePattern(dark=electrons * 40e3 / width, dsnu=dsnu)
    made = replace(setting(pattern=pattern), threshold=electrons)
    text = f"{electrons} e"
    section = SensorSection(threshold=text, dark_limit=limit)  # type: ignore[arg-type]
    found = dark_cycles(section, made)
    dark = uniform(made, 0.0)
    stream = SpikeCamera(made, None, tier="exact").step(dark, Block(0, 1024))
    law = (width, electrons**-0.5, dsnu)
    predicted = seen_dark_share(math.ceil(found), *law)
    # An interval may be twice its mean, with its pixel's dark current, at the longest.
    taken = range(150, 900, 150)
    seen = [~DimLight(dark=found).at(stream, at).dark for at in taken]
    pixels = len(taken) * seen[0].size
    # Pixels have the same current at all instants: only the pixels count where these differ.
    free = seen[0].size if dsnu else pixels
    error = 5 * math.sqrt(predicted * (1 - predicted) / free)
    assert np.mean(seen) == pytest.approx(predicted, abs=error)
    if share:
        assert predicted <= share < seen_dark_share(math.ceil(found) + 1, *law)
    elif limit != "dark current":
        deviation = math.hypot(electrons**-0.5, dsnu)
        assert found == math.floor(width * (1 - float(limit[0]) * deviation))
    else:
        assert found == pytest.approx(width) and 0.4 < predicted < 0.6


def test_the_law_of_the_dark_is_that_of_gamma_variates() -> None:
    """Also where a width is latched as one of a few cycles, and of no noise."""
    random = np.random.default_rng(3)
    n = 400_000
    for width, a, limit in ((4.7, 25.0, 5), (40.2, 100.0, 36), (900.0, 10.0, 500)):
        latched = np.floor(random.gamma(a + 1, width / a, n) + random.random(n))
        share = float((latched < limit).mean())
        deviation = math.sqrt(share / n)
        assert seen_dark_share(limit, width, a**-0.5) == pytest.approx(share, abs=5 * deviation)
    assert seen_dark_share(10, 9.25, 0.0) == pytest.approx(0.75)
    assert [seen_dark_share(n, 9.25, 0.0) for n in (9, 11)] == [0, 1]
    assert dark_limit(0.5, 9.25, 0.0) == 9 and dark_limit(1e-3, 1e6, 0.01) == pytest.approx(
        1e6 * (1 - 3.09 * 0.01), rel=2e-3
    )


def test_a_file_of_readings_is_read_back_or_refused(tmp_path: Path) -> None:
    path = tmp_path / "readings.npz"
    made = Readings(np.array([0, 8]), np.arange(12, dtype=np.uint16).reshape(2, 2, 3), 100)
    write_readings(made, path)
    back = read_readings(path)
    assert back.levels == 100
    np.testing.assert_array_equal(back.level, made.level)
    whole = path.read_bytes()
    random = np.random.default_rng(4)
    for _ in range(60):
        broken = bytearray(whole)
        for at in random.integers(0, len(whole), 3):
            broken[at] = random.integers(0, 256)
        path.write_bytes(broken[: random.integers(1, len(whole))])
        with pytest.raises(InputError, match="readings of a run"):
            read_readings(path)


def run(capsys: pytest.CaptureFixture[str], *sets: str) -> tuple[int, dict[str, Any], str]:
    words = [word for each in sets for word in ("--set", each)]
    code = _main(["run", "film", *words, "--json"])
    read = capsys.readouterr()
    return code, json.loads(read.out) if code == 0 else {}, read.err


DIM = (
    "sensor.chip=spikeone", "sensor.threshold=20000 e", "scene.illuminance=20 lux",
    "sensor.lens.f_number=1", "duration=10 ms", "image.window=201", "tolerance=0.1",
)  # fmt: skip


def test_a_dim_scene_is_seen_by_readings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Few pixels fire in 10 ms; with readings every 2 ms the image has their light."""
    out = f"--out={tmp_path}/run"
    code, plain, _ = run(capsys, *DIM)
    words = [word for each in DIM for word in ("--set", each)]
    more = ["sensor.sub_threshold.limit=2 ms", "sensor.pattern.dark_current=1000 e/s",
            "sensor.dark_limit=dark current"]  # fmt: skip
    more = [word for each in more for word in ("--set", each)]
    assert (code, _main(["run", "film", *words, *more, "--json", out])) == (0, 0)
    seen = json.loads(capsys.readouterr().out)
    value = {name: each["value"] for name, each in seen["metrics"].items()}
    assert value["tfi_psnr"] > plain["metrics"]["tfi_psnr"]["value"] + 5
    assert value["sub_threshold_pixels"] > 50_000
    assert value["dynamic_range_formula"] == pytest.approx(spike_dynamic_range(80, 1, 100))
    assert value["dark_limit"] == pytest.approx(longest_width(20_000, 1000.0))
    saved = read_readings(tmp_path / "run" / "readings.npz")
    assert saved.level.shape == (6, 250, 400) and "readings.npz" in seen["files"]
    # `viform image` makes the pictures of the run, of its readings and without its dark.
    white, run_folder = str(value["white_rate"]), str(tmp_path / "run")
    for method in ("tfp", "tfi"):
        of_run = next((tmp_path / "run/images").glob(f"{method}-*.png"))
        cycle, png = of_run.stem.partition("-")[2], str(tmp_path / "a.png")
        words = ["--method", method, "--scale", white, "--out", png, "--window", "201", "--json"]
        assert _main(["image", run_folder, "--at", cycle, *words]) == 0
        told = json.loads(capsys.readouterr().out)
        assert told["sub_threshold_pixels"] > 50_000 and told["dark_pixels"] is not None
        assert Path(png).read_bytes() == of_run.read_bytes()


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        (
            ("sensor.sub_threshold.limit=1 s",),
            "sensor.sub_threshold.limit must be 25 µs to 10 ms, one cycle to the run, not '1 s'; "
            "shorten it, or lengthen duration",
        ),
        (
            ("sensor.sub_threshold.limit=1 us",),
            "25 µs to 10 ms, one cycle to the run, not '1 µs'; lengthen it, or raise sensor.clock",
        ),
        (("sensor.dark_limit=dark current",), "sensor.pattern.dark_current must be above 0"),
        (
            ("sensor.dark_limit=dark",),
            "must be a time such as '64 ms', 'dark current', '3 sigma' or '0.1 %', not 'dark'; "
            "write --set sensor.dark_limit='64 ms'",
        ),
        (("sensor.dark_limit=60 %",), "must be a share of the dark above 0 % and at most 50 %"),
        (("sensor.dark_limit=3 sigma",), "must be above 0 with sensor.dark_limit = '3 sigma'"),
        (
            ("sensor.dark_limit=200 sigma", "sensor.pattern.dark_current=1000 e/s"),
            "must be a margin that leaves 2 of the 8e+05 cycles of a width in the dark, whose "
            "standard deviation is 0.0071 of it, not '200 sigma'; take a smaller margin",
        ),
        (("sensor.sub_threshold.limit=1 ms", "sensor.pixel=asynchronous"), "latched"),
    ],
)
def test_settings_that_cannot_be_are_refused(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, sets: tuple[str, ...],
    said: str,
) -> None:  # fmt: skip
    """Before a device is opened."""
    monkeypatch.setattr("scenarios.assemble.source.latched.setup.choose_device", lambda _: 1 / 0)
    code, _, told = run(capsys, *DIM, *sets)
    assert code == 2 and said in told and told.strip().count("\n") == 0
