"""A chip in bands of rows over workers: the bits and the metrics of one run, what a lost worker or
an interruption repeats, and the memory of a worker."""

from __future__ import annotations

import json
import os
import re
import signal
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import zarr

import cosim.run.loop as loop
import scenarios.assemble.source.latched.bands as chain
from cosim import Block, Interrupted
from cosim.run.machine import Options
from cosim.run.progress import QuietProgress
from cosim.stage import blocks
from scenarios.assemble.schema.loading import filmed, load
from scenarios.assemble.source.latched.bands import (
    Band,
    BandedCamera,
    Strip,
    band_rows,
    expose_band,
)
from scenarios.assemble.source.latched.setup import set_up_camera
from scenarios.run import Done, run_scenario
from sensor import SpikeCamera
from sensor.latched.stages import LensStage, SceneStage

SMALL = ("sensor.width=40", "sensor.height=56", "duration=3.3 ms")
WRITES = '{"cycle":60,"threshold_level":8},{"at":"2.01 ms","window":[8,32]}'
SILICON = (*SMALL, "sensor.preset=silicon", "sensor.crosstalk=0.05", "sensor.row_skew=0.9")


def ran(name: str, sets: tuple[str, ...], folder: Path, **given: Any) -> Done:
    short, scenario = load(name, list(sets))
    return run_scenario(
        short, scenario, folder, options=Options(**given), progress=QuietProgress(),
        began=time.perf_counter(), report=lambda machine, run: [],
    )  # fmt: skip


def left(done: Done) -> tuple[Any, dict[str, Any]]:
    """The stream, and the result without what depends on the machine's speed."""
    words = zarr.open_group(done.folder / "stream.zarr", mode="r")["words"][:]
    told = json.loads((done.folder / "result.json").read_text())
    for name in ("camera", "full_physics"):
        told["metrics"].pop(name, None)
    return words, told | {"run_time_s": None, "throughput": None}


def slow(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.fixture
def tiles_of_16_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chain, "MOST", 1)


@pytest.mark.parametrize(
    ("name", "sets", "options"),
    [
        ("film", SMALL, {}),
        ("film", (*SMALL, "tolerance=0"), {"device": "numba"}),
        ("film", SILICON, {}),
        ("film", (*SILICON, "tolerance=0"), {"device": "numba"}),
        slow("film", (*SMALL, "sensor.row_jitter=0.1", "sensor.drift=0.01"), {}),
        ("film", (*SMALL, "sensor.lens.psf=airy", "sensor.lens.f_number=4"), {}),
        # a tile with full physics; most with the exact tier
        ("film", (*SMALL, "sensor.lens.white_rate=0.95", "tolerance=1e-4"), {}),
        ("film", (*SMALL, "sensor.lens.white_rate=0.95", "tolerance=1e-5"), {}),
        slow("film", (*SMALL, "sensor.colour.filter=rggb"), {}),
        ("film", (*SMALL, f"sensor.writes=[{WRITES}]", "sensor.lens.white_rate=0.2"), {}),
        slow("star", SMALL, {}),
    ],
)
@pytest.mark.usefixtures("tiles_of_16_rows")
def test_bands_have_the_bits_and_the_metrics_of_one_run(name, sets, options, tmp_path) -> None:
    one = ran(name, sets, tmp_path / "one", **options)
    banded = ran(name, sets, tmp_path / "banded", workers=1, **options)
    (words, told), (bits, same) = left(one), left(banded)
    assert words.any()
    np.testing.assert_array_equal(bits, words)
    assert same == told
    assert not (banded.folder / "bands").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("tiles_of_16_rows")
def test_a_display_shows_the_same(tmp_path) -> None:
    sets = (*SMALL, "display.renderer=numpy")
    one, banded = (
        ran("glass", sets, tmp_path / name, **given)
        for name, given in (("one", {}), ("banded", {"workers": 1}))
    )
    assert left(banded)[1] == left(one)[1]
    np.testing.assert_array_equal(left(banded)[0], left(one)[0])


def test_bands_are_whole_tiles_for_all_workers() -> None:
    assert band_rows(56, 40, 132, 1) == [(0, 56)]
    assert band_rows(56, 40, 132, 2) == [(0, 32), (32, 56)]
    assert band_rows(56, 40, 132, 99) == [(0, 16), (16, 32), (32, 48), (48, 56)]
    rows = band_rows(8000, 8000, 2560, 2)  # 20 GB of bits
    assert rows[0][0] == 0 and rows[-1][1] == 8000
    assert all(a[1] == b[0] for a, b in pairwise(rows))
    assert max(high - low for low, high in rows) * 8000 * 2560 / 8 <= chain.MOST


@pytest.mark.parametrize("kind", ["film", "star", slow("wave"), "step"])
def test_a_strip_is_the_rows_of_the_light(kind) -> None:
    sets = [f"scene.kind={kind}", *SILICON]
    setup = set_up_camera(filmed(load("film", sets)[1], "run"), None)
    clock, reach, pitch = setup.setting.clock, setup.setting.reach, setup.setting.chip.pitch
    assert reach != (0, 0)
    scene, lens = SceneStage(setup.source(), reach), LensStage(setup.lens, pitch)
    strip = Strip(setup.source(), setup.lens.relay(pitch), (15, 33), reach)
    for block in blocks(setup.cycles, 64):
        whole = lens.step(scene.step(None, block), block)
        begin = clock.edge(max(block.start - reach[0], 0))
        rows = strip.step(block, begin)
        for cycle in range(max(block.start - reach[0], 0), block.stop + reach[1]):
            start, stop = clock.edge(cycle), clock.edge(cycle + 1)
            np.testing.assert_array_equal(
                rows.integral(start, stop), whole.integral(start, stop)[15:33]
            )


@pytest.mark.usefixtures("tiles_of_16_rows")
def test_only_missing_bands_are_made_again(tmp_path, monkeypatch) -> None:
    whole = ran("film", SMALL, tmp_path / "one")
    made: list[tuple[int, int]] = []

    def stops(band: Band) -> Any:
        if len(made) == 2:
            raise KeyboardInterrupt
        made.append(band.rows)
        return expose_band(band)

    monkeypatch.setattr(chain, "expose_band", stops)
    folder = tmp_path / "banded"
    with pytest.raises(Interrupted, match="after 2 of 4 bands; go on with the same command"):
        ran("film", SMALL, folder, workers=1)
    monkeypatch.setattr(
        chain, "expose_band", lambda band: made.append(band.rows) or expose_band(band)
    )
    done = ran("film", SMALL, folder, workers=1, resume=True)
    assert made == [(0, 16), (16, 32), (32, 48), (48, 56)]
    np.testing.assert_array_equal(left(done)[0], left(whole)[0])


@pytest.mark.usefixtures("tiles_of_16_rows")
def test_a_run_that_was_interrupted_after_its_bands_has_them(tmp_path, monkeypatch) -> None:
    sets = (*SMALL[:2], "duration=24 ms")
    whole = ran("film", sets, tmp_path / "one", device="numba")
    requests, stop_requests, step = [], loop.stop_requests, BandedCamera.step

    @contextmanager
    def watched() -> Iterator[threading.Event]:
        with stop_requests() as requested:
            requests.append(requested)
            yield requested

    def interrupting(self: BandedCamera, light: Any, block: Block) -> Any:
        if block.start == 64:
            os.kill(os.getpid(), signal.SIGINT)
            requests[-1].wait()
        return step(self, light, block)

    folder, given = tmp_path / "banded", {"workers": 1, "device": "numba"}
    with monkeypatch.context() as patched:
        patched.setattr(loop, "stop_requests", watched)
        patched.setattr(BandedCamera, "step", interrupting)
        with pytest.raises(Interrupted, match="of 960 cycles; go on") as raised:
            ran("film", sets, folder, **given)
    assert 128 <= raised.value.done < 960
    assert len(list((folder / "bands").glob("*.npy"))) == 4
    monkeypatch.setattr(chain, "expose_band", None)  # none is made again
    done = ran("film", sets, folder, resume=True, **given)
    np.testing.assert_array_equal(left(done)[0], left(whole)[0])
    assert not (folder / "bands").exists()


@pytest.mark.slow
def test_the_band_of_a_lost_worker_is_made_again(tmp_path, monkeypatch) -> None:
    """Two processes, of which one is killed after the first band."""
    monkeypatch.setattr(chain, "MOST", 1)
    sets = ("sensor.width=160", "sensor.height=160", "duration=8 ms")
    one, killed = ran("film", sets, tmp_path / "one"), []

    def kill() -> None:
        bands = tmp_path / "banded" / "bands"
        while not list(bands.glob("*.npy")):
            time.sleep(0.02)
        for child in psutil.Process().children(recursive=True):
            if "cosim.run.processes" in " ".join(child.cmdline()) and not killed:
                child.kill()
                killed.append(child.pid)

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    banded = ran("film", sets, tmp_path / "banded", workers=2)
    thread.join(5)
    (words, told), (bits, same) = left(one), left(banded)
    assert killed
    np.testing.assert_array_equal(bits, words)
    assert same == told


def test_the_memory_of_a_worker_is_that_of_its_band() -> None:
    """An eighth of the rows, of a scene that has a new plane in every block; with it, what the
    scene takes to draw a plane, as far as it draws whole ones."""
    sets = ["scene.kind=star", "sensor.width=320", "sensor.height=256", "duration=6.4 ms"]
    setup = set_up_camera(filmed(load("film", sets)[1], "run"), None)

    def peak(rows: tuple[int, int]) -> int:
        band = Band(rows, setup, setup.setting, "exact", None, "numba")
        expose_band(replace(band, rows=(rows[0], rows[0] + 1)))  # compiles, and fills caches
        return traced(lambda: expose_band(band))

    def draw() -> None:
        strip = Strip(setup.source(), setup.lens.relay(20.0), (0, 1), setup.setting.reach)
        for block in blocks(setup.cycles, 64):
            strip.step(block, setup.setting.clock.edge(block.start))

    whole, eighth = peak((0, 256)), peak((96, 128))
    drawn = traced(draw)
    assert drawn < whole / 2
    assert eighth < whole / 8 + 1.1 * drawn


def traced(work: Callable[[], Any]) -> int:
    """Most bytes in use while it works."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("rows", [(0, 16), (20, 37), (55, 56)])
def test_a_band_is_a_part_of_the_chip(rows) -> None:
    """Also where it begins within a tile, with cross-talk across its edges."""
    setup = set_up_camera(filmed(load("film", [*SILICON])[1], "run"), None)
    camera = SpikeCamera(setup.setting, None)
    stages = setup.stages(setup.source())
    parts = []
    for block in blocks(setup.cycles, 64):
        light = None
        for stage in stages.values():
            light = stage.step(light, block)
        parts.append(camera.step(light, Block(block.start, block.cycles)).words)
    made = expose_band(Band(rows, setup, setup.setting, "exact", None, "numba"))
    np.testing.assert_array_equal(made, np.concatenate(parts)[:, rows[0] : rows[1]])


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("film", "--workers", "0"), "--workers must be 1 to 1024"),
        (("light-link", "--workers", "2"), "given with a latched spike camera"),
        (("film", "--set", "sensor.pixel=asynchronous", "--workers", "2"), "latched"),
        (("film", "--set", "sensor.sub_threshold.limit=5 ms", "--workers", "2"), "sub_threshold"),
        (("glass-over-light", "--workers", "2"), r"given without a \[link\]"),
    ],
)
def test_what_cannot_be_split_is_one_line(given, says, refused, tmp_path) -> None:
    assert re.search(says, refused("run", *given, "--out", tmp_path / "r"))
    assert not (tmp_path / "r").exists()


def test_a_scheduler_that_does_not_answer_is_one_line(refused, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("cosim.run.workers._SECONDS", 1)
    sets = [f"--set={text}" for text in SMALL]
    given = [*sets, "--scheduler", "tcp://127.0.0.1:9", "--out", tmp_path / "r"]
    assert "--scheduler must be the address of a Dask scheduler that answers" in refused(
        "run", "film", *given
    )
