"""The parts of `viform bench`: their rows as programs read them, and that each way does what it is
timed for."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import scenarios.studies.bench.core as core
import scenarios.studies.bench.display
import scenarios.studies.bench.display as loop
import scenarios.studies.bench.modem as modem
import scenarios.studies.bench.sensor
import scenarios.studies.bench.view as bench
from cosim.compute.opencl import Device
from cosim.errors import Interrupted
from cosim.files.zarr_store import ZarrStream
from cosim.run.chain import BlockChain
from cosim.run.timing import BRIGHT, DARK, least_of
from cosim.spikes.viform import WORD
from display import probe_gl
from rtl_model.bringup.stages.ethernet import Rates
from scenarios.cli.entry import _main
from scenarios.studies.bench import board
from scenarios.studies.bench.core import plain_send, send_rows
from scenarios.studies.bench.display import KINDS, _words
from sensor import CHIPS
from tests.scenarios.studies.bench.small import make_bench_small


def test_the_rows_are_payload_beside_that_of_sockets_alone(monkeypatch):
    monkeypatch.setattr(board, "SECONDS", 0.1)
    rows = board.board_rows(None, None)
    assert [row.name for row in rows] == ["board.read", "board.write"]
    for row in rows:
        assert row.unit == "bit/s" and row.value > 0 and row.plain_ratio is None
        assert row.realtime == pytest.approx(row.value / 100e6)
        assert row.ceiling_ratio > 0


def test_a_wrong_word_is_no_throughput(monkeypatch):
    monkeypatch.setattr(board, "measured_rates", lambda *_: Rates(1.0, 1.0, 1, 1, wrong=3))
    with pytest.raises(RuntimeError, match="3 packets with wrong words"):
        board.board_rows(None, None)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Small clips; what the timed ways make, in their order."""
    make_bench_small(monkeypatch, "core")
    made: list[Any] = []

    def spy(calls: list[Callable[[], Any]], repeats: int = 1) -> list[float]:
        made.extend(call() for call in calls)
        return least_of(calls, 1)

    monkeypatch.setattr(core, "least_of", spy)
    return made


def test_bench_core_prints_the_documented_rows(made: list[Any], viform: Callable[..., Any]) -> None:
    answer = viform("bench", "core", "--json")
    assert answer.code == 0, answer.err
    rows = json.loads(answer.out)["rows"]
    assert [(row["name"], row["tier"]) for row in rows] == [
        ("core.film", "planned"), ("core.film", "fast"), ("core.film", "exact"),
        ("core.push", "fast"), ("core.show", "exact"), ("core.film-large", "fast"),
    ]  # fmt: skip
    for row in rows:
        assert row["unit"] == "pixel-cycles/s" and row["value"] > 0
        assert (row["plain_ratio"] is None) == (row["name"] == "core.push")
        assert row["realtime"] > 0 and row["ceiling_ratio"] > 0
    plain, *films, seen, integrated = made[:6]
    for spikes in films:
        assert spikes.cycles == len(plain)
        assert abs(spikes.rate() - plain.mean(axis=0)).mean() < 0.06
    assert seen.shape == integrated.shape and 0.2 < integrated.mean() < 1
    # The drive holds the light until the next spike; numpy takes each spike as a packet.
    np.testing.assert_allclose(seen.mean(axis=(1, 2)), integrated.mean(axis=(1, 2)), rtol=0.1)


def test_the_plain_way_sends_bytes() -> None:
    data = bytes(range(256)) * 9
    for camera in ((250, 250), (100, 120)):
        assert plain_send(data, 6, (240, 240), camera, 4) == data
    one_short = plain_send(data, 6, (240, 240), (50, 250), 4)  # rows between the cells
    assert one_short != data


@pytest.mark.slow
def test_rows_of_a_link(device: Device) -> None:
    keys = {
        "panel.width": 160, "panel.height": 160, "modem.cell": 2, "modem.ticks": 2,
        "modem.rate": 0.75, "sensor.chip": "spikeone", "sensor.width": 200, "sensor.height": 200,
    }  # fmt: skip
    setup, first, later = send_rows(device, 200, **keys)
    assert setup.name == "core.send-setup" and setup.unit == "s" and setup.value > 0
    for row, which in ((first, "first call"), (later, "later calls")):
        assert row.name == "core.send" and row.unit == "bit/s" and row.tier == f"fast, {which}"
        assert row.value > 0 and row.plain_ratio is not None and row.realtime is not None
    assert later.value > first.value


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """128 planes of a small panel, each way once."""
    there, said = probe_gl()
    if not there:
        pytest.skip(f"needs GL through EGL: {said}")
    make_bench_small(monkeypatch, "display")


@pytest.mark.usefixtures("small")
def test_bench_display_prints_the_documented_rows(viform: Callable[..., Any]) -> None:
    answer = viform("bench", "display", "--json")
    assert answer.code == 0, answer.err
    document = json.loads(answer.out)
    assert list(document) == ["device", "ceiling", "rows"]
    chip = CHIPS["spikeone"]
    for row, kind in zip(document["rows"], KINDS, strict=True):
        assert (row["name"], row["tier"], row["unit"]) == (f"display.{kind}", "exact", "planes/s")
        assert row["value"] > 0 and row["plain_ratio"] > 0
        assert row["realtime"] == pytest.approx(row["value"] / 40e3)
        per_pixel = row["value"] * chip.width * chip.height
        assert row["ceiling_ratio"] == pytest.approx(per_pixel / document["ceiling"]["value"])


@pytest.mark.usefixtures("small")
def test_what_is_timed_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    # A renderer that does nothing would be fast: look at the image of each way.
    seen = []

    def spy(calls: list[Callable[[], Any]], repeats: int) -> list[float]:
        seen.extend(call() for call in calls)
        return least_of(calls, repeats)

    monkeypatch.setattr(scenarios.studies.bench.display, "least_of", spy)
    chip = CHIPS["spikeone"]
    shape = chip.height, chip.width
    words = _words(128, shape)
    rate = np.bitwise_count(words).sum(axis=0) / 128
    for kind in KINDS:
        scenarios.studies.bench.display._planes_a_second(kind, words, shape)
        ours, plain = seen[-2:]
        assert plain.max() > 0
        expected = rate / BRIGHT
        if kind == "pursuit":  # 0.1 pixel a plane, over rows alike: only the sides turn dark
            ours, expected = ours[:, 16:-16], expected[:, 16:-16]
        if kind in ("hold", "causal"):  # dark until the second spike
            assert 0.5 < ours.mean() / expected.mean() < 1.1
        else:
            assert abs(ours.mean() / expected.mean() - 1) < 0.05


def test_the_stream_spikes_at_the_rates_of_the_picture() -> None:
    words = _words(320, (20, 30))
    rate = np.bitwise_count(words).sum(axis=0) / 320
    asked = np.linspace(DARK, BRIGHT, 600).reshape(20, 30)
    assert len(words) == 320 // WORD and np.abs(rate - asked).max() <= 1.001 / 320


def test_without_gl_nothing_is_measured_and_one_line_says_so(
    monkeypatch: pytest.MonkeyPatch, refused: Callable[..., str]
) -> None:
    monkeypatch.setattr(
        scenarios.studies.bench.sensor, "probe_gl", lambda: (False, "the EGL vendor must be")
    )
    monkeypatch.setattr(
        scenarios.studies.bench.sensor, "_ceiling", lambda *a: pytest.fail("measured")
    )
    for arguments in (("bench",), ("bench", "display")):
        line = refused(*arguments)
        assert "GL through EGL" in line and "libegl-mesa0" in line and "bench sensor" in line


@pytest.fixture
def link_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """A small panel before a small camera, and few words."""
    make_bench_small(monkeypatch, "link")


@pytest.mark.slow
@pytest.mark.usefixtures("link_small")
def test_bench_link_prints_the_documented_rows(viform: Callable[..., Any]) -> None:
    answer = viform("bench", "link", "--json")
    assert answer.code == 0, answer.err
    rows = json.loads(answer.out)["rows"]
    assert [row["name"] for row in rows] == (
        ["link.modem"] * 4 + ["link.acquisition"] * 2 + ["link.detector"] * 6 + ["link.ldpc"] * 8
        + ["link.reed-solomon"] * 8
    )  # fmt: skip
    kinds = "receive", "receive, a core", "receive with acquisition", "send"
    for row, what in zip(rows, kinds, strict=False):
        assert row["tier"].rpartition(",")[0] == what and row["tier"].endswith(" cells")
        assert row["unit"] == "bit/s" and min(row["value"], row["realtime"]) > 0
    assert rows[0]["plain_ratio"] > 1 and rows[0]["value"] > rows[2]["value"]
    assert all(row["unit"] == "s" and row["value"] > 0 for row in rows[4:6])
    joint, packed = rows[6:8]
    assert (joint["tier"], joint["plain_ratio"], packed["tier"]) == ("joint", 1, "packed")
    assert joint["unit"] == packed["unit"] == "ns/cell-symbol"
    assert packed["plain_ratio"] > 1
    for joint, packed in (rows[8:10], rows[10:12]):
        assert joint["unit"] == packed["unit"] == "bit"
        assert joint["tier"].removeprefix("joint") == packed["tier"].removeprefix("packed")
        assert packed["value"] > joint["value"] - 0.002
    codes = rows[12:]
    for row in codes:
        assert row["unit"] == "bit/s" and min(row["value"], row["realtime"]) > 0
    assert [row["tier"] for row in codes[::2]] == [
        "encode", "decode, rate 0.917", "decode, rate 0.880", "decode, rate 0.815", "encode",
        *(f"decode, {wrong} of 255 bytes wrong" for wrong in (0, 4, 16)),
    ]  # fmt: skip
    assert all(row["tier"].endswith(", a core") for row in codes[1::2])


@pytest.mark.usefixtures("link_small")
def test_what_is_timed_is_received_and_a_lost_file_ends_the_benchmark() -> None:
    filmed = modem.film_link(None)
    assert min(modem.receive(filmed, None)) > 0
    filmed.words[2:] = 0  # dark from tick 64 on
    with pytest.raises(RuntimeError, match="did not arrive"):
        modem.receive(filmed, None)


@pytest.fixture
def loop_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small chips; the timed runs are as short as the first."""
    make_bench_small(monkeypatch, "loop", "sensor")


def rows(viform: Callable[..., Any]) -> list[dict[str, Any]]:
    answer = viform("bench", "loop", "--json")
    assert answer.code == 0, answer.err
    found: list[dict[str, Any]] = json.loads(answer.out)["rows"]
    chains = [row["name"] for row in found if row["tier"] == "chain"]
    assert chains == list(loop.LOOPS)
    for row in found:
        assert row["value"] > 0 and row["ceiling_ratio"] is None
        assert (row["plain_ratio"] is None) == (row["tier"] != "chain")
        assert ("share" in row) == (row["tier"] == "stage")
        if row["name"].endswith(".processor"):
            assert row["unit"] == "s" and row["realtime"] is None
        else:
            assert row["unit"] == "planes/s"
            assert row["realtime"] == pytest.approx(row["value"] / 40e3)
    for name in chains:
        shares = [row["share"] for row in found if row["tier"] == "stage" and _of(row, name)]
        assert sum(shares) == pytest.approx(1)
    return found


def _of(row: dict[str, Any], chain: str) -> bool:
    return str(row["name"]).startswith(f"{chain}.")


@pytest.mark.slow
@pytest.mark.usefixtures("loop_small")
def test_bench_loop_prints_the_documented_rows(viform: Callable[..., Any]) -> None:
    stages = {row["name"] for row in rows(viform)}
    assert {"loop.glass.sensor", "loop.glass.display"} <= stages
    assert {"loop.glass-over-light.code", "loop.glass-over-light.receiver"} <= stages


@pytest.mark.usefixtures("loop_small")
def test_every_run_of_bench_loop_is_one_that_its_scenario_allows(
    viform: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    glass = {"loop.glass": loop.LOOPS["loop.glass"]}  # the clock of the other locks for seconds
    monkeypatch.setattr(loop, "LOOPS", glass)
    monkeypatch.setattr(BlockChain, "run", lambda *_: {"sensor": 0.5, "display": 1.5})
    stages = {row["name"]: row for row in rows(viform) if row["tier"] == "stage"}
    assert stages["loop.glass.sensor"]["value"] == 80 / 0.5  # cycles a second
    assert stages["loop.glass.sensor"]["share"] == 0.25


@pytest.mark.usefixtures("loop_small")
def test_an_interruption_names_no_folder_that_is_gone(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*_: object) -> None:
        raise Interrupted(3, 80, "go on with --out /tmp/gone --resume")

    monkeypatch.setattr(BlockChain, "run", stop)
    assert _main(["bench", "loop"]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "viform: interrupted"


SHAPE, CYCLES = (30, 40), 4_000


@pytest.fixture
def stream(tmp_path: Path) -> Path:
    bench.write_stream(tmp_path / "a.zarr", SHAPE, CYCLES)
    return tmp_path / "a.zarr"


def test_the_stream_has_the_rates_it_states(stream: Path) -> None:
    """The drawn blocks hold 30 x 512 Bernoulli draws a column: within five standard errors."""
    read = ZarrStream(stream)
    assert read.cycles == CYCLES and read.shape == SHAPE
    words = read.read_words(0, 16)
    found = np.bitwise_count(words).sum(axis=(0, 1)) / (16 * 32 * SHAPE[0])
    rates = np.rint(np.linspace(DARK, BRIGHT, SHAPE[1]) * 256) / 256
    error = np.sqrt(rates * (1 - rates) / (16 * 32 * SHAPE[0]))
    assert (np.abs(found - rates) < 5 * error).all()


def test_rows_are_measured_by_asking_the_command(stream: Path, monkeypatch) -> None:
    monkeypatch.setattr(bench, "_STEPS", 3)
    monkeypatch.setattr(bench, "_PAUSE_S", 0.0)
    found = bench._measure(stream, CYCLES)
    kinds = [f"{what}-{method}" for method in ("tfp", "tfi") for what in ("step", "chunk", "jump")]
    assert list(found) == ["start", "first-picture", *kinds, "memory"]
    assert min(found.values()) > 0
    assert found["memory"] > 20e6  # an interpreter with numpy


def test_a_refused_request_is_not_a_measurement(stream: Path) -> None:
    with bench._viewing(stream) as viewer:
        while b"data-kind='stream'" not in viewer.ask("")[1]:
            pass
        with pytest.raises(RuntimeError, match="answers 400: at must be"):
            viewer.picture(CYCLES)
