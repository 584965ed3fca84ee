"""`viform laboratory`: the document, the table, the figure, refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

from cosim import Block, Clock
from cosim.files import Recorder
from cosim.spikes.viform import Viform


def test_the_document_has_a_row_for_each_parameter(viform, tmp_path):
    code, out, err = viform("laboratory", "emccd", "--json", "--figure", tmp_path / "a.png")
    assert (code, err) == (0, "")
    document = json.loads(out)
    assert document["camera"] == "emccd" and document["standard"].startswith("EMVA 1288")
    rows = {row["symbol"]: row for row in document["rows"]}
    assert len(rows) == 14
    for row in rows.values():
        assert set(row) == {"name", "symbol", "section", "what", "unit", "value", "low", "high"}
        assert row["low"] <= row["value"] <= row["high"]
    sections = ["sensitivity", "linearity", "dark current", "non-uniformity"]
    assert list(dict.fromkeys(row["section"] for row in rows.values())) == sections
    assert rows["eta"]["low"] < 0.93 < rows["eta"]["high"]
    assert len(document["curve"]["photons"]) == len(document["curve"]["mean"])
    assert document["notes"] and document["figure"] == str(tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert image.width > 800


def test_the_table_is_for_a_reader(viform):
    code, out, _ = viform("laboratory", "adaptive-exposure", "--seed", 3)
    assert code == 0
    lines = out.splitlines()
    assert lines[0].startswith("adaptive-exposure CMOS imager, measured by EMVA 1288")
    assert [line for line in lines if line.startswith("-- ")] == [
        "-- sensitivity", "-- linearity", "-- dark current", "-- non-uniformity"
    ]  # fmt: skip
    assert any(line.startswith("K  ") and "DN/e" in line for line in lines)
    assert lines[-1].startswith("a bias of")


def test_a_recording_has_its_laws(viform, tmp_path):
    words = np.random.default_rng(1).integers(0, 2**32, (8, 16, 24), dtype=np.uint32)
    recorder = Recorder(tmp_path / "stream.zarr", (16, 24), 256, Clock(40_000))
    recorder.step(Viform(words, 256, Clock(40_000)), Block(0, 256))
    figure = tmp_path / "laws.svg"
    code, out, err = viform("laboratory", tmp_path / "stream.zarr", "--json", "--figure", figure)
    assert (code, err) == (0, "")
    document = json.loads(out)
    assert (document["cycles"], document["width"], document["height"]) == (256, 24, 16)
    # Bits at random: intervals are geometric, mean 2, and independent.
    assert document["rate"] == pytest.approx(0.5, rel=0.02)
    assert figure.read_text().lstrip().startswith("<?xml")
    _, text, _ = viform("laboratory", tmp_path / "stream.zarr")
    assert "256 cycles of 24 x 16 pixels" in text and "correlation of successive" in text


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("pinhole",), "CAMERA must be one of spiketwo, spikeone, adaptive-exposure, ebaps, emccd, "
         "or a recording that exists, not 'pinhole'; choose one"),
        (("emccd", "--figure", "a.jpg"), "--figure must be a name ending in .png or .svg, not "
         "a.jpg; try a.png"),
        (("emccd", "--figure", "/nowhere/a.png"), "--figure must be in a folder that exists, not "
         "/nowhere/a.png; create the folder"),
        ((__file__, "--seed", 1), "--seed must be given with a camera, not with a recording; "
         "leave it out"),
        (("emccd", "--size", "16x8"), "--size must be given with a recording, not with a camera; "
         "leave it out"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_one_line(refused, words, says):
    assert refused("laboratory", *words) == says
