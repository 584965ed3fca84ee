"""bench, doctor and test: documents as programs read them, and that they can say no."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import scenarios.studies.bench.growth as growth
import scenarios.studies.bench.sensor as bench
from cosim.compute.opencl import open_device
from cosim.run.timing import TimingRow
from scenarios.cli.entry import _main
from scenarios.cli.maintenance import doctor
from tests.scenarios.studies.bench.small import make_bench_small


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    make_bench_small(monkeypatch, "sensor")


@pytest.mark.usefixtures("quick")
def test_bench_prints_the_documented_rows(capsys: pytest.CaptureFixture[str]) -> None:
    assert _main(["bench", "sensor", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert list(document) == ["device", "ceiling", "rows"]
    assert document["ceiling"]["value"] > 0
    names = ["static", "ramp", "noise", "noise-random", "noise-smooth", "noise-box"]
    *pixels, readout = document["rows"]
    banked = [(f"sensor.noise{kind}", "bank") for kind in ("", "-moving", "-still", "-bright")] + [
        ("sensor.noise-dark", "fast")
    ]
    assert [(row["name"], row["tier"]) for row in pixels] == [
        *((f"sensor.{name}", tier) for name in names for tier in ("exact", "fast")), *banked,
    ]  # fmt: skip
    assert (readout["name"], readout["unit"]) == ("sensor.readout", "bit/s")
    assert readout["realtime"] == pytest.approx(readout["value"] / 40.96e9)
    assert readout["plain_ratio"] > 0
    for row in pixels:
        assert list(row) == [
            "name", "tier", "value", "unit", "realtime", "ceiling_ratio", "plain_ratio"
        ]  # fmt: skip
        assert row["unit"] == "pixel-cycles/s"
        assert row["realtime"] == pytest.approx(row["value"] / 40e9)
        assert row["ceiling_ratio"] == pytest.approx(row["value"] / document["ceiling"]["value"])
        unmatched = "noise-" in row["name"] or row["tier"] == "bank"
        assert (row["plain_ratio"] is None) == unmatched
        assert row["plain_ratio"] is None or row["plain_ratio"] > 0


def test_growth_leaves_out_what_does_not_fit(monkeypatch, capsys) -> None:
    monkeypatch.setattr(growth, "_PIXELS", {"1e4": 10**4, "1e12": 10**12})
    monkeypatch.setattr(growth, "_CYCLES", {})
    assert _main(["bench", "growth", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row["name"] == "growth.pixels-1e4" and row["value"] > 0
    assert row["realtime"] == pytest.approx(row["value"] / 1e4 / 40e3)


@pytest.mark.usefixtures("quick")
def test_the_benchmarked_pixels_spike_as_their_picture_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # A benchmark of pixels that do nothing would be fast: count the spikes of what is timed.
    import numpy as np

    words = []
    least = bench.least

    def spy(call, repeats=1):  # type: ignore[no-untyped-def]
        words.append(call())
        return least(call, repeats)

    monkeypatch.setattr(bench, "least", spy)
    bench._exact(open_device(), 100_000, noise=True, ramp=False)
    rate = np.bitwise_count(words[0]).sum() / (100_000 * 64)
    assert rate == pytest.approx((bench.DARK + bench.BRIGHT) / 2, rel=0.02)


def test_bench_prints_rows_that_lack_a_ratio(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    row = TimingRow("link.detector", "packed", 0.998, "bit", None, None, 2.0)
    monkeypatch.setitem(bench.PARTS, "link", lambda device, ceiling: [row])
    assert _main(["bench", "link", "--device", "numba"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.split() == ["link.detector", "packed", "0.998", "bit", "2"]


def test_bench_refuses_a_part_that_is_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert _main(["bench", "toaster"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "the part must be one of sensor" in err


def test_doctor_finds_this_machine_fit(capsys: pytest.CaptureFixture[str]) -> None:
    assert _main(["doctor", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["ok"] is True
    checks = {check["name"]: check for check in document["checks"]}
    assert checks["kernel"]["found"] == "built, and agrees with the compiled form on every bit"
    assert all(check["ok"] for check in checks.values() if check["needed"])


@pytest.mark.parametrize(("needed", "code"), [(True, 1), (False, 0)])
def test_doctor_names_what_is_missing_and_the_mend(
    needed: bool, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = doctor.Check("opencl", False, "no device", "apt-get install something", needed)
    monkeypatch.setattr(doctor, "CHECKS", (lambda: missing,))
    assert _main(["doctor"]) == code
    out = capsys.readouterr().out
    assert "no device" in out and "remedy: apt-get install something" in out
    assert ("cannot work yet" in out) == needed


def test_doctor_reports_a_machine_without_opencl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cosim.compute.opencl.probe", list)
    check = doctor._opencl()
    assert not check.ok and "pocl-opencl-icd" in check.remedy


def test_doctor_finds_damaged_files_of_pocl(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path))
    program = tmp_path / "AB/CD/program.bc"
    for folder in (program.parent, tmp_path / "sums"):
        folder.mkdir(parents=True)
    program.write_bytes(b"")
    (tmp_path / "sums/one").write_text('{"folder": "AB/CD", "files": {"program.bc": [7, 1]}}')
    check = doctor._cache()
    assert not check.ok and not check.needed and not program.exists()
    assert check.state.endswith("; 1 damaged files of PoCL were in it")
    assert doctor._cache().ok


def test_doctor_reports_a_machine_without_gl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("display.probe_gl", lambda: (False, "the EGL vendor must be"))
    check = doctor._gl()
    assert not check.ok and not check.needed
    assert "libegl-mesa0" in check.remedy and "display.renderer=numpy" in check.remedy


def test_the_test_command_passes_arguments_to_pytest_and_reports_failure(
    tmp_path, capfd: pytest.CaptureFixture[str]
) -> None:  # type: ignore[no-untyped-def]
    failing = tmp_path / "test_planted.py"
    failing.write_text("def test_good():\n    pass\n\ndef test_bad():\n    assert False\n")
    assert _main(["test", "--json", str(failing)]) == 1
    out, err = capfd.readouterr()
    document = json.loads(out)
    assert (document["passed"], document["failed"], document["checks"]) == (1, 1, {"pytest": False})
    assert "failed: pytest" in err
