"""Runs with a [readout]: the host's bytes, what is lost, interruptions, the plan, and refusals."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Interrupted
from cosim.config.amounts import count
from cosim.files import open_stream, write_stream
from cosim.run.loop import run_blocks
from cosim.run.machine import Page, Run
from cosim.run.shown import SilentProgress
from cosim.spikes.viform import unpack_planes
from rtl_model.readout.stage import LOST, RAW
from scenarios.assemble.behind.readout import ReadoutStudy
from scenarios.assemble.machine import assemble_study
from scenarios.assemble.schema.loading import load
from scenarios.cli.scenario.plan import _readout

CYCLES = 70
RUN = (f"duration={CYCLES * 25} us", "image.at=[35]", "scene.at=0.5 ms")
SLOW = ("readout.rate=30 Gbit/s", "readout.buffer=20000")
Film = Callable[..., Any]


@pytest.fixture(scope="module")
def plain(film: Film, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A run whose link is as fast as the chip."""
    folder = tmp_path_factory.mktemp("readout") / "plain"
    return film("step", folder, *RUN, "readout.file=true", small=False)


class Empty:
    """A machine and a study without content."""

    def page(self, run: Run) -> Page:
        return Page("title", "subtitle", "simulated", [], [])

    def forecast(self, progress: Any) -> dict[str, Any]:
        return {"scenario": "step"}


@pytest.fixture(scope="module")
def slow(film: Film, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The same with a slower link, and what it adds to the page of the chip."""
    pages = []

    def page(machine: Any, run: Run) -> list[str]:
        pages.append(replace(machine, inner=Empty()).page(run))
        return []

    folder = tmp_path_factory.mktemp("readout") / "slow"
    result, _ = film("step", folder, *RUN, *SLOW, small=False, report=page)
    return result, folder, pages[0]


def values(result: Any) -> dict[str, Any]:
    return {k: m.value for k, m in result.metrics.items() if k.startswith("readout_")}


def test_the_host_gets_what_convert_makes_of_the_stream(plain: Any, tmp_path: Path) -> None:
    result, folder = plain
    write_stream(open_stream(folder / "stream.zarr"), tmp_path / "converted.raw")
    assert (folder / RAW).read_bytes() == (tmp_path / "converted.raw").read_bytes()
    assert result.outcome == "ok"
    whole = CYCLES * 128_000
    assert values(result) == {
        "readout_offered_bytes": whole, "readout_delivered_bytes": whole,
        "readout_lost_bytes": 0, "readout_lost_rows": 0,
        "readout_latency_median_us": pytest.approx(12.5, rel=5e-4),
        "readout_latency_max_us": 25.0, "readout_buffer_peak_bytes": 128,
        "readout_lanes": 4, "readout_lane_bps": 10.24e9, "readout_link_bps": 40_960_000_000,
    }  # fmt: skip
    assert {RAW, LOST} <= set(result.files)
    assert result.latency[0].stage == "latch to host"


def test_the_loss_that_is_counted_is_what_is_missing(plain: Any, slow: Any) -> None:
    """In the file, and as dark rows in the stream that code, display and images have."""
    result, folder, page = slow
    found, size = values(result), (folder / RAW).stat().st_size
    accepted = (20_000 * 8 * 10**12 + 30 * 10**9 * 25_000 * (CYCLES * 1000 - 1)) // (1024 * 10**12)
    assert size == found["readout_delivered_bytes"] == 128 * accepted
    assert found["readout_lost_bytes"] == CYCLES * 128_000 - size
    assert found["readout_lost_rows"] == CYCLES * 1000 - accepted
    with np.load(folder / LOST) as told:
        there = ~np.unpackbits(told["lost"], axis=1, bitorder="little").astype(bool)
    planes = [
        unpack_planes(open_stream(place / "stream.zarr").read_words(0, 3), 0, CYCLES)
        for place in (plain[1], folder)
    ]
    assert np.array_equal(planes[1], planes[0] * there[:, :, None])
    assert result.outcome == "degraded"
    assert page.files == ["figures/readout.png"]
    assert page.sections[0].startswith("<h2>From the chip to the host</h2>")
    assert (folder / "figures" / "readout.png").is_file()


class Stopping(SilentProgress):
    """Ctrl-C after the first block."""

    def advance(self, done: int) -> None:
        if done == 64:
            os.kill(os.getpid(), signal.SIGINT)


def test_an_interrupted_run_ends_as_one_without_a_break(
    film: Film, slow: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def one_by_one(*words: Any, **named: Any) -> dict[str, float]:
        """A pipeline would take all of so short a run before the first block has passed it."""
        return run_blocks(*words, **named | {"parallel": False})

    monkeypatch.setattr("cosim.run.chain.run_blocks", one_by_one)
    settings = ("step", tmp_path / "run", *RUN, *SLOW)
    with pytest.raises(Interrupted):
        film(*settings, small=False, progress=Stopping())
    assert not (tmp_path / "run" / RAW).exists()
    result, folder = film(*settings, small=False, resume=True)
    for name in (RAW, LOST):
        assert (folder / name).read_bytes() == (slow[1] / name).read_bytes()
    assert not (folder / f"{RAW}.part").exists()
    assert values(result) == values(slow[0])


def test_a_plan_says_what_the_link_must_carry() -> None:
    settings = ("duration=4 ms", "sensor.clock=20 kHz", "image.at=[40]", "readout.buffer=60000")
    name, scenario = load("step", [*settings, "readout.rate=20.48 Gbit/s"])
    study = assemble_study("plan", name, scenario, "numba")
    assert isinstance(study, ReadoutStudy)
    document = replace(study, inner=Empty()).forecast(SilentProgress())
    found = document["readout"]
    assert (document["scenario"], study.cycles) == ("step", found["cycles"]) == ("step", 80)
    assert (found["needed_bps"], found["mean_bps"]) == (21_781_782_000, 20.48e9)
    first, second = _readout(found)[:2]
    assert "the link behind must carry 21.7818 Gbit/s to lose nothing" in first
    assert second.endswith(f"none would be lost with a buffer of {count(64_064)} bytes")


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("sensor.chip=spikeone", "readout must be given with a chip of 1000 x 1000 pixels"),
        ("sensor.width=900", "not with 900 x 1000; set sensor.chip=spiketwo without sensor.width"),
        ("sensor.pixel=asynchronous", "readout must be given with a simulated chip whose"),
        ("sensor.source=serial:virtual", "readout must be given with a simulated chip whose"),
        ("sensor.clock=50 kHz", "the clock of a readout must be at most 40000 Hz, at which 1000"),
        ("readout.lanes=3", "readout.lanes must be a power of two, so that a block of 512 bits"),
        ("readout.rows=[0,1001]", "within 0 to 1000, not [0, 1001]; write [0, 1000]"),
        ("readout.columns=[5,5]", "readout.columns must be [first, stop) with first below stop"),
        ("readout.rate=1234567 bit/s", "readout.rate must be a whole number of kbit/s"),
        ("readout.rate=10 kbit/s", "and at least 1e+06 bit/s"),
        ("readout.buffer=100", "readout.buffer must be at least 128"),
        ('sensor.writes=[{"cycle":40,"window":[1,9]}]', "the windows of sensor.writes must be"),
    ],
)
def test_what_cannot_be_read_out_is_refused_in_one_line(
    refused: Callable[..., str], tmp_path: Path, setting: str, said: str
) -> None:
    words = ("--set", "readout.file=true", "--set", setting, "--out", tmp_path / "run")
    assert said in refused("run", "step", *words)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("name", ["bring-up", "ebaps-night", "playback"])
def test_other_sources_have_no_row_scan(refused: Callable[..., str], name: str) -> None:
    said = refused("run", name, "--set", "readout.file=true")
    assert said == (
        "readout must be given with a simulated chip whose pixels a clock latches, not with "
        "another source or kind of pixels; leave it out: the row scan is that of such a chip"
    )


def test_a_steered_clock_has_no_room_for_the_scan(refused: Callable[..., str]) -> None:
    said = refused("run", "light-link", "--set", "readout.file=true")
    assert said.startswith("sensor.clock_steering must be false with a [readout]: a shortened tick")


@pytest.mark.parametrize(("command", "name"), [("live", "step"), ("link capacity", "light-link")])
def test_commands_without_a_host_refuse_it(
    refused: Callable[..., str], command: str, name: str
) -> None:
    said = refused(*command.split(), name, "--set", "readout.file=true")
    assert said.startswith(f"readout must be absent for viform {command}, not given; leave it out")


CHAINS = {
    "glass": ("duration=2.5 ms", "readout.rate=38 Gbit/s"),
    "glass-over-light": ("duration=3.2 ms", "image.at=[60]", "readout.rate=38 Gbit/s"),
    "light-link": (
        "link.size=50000", "link.modem.cell=4", "link.modem.ticks=2", "link.modem.line=8b10b",
        "link.modem.parity=32", "sensor.clock_steering=false", "readout.rate=40 Gbit/s",
        "readout.buffer=50000",
    ),
}  # fmt: skip
"""Chains with something behind the host: a display, a code with its link, a receiver."""


@pytest.mark.slow
@pytest.mark.parametrize("name", CHAINS)
def test_what_stands_behind_has_what_the_host_got(film: Film, tmp_path: Path, name: str) -> None:
    """The stream, from which or beside which all else is fed, is dark in the lost rows alone, and
    its other rows are those of the file."""
    result, folder = film(name, tmp_path / "run", *CHAINS[name], small=False)
    stream, found = open_stream(folder / "stream.zarr"), values(result)
    with np.load(folder / LOST) as told:
        there = ~np.unpackbits(told["lost"], axis=1, bitorder="little").astype(bool)
    planes = unpack_planes(stream.read_words(0, stream.cycles), 0, stream.cycles)
    assert there.shape == (stream.cycles, 1000) and (~there).sum() == found["readout_lost_rows"] > 0
    assert not planes[~there].any()
    blocks = np.fromfile(folder / RAW, np.uint8).reshape(-1, 2, 64)
    bits = np.unpackbits(blocks, axis=2, bitorder="little")[..., :500].reshape(-1, 1000)
    assert np.array_equal(planes[there], bits)  # in the order of cycles and rows
    assert result.outcome == "degraded"
    if name == "glass":  # spikes that the display has shown
        shown = result.metrics["spike_rate"].value * planes.size
        assert round(shown) == planes.sum(dtype=np.int64)
