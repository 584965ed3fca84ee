"""The frames of an imager in the report and on disk: controllers and registers of each."""

from __future__ import annotations

import json
import re

import zarr

from cosim.report.explorer import kinds_in
from scenarios.cli.entry import _main


def test_registers_of_each_frame_are_those_that_were_written(tmp_path):
    """The threshold is written between the fourth and the fifth frame."""
    out = tmp_path / "run"
    assert _main([
        "run", "adaptive-exposure", "--set", "duration=85 ms", "--set", "imager.rows=32",
        "--set", "imager.columns=64", "--set", 'imager.writes=[["45 ms", "threshold", 9]]',
        "--out", str(out),
    ]) == 0  # fmt: skip
    stored = zarr.open_group(out / "frames.zarr", mode="r")
    held, ready = stored.attrs["registers"], stored["ready"][:]
    late = ready >= 45_000_000_000
    assert 0 < late.sum() < len(late)
    allowed = 32 * 64 >> 10
    assert held["adaptive_threshold"] == [9 if after else allowed for after in late]
    assert held["adaptive_last_frame"] == list(range(len(ready)))
    assert held["adaptive_last_multiplier"] == stored.attrs["state"]["multiplier"]
    page = (out / "report.html").read_text()
    assert kinds_in(page) == ["frames"]
    found = re.search(r"data-kind='frames'.*?<script type='application/json'>(.*?)</script>", page)
    assert found is not None
    columns = {one["name"]: one["values"] for one in json.loads(found[1])["columns"]}
    assert columns["adaptive_threshold"] == held["adaptive_threshold"]
    assert columns["adaptive_rows.last"] == [31] * len(ready)
    assert columns["adaptive_rows.first"] == [0] * len(ready)
    assert columns["multiplier"] == stored.attrs["state"]["multiplier"]
