"""`viform board gateware`: its folder, its documents, and one line for what cannot be.

`viform board links`: shares of a pixel array that links carry.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rtl_model.gateware import TARGETS, Fit, design_for
from rtl_model.geometry import Geometry
from tests.scenarios.conftest import Answer

COMMAND = [sys.executable, "-c", "from scenarios.cli import main; main()", "board", "gateware"]


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=900)


def test_a_folder_and_its_document(tmp_path: Path) -> None:
    out = tmp_path / "board"
    done = run("arty-a7-35", "--out", str(out), "--rows", "16", "--baud", "1000000", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    document = json.loads(done.stdout)
    assert list(document) == [
        "ok", "target", "family", "part", "clock_hz", "baud", "baud_error", "geometry", "build",
        "files", "cells", "ethernet", "ip",
    ]  # fmt: skip
    assert document["geometry"] == Geometry(16, 32, 32, 50_000_000, 1_000_000)._asdict()
    assert (document["ok"], document["cells"], document["baud_error"]) == (True, None, 0.0)
    assert document["files"] == sorted(path.name for path in out.iterdir())
    design = design_for(TARGETS["arty-a7-35"], rows=16, baud=1_000_000)
    assert document["build"] == f"{design.build:08x}"

    again = run("arty-a7-35", "--out", str(out))
    assert (again.returncode, again.stdout) == (2, "")
    assert "must be a new or an empty folder" in again.stderr


def test_the_list_names_every_target() -> None:
    done = run("--list", "--json")
    assert [row["target"] for row in json.loads(done.stdout)["targets"]] == list(TARGETS)
    assert [line.split()[0] for line in run("--list").stdout.splitlines()] == list(TARGETS)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("ulx3s",), "the target must be one of ulx3s-12f"),
        (("ulx3s-25f", "--baud", "2000000"), "take 1500000 or 2500000"),
        (("ulx3s-25f", "--rows", "4000"), "56 block RAMs"),
        (("ulx3s-25f", "--lanes", "16"), "--lanes must be 32 or 64"),
        ((), "TARGET must be given"),
    ],
)
def test_what_cannot_be_is_one_line(arguments: tuple[str, ...], says: str, tmp_path: Path) -> None:
    done = run(*arguments, "--out", str(tmp_path / "board"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert says in done.stderr
    assert not (tmp_path / "board").exists()


def test_out_must_be_given() -> None:
    done = run("ulx3s-25f")
    assert (done.returncode, done.stdout) == (2, "")
    assert "--out DIR must be given" in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("yosys") is None, reason="needs the system package yosys")
def test_cells_are_counted_beside_the_devices(tmp_path: Path) -> None:
    out = tmp_path / "board"
    done = run("ulx3s-12f", "--out", str(out), "--cells", "--json")
    cells = json.loads(done.stdout)["cells"]
    assert done.returncode == 0
    assert (cells["block_rams"], cells["block_rams_of"]) == (32, 32)
    assert 0 < cells["flip_flops"] < cells["luts"] <= cells["luts_of"] == 12_000
    assert (out / "Makefile").is_file()


@pytest.mark.parametrize("json_wanted", [False, True])
def test_what_does_not_fit_is_told_and_not_written(
    json_wanted: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    viform: Callable[..., Answer],
) -> None:
    cells = Fit(25_000, 24_288, 2_000, 24_288, 36, 56)
    monkeypatch.setattr("rtl_model.gateware.fit", lambda design: cells)
    options = ["--out", tmp_path / "board", "--cells", *["--json"] * json_wanted]
    code, out, _ = viform("board", "gateware", "ulx3s-25f", *options)
    assert code == 1
    if json_wanted:
        document = json.loads(out)
        assert (document["ok"], document["files"]) == (False, [])
        assert document["cells"] == cells._asdict()
    else:
        assert "luts       25000 of 24288, 103 %\n" in out
        assert out.endswith("is too small: nothing was written\n")
    assert not (tmp_path / "board").exists()


@pytest.mark.slow
def test_ethernet_and_its_refusals(tmp_path: Path) -> None:
    out = tmp_path / "board"
    done = run(
        "colorlight-i5", "--ethernet", "phy1", "--ip", "10.0.0.7", "--out", str(out), "--json"
    )
    document = json.loads(done.stdout)
    assert (document["ethernet"], document["ip"], document["clock_hz"]) == (
        "phy1", "10.0.0.7", 37_500_000,
    )  # fmt: skip
    assert "ip_address: 10.0.0.7" in (out / "liteeth.yml").read_text()
    for options, says in (
        (["--ethernet", "phy9"], "must be one of phy0, phy1"),
        (["--ethernet", "phy0", "--ip", "x"], "an IPv4 address"),
        (["--ethernet", "phy0", "--cells"], "--cells must be left out with --ethernet"),
        (["--ip", "10.0.0.7"], "--ip and --mac must be given with --ethernet PHY"),
    ):
        done = run("colorlight-i5", *options, "--out", str(tmp_path / "other"))
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
        assert says in done.stderr
    assert not (tmp_path / "other").exists()


def test_a_share_is_the_links_rate_over_the_arrays(viform: Callable[..., Answer]) -> None:
    answer = viform("board", "links", "--size", "200x100", "--clock", "10 kHz", "--json")
    assert answer.code == 0
    document = json.loads(answer.out)
    assert document["raw_bit_per_s"] == 200e6
    assert document["coded"] == []
    shares = {row["link"]: row["shares"] for row in document["links"]}
    assert shares["UART, 12 Mbaud"] == {"raw": pytest.approx(0.048)}
    assert shares["Ethernet, 1 Gbit/s"] == {"raw": 1.0}
    planes = {row["link"]: row["planes_per_s"] for row in document["links"]}
    assert planes["UART, 12 Mbaud"] == 480.0


def test_codes_are_measured_on_a_recording(viform: Callable[..., Answer], tmp_path: Path) -> None:
    """A pixel that never fires costs the headers of packets, one at random all of its bits."""
    rng = np.random.default_rng(1)
    recordings = {"dark": np.zeros((256, 64, 64), bool), "noise": rng.random((256, 64, 64)) < 0.5}
    bits = {}
    for name, spikes in recordings.items():
        path = tmp_path / f"{name}.npz"
        np.savez(path, spikes=spikes, clock_hz=40_000.0)
        answer = viform("board", "links", path, "--json")
        assert answer.code == 0, answer.err
        document = json.loads(answer.out)
        bits[name] = {row["code"]: row["bits"] for row in document["coded"]}
        share = document["links"][0]["shares"]
        assert share[f"{name}.npz layered"] == pytest.approx(
            min(1, share["raw"] / bits[name]["layered"])
        )
        assert f"| {name}.npz layered |" in viform("board", "links", path).out
    assert max(bits["dark"].values()) < 0.01
    assert bits["noise"]["layered"] > 0.99


def test_what_is_no_size_or_clock_is_refused(refused: Callable[..., str]) -> None:
    assert "--size must be WIDTHxHEIGHT" in refused("board", "links", "--size", "3")
    assert "--clock must be a frequency" in refused("board", "links", "--clock", "fast")
