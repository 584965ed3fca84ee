"""`viform accuracy --every-tile`: the error of all tiles against the one that a run states."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from scenarios.assemble.source.latched.plan import RunPlan
from scenarios.cli.entry import _main

SETS = ("sensor.chip=spikeone", "duration=3 ms", "image.at=[60]", "scene.at=1 ms")
WORDS = [word for each in SETS for word in ("--set", each)]
SMALL = WORDS[:-2]
FAULTY = 100


def document(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, Any]:
    code = _main(["accuracy", *words, "--every-tile", "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_the_stated_error_is_that_of_the_run(film, tmp_path, capsys):
    code, found = document(capsys, "step", *WORDS)
    assert code == 0 and all(row["holds"] for row in found["rows"])
    assert [row["tolerance"] for row in found["rows"]] == [0.0, 1e-3, 1e-2, 0.1]
    for row in found["rows"]:
        result, _ = film("step", tmp_path / f"{row['tolerance']}", *SETS,
                         f"tolerance={row['tolerance']}")  # fmt: skip
        assert (row["error"], tuple(row["ci"])) == (result.error.value, result.error.ci)
        assert row["outcome"] == result.outcome and row["tiles"] == 375
        assert row["worst_error"] >= row["error"]


def plant(monkeypatch: pytest.MonkeyPatch, sampled: bool) -> None:
    """Rates of the tile FAULTY are 5 % too high, in the samples of a run only if `sampled`."""
    on_patches = RunPlan.on_patches

    def planted(self: RunPlan, plane: Any, device: Any) -> Any:
        camera, pixels = on_patches(self, plane, device), plane.rows * plane.columns
        if FAULTY in plane.tiles and (sampled or pixels == 256):
            fault = np.repeat(np.array(plane.tiles) == FAULTY, pixels)
            phase = camera.phase
            monkeypatch.setattr(camera, "phase", lambda: phase() * np.where(fault, 1.05, 1.0))
        return camera

    monkeypatch.setattr(RunPlan, "on_patches", planted)


def test_an_error_in_one_tile_is_found(capsys, monkeypatch):
    plant(monkeypatch, sampled=False)
    code, found = document(capsys, "step", *WORDS)
    assert code == 1
    for row in found["rows"][:3]:
        assert row["worst_tile"] == FAULTY and row["over_limit"] == 1 and not row["holds"]
        assert 0.01 < row["worst_error"] < 0.06


def test_a_run_finds_it_by_its_samples(film, tmp_path, monkeypatch):
    plant(monkeypatch, sampled=True)
    result, _ = film("step", tmp_path / "run", *SETS)
    error = result.error
    assert result.outcome == "degraded" and error.tiles_checked == 400 and error.tiles_over == 1
    assert 0.005 < error.value < 0.06 < error.ci[1]


def test_a_display_is_compared_by_its_radiance(capsys):
    code, found = document(capsys, "glass", *SMALL, "--set", "display.observer=camera")
    assert found["error_of"] == "radiance"
    assert all(row["worst_error"] >= row["error"] for row in found["rows"])
    assert code == 0 and all(row["holds"] for row in found["rows"])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ("light-link",),
            "--every-tile must be given with a scenario of a latched chip, not light-link",
        ),
        (("emccd-window",), "a scenario of a latched chip, not emccd-window; leave it out"),
        (
            ("step", "--set", "sensor.pixel=asynchronous"),
            "a scenario of a latched chip, not step; leave it out",
        ),
        (("step", "--figure", "a.png"), "--figure must be given without --every-tile"),
    ],
)
def test_what_it_cannot_measure_is_refused(refused, words, says):
    assert says in refused("accuracy", *words, "--every-tile")
