"""`viform board capture --format spikecv`: what SpikeCV's loader and `viform convert` read."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
import yaml

from cosim.files import open_stream
from rtl_model.host import capture

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
