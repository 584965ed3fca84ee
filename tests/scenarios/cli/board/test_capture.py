"""`viform board capture --format spikecv`: what SpikeCV's loader and `viform convert` read.

`viform board capture --levels` and `compare --levels`: charges read by the board.
"""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
import yaml

from cosim.files import open_stream
from rtl_model.host import capture
from rtl_model.virtual import VirtualBoard
from sensor.reconstruct.readings import read_readings
from tests.rtl_model.virtual.hosts import needs_verilator

MODEL = ("--port", "virtual", "--level", "model")


def loaded(root, name, label="raw"):
    """A recording as SpikeCV loads it (Zyj061/SpikeCV, spkData/load_dat.py): `data_parameter_dict`
    takes the config.yaml of the data set, the first part of the name, and refuses a label type that
    it does not list; `SpikeStream.get_spike_matrix` takes pixel n of a plane from bit n mod 8 of
    byte n // 8, and turns the rows over."""
    with open(os.path.join(root, name.split("/")[0], "config.yaml"), encoding="utf-8") as file:
        said = yaml.load(file, Loader=yaml.FullLoader)
    assert {"raw": 0}[label] in said.get("labeled_data_type")
    assert not said.get("is_labeled")  # then the path is that of the recording itself
    path = os.path.join(root, name)
    path = path if os.path.splitext(path)[-1] == ".dat" else path + ".dat"
    height, width = said.get("spike_h"), said.get("spike_w")
    data = np.fromfile(path, np.uint8)
    pixel = np.arange(len(data) // (height * width // 8) * height * width)
    return ((data[pixel // 8] >> (pixel % 8)) & 1).reshape(-1, height, width)[:, ::-1]


def test_spikecv_and_convert_read_what_was_captured(viform, tmp_path, monkeypatch):
    bursts, burst = [], capture.burst

    def noted(*given, **named):
        bursts.append(burst(*given, **named))
        return bursts[-1]

    monkeypatch.setattr(capture, "burst", noted)
    place = tmp_path / "set"
    place.mkdir()
    for name in ("one", "two"):  # a folder is a data set of recordings
        code, out, err = viform(
            "board", "capture", *MODEL, "--frames", "4", "--set", "sensor_pattern=2",
            "--set", "sensor_level=200", "--set", "sensor_threshold=0", "--clear",
            "--format", "spikecv", "--out", place / f"{name}.dat", "--json",
        )  # fmt: skip
        assert (code, json.loads(out)["frames"]) == (0, 4), err
        planes = bursts[-1].planes
        assert (planes != planes[:, ::-1]).any() and (planes != planes[:, :, ::-1]).any()
        np.testing.assert_array_equal(loaded(tmp_path, f"set/{name}"), planes)
        assert viform("convert", place / f"{name}.dat", tmp_path / f"{name}.npz")[0] == 0
        np.testing.assert_array_equal(open_stream(tmp_path / f"{name}.npz").planes(), planes)
    said = yaml.safe_load((place / "config.yaml").read_text())
    assert said == {
        "filename": "set", "spike_w": 32, "spike_h": 32, "is_labeled": False,
        "labeled_data_type": [0], "labeled_data_suffix": "None",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("--format", "spikecv", "--out", "a.npz"),
         "--out must be a name ending in .dat with --format spikecv, not a.npz; rename it, or "
         "leave --format out"),
        (("--format", "png", "--out", "a.dat"),
         "--format must be spikecv, not png; correct it, or leave it out"),
    ],
)  # fmt: skip
def test_another_format_is_one_line(refused, given, says):
    assert refused("board", "capture", *MODEL, *given) == says


def test_a_config_of_another_size_is_refused_before_the_capture(refused, tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text("filename: set\nspike_w: 400\nspike_h: 250\n")
    said = refused(
        "board", "capture", *MODEL, "--format", "spikecv", "--out", tmp_path / "a.dat"
    )  # fmt: skip
    assert said == (
        f"{path} must be absent, or one that says 32x32 of a.dat, not one that says 400x250; "
        "write into another folder"
    )
    assert [each.name for each in tmp_path.iterdir()] == ["config.yaml"]


LIGHT = ("--set", "sensor_pattern=2", "--set", "sensor_level=3")


@pytest.mark.parametrize(
    "port",
    [MODEL, pytest.param(("--port", "virtual"), marks=[needs_verilator, pytest.mark.slow])],
)
def test_the_board_reads_what_the_camera_model_reads(viform, port):
    code, out, err = viform("board", "compare", *port, *LIGHT, "--levels", "16", "--json")
    document = json.loads(out)
    assert (code, document["ok"]) == (0, True), err
    assert (document["levels"], document["levels_wrong"]) == (16, 0)


def test_a_sensor_that_runs_waits_for_the_reading_and_goes_on(viform):
    with VirtualBoard(level="model") as board:
        line = ("--port", board.port, "--time-scale", str(board.time_scale))
        run = ("--set", "sensor_run=1")
        code, out, err = viform("board", "compare", *line, *LIGHT, *run, "--levels", "32")
        assert (code, out.splitlines()[-1][-10:]) == (0, "none wrong"), err
        told = [viform("board", "regs", *line, "sensor_run", "sensor_frames") for _ in range(2)]
    assert "sensor_run" in told[0][1] and told[0][1] != told[1][1]  # frames are counted


def test_a_reading_of_a_sensor_that_never_ran_says_so(viform, tmp_path):
    for name, run in (("idle", ()), ("ran", ("--set", "sensor_run=1"))):
        path = tmp_path / f"{name}.npz"
        code, _, err = viform(
            "board", "capture", *MODEL, *LIGHT, *run, "--levels", "4", "--out", path
        )
        readings = read_readings(path)
        assert (code, "every charge is 0" in err) == (0, name == "idle"), err
        assert (readings.cycle[0] > 0) == (name == "ran")
    assert not read_readings(tmp_path / "idle.npz").level.any()


def test_a_stuck_pixel_has_another_level(viform):
    code, out, _ = viform("board", "compare", *MODEL, "--fault", "stuck=3,30", "--levels", "8")
    assert code == 1
    assert out.splitlines()[-1].endswith(", 1 wrong")


def test_the_file_is_that_of_a_runs_readings(viform, tmp_path):
    with VirtualBoard(level="model") as board:
        line = ("--port", board.port, "--time-scale", str(board.time_scale))
        for light in (LIGHT, ("--set", "sensor_rows=0x90004")):
            before = tmp_path / "burst.npz"
            assert viform("board", "capture", *line, *light, "--out", before)[0] == 0
        path = tmp_path / "readings.npz"
        code, out, err = viform("board", "capture", *line, "--levels", "4", "--out", path, "--json")
    document = json.loads(out)
    assert code == 0, err
    readings = read_readings(path)
    assert readings.levels == document["levels"] == 4
    assert readings.cycle.tolist() == [document["frames"]] and document["frames"] >= 16
    inside = np.zeros((32, 32), bool)
    inside[4:10] = True
    # How many frames have run depends on the machine, and with it how far the ramp has spread.
    assert len(np.unique(readings.level[0][inside])) > 1
    assert not readings.level[0][~inside].any()


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("--levels", "100", "--out", "a.npz"),
         "--levels must be 2, 4, 8, 16, 32, 64, 128, not 100; give one of these"),
        (("--levels", "4", "--out", "a.dat"),
         "--out must be a name ending in .npz with --levels, not a.dat; rename it"),
        (("--levels", "4", "--out", "a.npz", "--frames", "3"),
         "--frames, --clear and --format must be left out with --levels, not given; leave them "
         "out, because a reading is no burst"),
        (("--levels", "64", "--out", "a.npz"),
         "the levels of a reading must be at most 32 with a window of 32 rows, of which the "
         "board's memory holds 32 passes, not 64; take fewer levels or a smaller window"),
        (("--levels", "4", "--out", "a.npz", "--set", "capture_source=1"),
         "capture_source must be 0, the pixels, for a reading, not 1; set capture_source=0"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_one_line(refused, given, says):
    assert refused("board", "capture", *MODEL, *given) == says
