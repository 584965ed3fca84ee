"""Sweeps: their axes, what resuming repeats, workers that are lost, and the labelled store."""

from __future__ import annotations

import errno
import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import zarr

import scenarios.studies.sweep.sweep as sweeping
from cosim import InputError, Interrupted
from cosim.run.progress import QuietProgress
from scenarios.cli.entry import _main
from scenarios.studies.batch.axes import Axis, grid, latin_hypercube
from scenarios.studies.sweep import Sweep, read_axis, run_sweep

SMALL = ("sensor.width=32", "sensor.height=16", "duration=2 ms")
THRESHOLDS = "sensor.threshold=500 e:2000 e:3log"


def small(*axes: str, **options: Any) -> Sweep:
    return Sweep("film", tuple(map(read_axis, axes)), SMALL, tolerance=1e-2, **options)


def test_a_pipe_is_not_read_by_several_points(tmp_path: Path) -> None:
    """The first point would take all that comes."""
    axes = (read_axis("sensor.white_rate=0.4,0.6"),)
    with pytest.raises(InputError, match=r"a file for viform sweep.*, not pipe:-; write"):
        swept(Sweep("playback", axes, ("sensor.source=pipe:-",)), tmp_path / "sweep")
    assert not (tmp_path / "sweep").exists()


def swept(sweep: Sweep, folder: Path, workers: int = 1, resume: bool = False) -> dict[str, Any]:
    return run_sweep(
        sweep, folder, device=None, workers=workers, scheduler=None, resume=resume,
        progress=QuietProgress(),
    )  # fmt: skip


def lasting(row: dict[str, Any]) -> dict[str, Any]:
    """A result without what depends on the machine's speed."""
    metrics = {k: v for k, v in row["metrics"].items() if k not in ("camera", "full_physics")}
    return row | {"metrics": metrics, "run_time_s": None, "throughput": None}


def results(document: dict[str, Any]) -> list[dict[str, Any]]:
    return [lasting(row["result"]) for row in document["rows"]]


def test_values_and_ranges() -> None:
    assert read_axis("a.b=1 e, 2 e").texts == ("1 e", "2 e")
    assert read_axis("a.b=hard,residual").numbers is None
    assert read_axis("a.b=0:10:3").texts == ("0", "5", "10")
    assert read_axis("a.b=1:100 lux:3log").texts == ("1 lux", "10 lux", "100 lux")
    assert read_axis("a.b=2:4 ms").span == (2.0, 4.0)
    assert [read_axis("a=3:5:int").at(x) for x in (0, 0.3, 0.34, 0.99, 1)] == [*"33455"]
    assert read_axis("a.b=1:100:log").log and read_axis("a=-1.5e3:2:2").numbers == [-1500.0, 2.0]
    lists = read_axis('a=[1,2],[{"cycle":3,"window":[0,8]},{"x":"],["}],[]')
    assert lists.texts == ("[1,2]", '[{"cycle":3,"window":[0,8]},{"x":"],["}]', "[]")
    assert lists.numbers is None
    assert read_axis("sensor.source=file:a.dat,file:b.dat").texts == ("file:a.dat", "file:b.dat")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("sensor.width", "--vary must be KEY=a,b,c"), ("=5", "--vary must be KEY"),
        ("a=1,,2", "different values"), ("a=1,1", "different values"),
        ("a=3:1:5", "from a lower to a higher"), ("a=0:1:5log", "above 0, and from a lower"),
        ("a=0:1.5:int", "from a whole number"),
        ("a=1:2:1", "2 to 100000 values"), ("a=1:2:x", "end it with a number of values"),
        ("a=1 e:2 lux:3", "a range in one unit"),
    ],
)  # fmt: skip
def test_other_texts_are_one_line(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_axis(text)


def test_a_hypercube_has_one_point_in_each_part_of_each_range() -> None:
    axes = [read_axis("a=0:8"), read_axis("b=1:256 e:log"), read_axis("c=x,y")]
    points = latin_hypercube(axes, 8, 5)
    assert sorted(int(float(a)) for a, _, _ in points) == list(range(8))
    assert sorted(int(np.log2(float(b.split()[0]))) for _, b, _ in points) == list(range(8))
    assert [c for _, _, c in points].count("x") == 4
    assert points == latin_hypercube(axes, 8, 5) != latin_hypercube(axes, 8, 6)
    with pytest.raises(InputError, match="given with a number of values, or --samples"):
        grid(axes)
    with pytest.raises(InputError, match="--samples must be 1 to"):
        latin_hypercube(axes, 0, 1)
    with pytest.raises(InputError, match="at most 100000 combinations"):
        grid([Axis(str(n), tuple(map(str, range(400)))) for n in range(2)])


def test_the_store_is_labelled_and_has_the_results(tmp_path: Path) -> None:
    document = swept(small(THRESHOLDS, "sensor.reset=hard,residual"), tmp_path / "s")
    store = zarr.open_group(tmp_path / "s" / "sweep.zarr", mode="r")
    assert store["sensor.threshold"][:].tolist() == [500, 1000, 2000]
    assert store["sensor.threshold"].attrs["units"] == "e"
    assert store["sensor.reset"][:].tolist() == ["hard", "residual"]
    rate = store["spike_rate"]
    assert rate.metadata.dimension_names == ("sensor.threshold", "sensor.reset")
    for n, row in enumerate(document["rows"]):
        assert rate[:].ravel()[n] == row["result"]["metrics"]["spike_rate"]["value"]
    assert document["rows"][1]["values"] == ["500 e", "residual"]
    assert (tmp_path / "s" / "sweep.png").stat().st_size > 5000


def test_only_what_is_missing_is_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sweep, folder = small(THRESHOLDS), tmp_path / "s"
    whole = swept(sweep, tmp_path / "whole")
    real, ran = sweeping.run_jobs, []

    def stops(*arguments: Any) -> Any:
        for n, result in enumerate(real(*arguments)):
            if n == 2:
                raise KeyboardInterrupt
            ran.append(result[0])
            yield result

    monkeypatch.setattr(sweeping, "run_jobs", stops)
    with pytest.raises(Interrupted, match="after 2 of 3 points; go on with the same command"):
        swept(sweep, folder)
    with pytest.raises(InputError, match=r"--resume must be the sweep that .* holds, not another"):
        swept(small("sensor.threshold=500 e,600 e"), folder, resume=True)
    assert results(swept(sweep, folder, resume=True)) == results(whole)
    assert ran == [0, 1, 2]


def test_a_sweep_does_not_go_on_with_another_clip(
    tmp_path: Path, make_clip: Callable[..., Path]
) -> None:
    frames = np.random.default_rng(1).integers(0, 256, (4, 40, 56), dtype=np.uint8)
    clip = make_clip(tmp_path / "clip.mkv", frames, rate=1000)
    sweep = Sweep(
        "film", (read_axis("sensor.threshold=500 e,600 e"),), (*SMALL, f"scene.path={clip}"),
        tolerance=1e-2,
    )  # fmt: skip
    swept(sweep, tmp_path / "s")
    swept(sweep, tmp_path / "s", resume=True)
    make_clip(clip, frames[::-1], rate=1000)
    with pytest.raises(InputError, match=r"--resume must be the sweep that .* holds, not another"):
        swept(sweep, tmp_path / "s", resume=True)


def test_an_interrupt_within_a_point_says_how_the_sweep_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stops(*arguments: Any) -> Any:
        raise Interrupted(32, 80, "go on with the run", "cycles")

    monkeypatch.setattr(sweeping, "run_point", stops)
    with pytest.raises(Interrupted, match=r"after 0 of 3 points; go on with .*--resume"):
        swept(small(THRESHOLDS), tmp_path / "s")


def test_a_full_disk_is_no_fault_of_a_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fills(*arguments: Any) -> Any:
        full = OSError(errno.ENOSPC, "No space left on device", "run")
        raise InputError("--out", "where there is room", "a full disk", "make room") from full

    monkeypatch.setattr(sweeping, "run_point", fills)
    with pytest.raises(InputError, match=rf"room for the results, not {tmp_path / 's'} \(No space"):
        swept(small(THRESHOLDS), tmp_path / "s")


@pytest.mark.slow
def test_a_sweep_of_40_points_with_a_lost_worker_is_the_serial_one(tmp_path: Path) -> None:
    """Two workers, of which one is killed in the middle: the same documents, and the same store but
    for what depends on the machine's speed."""
    sweep = small("sensor.threshold=500 e:2000 e:10", "scene.illuminance=400 lux:700 lux:4")
    assert len(sweep.points()) == 40
    serial, killed = swept(sweep, tmp_path / "serial"), []

    def kill() -> None:
        points = tmp_path / "dask" / "points"
        while not (points.is_dir() and len(list(points.glob("*.json"))) >= 20):
            time.sleep(0.02)
        for child in psutil.Process().children(recursive=True):
            if "cosim.run.processes" in " ".join(child.cmdline()) and not killed:
                child.kill()
                killed.append(child.pid)

    threading.Thread(target=kill, daemon=True).start()
    parallel = swept(sweep, tmp_path / "dask", workers=2)
    assert killed and results(parallel) == results(serial)
    one, two = (zarr.open_group(tmp_path / n / "sweep.zarr", mode="r") for n in ("serial", "dask"))
    assert sorted(one) == sorted(two)
    for name in sorted(set(one) - {"run_time_s", "camera", "full_physics"}):
        np.testing.assert_array_equal(one[name][:], two[name][:])
        assert dict(one[name].attrs) == dict(two[name].attrs)


def test_bad_input_is_one_line_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "s")
    for arguments, says in {
        ("--vary", "sensor.widht=1,2"): "sensor.widht",
        (): "--vary must be given once or more",
        ("--vary", "sensor.width=32,64", "--vary", "sensor.width=1,2"): "a key once",
        ("--vary", "sensor.width=32,64", "--set", "sensor.width=8"): "a key that does not vary",
        ("--vary", "sensor.width=32,64", "--workers", "0"): "--workers must be 1 to 1024",
        ("--vary", "sensor.width=32,64", "--resume"): "--resume must be given with --out",
    }.items():
        place = [] if "--resume" in arguments else ["--out", out]
        assert _main(["sweep", "film", *arguments, *place]) == 2
        assert says in capsys.readouterr().err
    assert not Path(out).exists()


def test_what_cannot_run_is_one_line_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosim.run.workers._SECONDS", 1)
    given = ["sweep", "film", "--vary", "sensor.threshold=500 e,600 e", "--tolerance", "1e-2"]
    given += [f"--set={text}" for text in SMALL] + ["--out", str(tmp_path / "s")]
    assert _main([*given, "--scheduler", "tcp://127.0.0.1:9"]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert "--scheduler must be the address of a Dask scheduler that answers" in said[-1]
    assert "tcp://127.0.0.1:9 (no answer within" in said[-1]
    assert not (tmp_path / "s").exists()
    assert _main([*given, "--metric", "nothing"]) == 2
    assert "--metric must be one of" in capsys.readouterr().err
    assert _main([*given, "--workers", "1", "--metric", "error", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["rows"]) == 2
    (tmp_path / "s" / "sweep.json").write_text("{")
    assert _main([*given, "--resume"]) == 2
    assert "sweep.json must be the file that the sweep wrote" in capsys.readouterr().err
