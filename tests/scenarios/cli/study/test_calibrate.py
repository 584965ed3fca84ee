"""`viform calibrate`: the example of its page, its files, and refusals."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cosim.clock import Clock
from cosim.files import write_stream
from cosim.spikes.viform import Viform
from sensor.device.chips import CHIPS

ROOT = Path(__file__).parents[4]
PAGE = ROOT / "docs/calibration.md"
DATA = ROOT.parent / "shared/data/reds_200_part1.dat"
SMALL = ("--set", "sensor.width=32", "--set", "sensor.height=24", "--set", "duration=25 ms")
"""Makes a run of the example small: a thousand cycles of 768 pixels."""


def test_the_example_of_the_page(viform, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text(encoding="utf-8")
    blocks = re.findall(r"(?:^    .*\n)+", text, re.MULTILINE)
    (tmp_path / "still.toml").write_text(blocks[0].replace("\n    ", "\n").strip() + "\n")
    commands = [line.strip() for line in blocks[1].splitlines()]
    assert [shlex.split(line)[1] for line in commands] == ["run", "run", "run", "calibrate", "run"]
    for line in commands:
        words = shlex.split(line)[1:]
        if words[0] == "run":
            words += SMALL
        code, out, err = viform(*words, "--json")
        assert code == 0, err
        if words[0] == "calibrate":
            document = json.loads(out)
    found = document["parameters"]
    assert document["roles"] == {"bright": "flat", "dim": "flat", "dark": "dark"}
    truth = {"prnu": 0.03, "threshold_fpn": 0.02, "dsnu": 0.1, "dead_pixels": 0.003}
    missed = [
        name for name, value in truth.items()
        if not found[name]["ci"][0] <= value <= found[name]["ci"][1]
    ]  # fmt: skip
    assert len(missed) <= 1
    for parameter in found.values():
        assert set(parameter) == {"title", "value", "ci", "unit", "known", "why", "remedy"}
        assert parameter["known"] or parameter["remedy"]
    folder = tmp_path / "my-camera"
    assert json.loads((folder / "result.json").read_text()) == document
    with Image.open(folder / "figures/intervals.png") as image:
        assert image.width > 500
    page = (folder / "report.html").read_text()
    assert "What does not fit" in page and "Not known, and why" in page
    assert not list(folder.glob(".*"))


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["ideal", "silicon"])
@pytest.mark.parametrize("chip", [name for name in CHIPS if name != "spikeasync"])
def test_every_preset_is_calibrated_and_films_by_the_printed_command(
    viform, tmp_path, chip, preset
):  # fmt: skip
    small = ("--set", "sensor.width=48", "--set", "sensor.height=32", "--set", "duration=25 ms")
    flat = ("--set", "scene.kind=target", "--set", "scene.contrast=1e-9")
    code, _, err = viform(
        "run", "film", *flat, *small, "--set", f"sensor.chip={chip}", "--set",
        f"sensor.preset={preset}", "--set", "sensor.threshold=15000 e", "--set",
        "sensor.lens.white_rate=0.4", "--set", "sensor.clock=20 kHz", "--out", tmp_path / "flat",
    )  # fmt: skip
    assert code == 0, err
    code, out, err = viform("calibrate", tmp_path / "flat", "--out", tmp_path / "camera")
    assert code == 0, err
    command = next(line for line in out.splitlines() if "camera.toml" in line)
    words = shlex.split(command)[1:]
    code, _, err = viform(*words, "--set", "duration=5 ms", "--out", tmp_path / "filmed")
    assert code == 0, err


def stream(path: Path, cycles: int, seed: int, shape: tuple[int, int] = (8, 8)) -> Path:
    planes = np.random.default_rng(seed).integers(0, 2, (cycles, *shape), np.uint8)
    write_stream(Viform.from_planes(planes, Clock(40_000)), path)
    return path


def test_bad_input_ends_in_one_line(refused, tmp_path):
    a = stream(tmp_path / "a.npz", 100, 1)
    assert "of 64 cycles or more" in refused("calibrate", stream(tmp_path / "b.npz", 40, 1))
    assert "--flat must be" in refused("calibrate", a, "--flat", f"{a}=bright")
    assert "a file that exists" in refused("calibrate", a, "--dark", tmp_path / "none.npz")
    assert "--clock must be" in refused("calibrate", a, "--clock", "fast")
    assert "--size must be" in refused("calibrate", a, "--size", "9x9")
    raw = tmp_path / "odd.dat"
    raw.write_bytes(bytes(12_501))
    assert "odd.dat" in refused("calibrate", raw)
    full = tmp_path / "full"
    full.mkdir()
    (full / "x").touch()
    said = refused("calibrate", a, "--out", full)
    assert "--out must be" in said and said.rstrip().endswith("choose another")


def test_what_one_moving_recording_cannot_tell(viform, tmp_path):
    # Spikes in every second cycle, later in every fourth.
    cycle = np.arange(640)[:, None, None] + np.zeros((1, 8, 8), int)
    planes = np.where(cycle < 320, cycle % 2 == 0, cycle % 4 == 0).astype(np.uint8)
    write_stream(Viform.from_planes(planes, Clock(40_000)), tmp_path / "a.npz")
    code, out, err = viform("calibrate", tmp_path / "a.npz", "--out", tmp_path / "o")
    assert code == 0, err
    assert "no camera.toml: it takes the temporal noise" in out
    every = json.loads((tmp_path / "o/result.json").read_text())["parameters"]
    found, hot = every["dead_time"], every["hot_pixels"]
    assert (hot["value"], hot["ci"], hot["known"]) == (None, [None, None], False)
    (line,) = (line for line in out.splitlines() if "hot pixels" in line)
    assert "cannot be known in light: a hot pixel" in line and "at most" not in line
    # 240 spikes from cycle 0 to cycle 636: the mean interval, with a cycle of rounding.
    assert found["ci"] == [0, pytest.approx((636 + 1) / 239 / 40_000)]


def test_a_page_of_noise_knows_nothing(viform, tmp_path):
    rng = np.random.default_rng(1)
    planes = rng.random((256, 8, 8)) < np.where(np.arange(256) < 128, 0.5, 0.1)[:, None, None]
    write_stream(Viform.from_planes(planes.astype(np.uint8), Clock(40_000)), tmp_path / "a.npz")
    code, out, err = viform("calibrate", tmp_path / "a.npz", "--out", tmp_path / "o", "--json")
    assert code == 0, err
    found = json.loads(out)["parameters"]
    assert not any(each["known"] for each in found.values())
    assert "Not known, and why" in (tmp_path / "o/report.html").read_text()


@pytest.mark.skipif(not DATA.exists(), reason=f"{DATA} is not here: public recording of a scene")
def test_a_moving_scene_gives_limits(viform, tmp_path):
    code, out, err = viform("calibrate", DATA, "--out", tmp_path / "o", "--json")
    assert code == 0, err
    document = json.loads(out)
    assert list(document["roles"].values()) == ["moving"]
    found = document["parameters"]
    assert [name for name, p in found.items() if p["known"]] == ["reset"]
    assert found["reset"]["value"] == "residual"
    # The set is synthetic, and without noise: every limit must hold for a perfect camera.
    assert found["interval_noise"]["ci"][0] == 0 < found["interval_noise"]["ci"][1] < 0.1
    assert found["threshold"]["ci"][1] is None
    assert all(p["value"] is None and p["remedy"] for p in found.values() if not p["known"])
    assert not (tmp_path / "o/camera.toml").exists()
