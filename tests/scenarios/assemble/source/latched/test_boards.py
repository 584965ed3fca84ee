"""A board in a scenario: it makes the spikes or takes the planes, else one line says why not."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim import Block, Clock, Light, Piece
from cosim.files import open_stream
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from cosim.spikes.viform import count_spikes
from link.sending import Transmission
from link.setup.setup import set_up_link
from rtl_model.cycle import Settings, planes
from rtl_model.geometry import Geometry
from rtl_model.stand_in import open_board
from rtl_model.virtual import VirtualBoard
from rtl_model.virtual.ethernet import EthernetBoard
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.latched.boards import BoardCamera
from scenarios.assemble.source.link import open_loop
from scenarios.report import write_report
from scenarios.run import run_scenario
from sensor import CHIPS, CameraSetting
from tests.rtl_model.stand_in.counted import counted_uploads

STEP = ("run", "step", "--set", "sensor.source=serial:virtual")
SIDE = 32


def test_light_that_ramps_reaches_the_board_tick_by_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Light that rises for 3 ticks and then stands: rates to half an electron, four uploads, and
    the spikes of a plain run of those steps."""
    setting = CameraSetting(replace(CHIPS["spiketwo"], width=8, height=4), Clock(40_000), 1000.0, 1)
    lux = 0.5 / setting.rate(1.0)  # half a spike a tick
    low, high = (np.full((4, 8), np.float32(x * lux)) for x in (0.1, 1.0))
    edge = Clock(40_000).edge
    light = Light((Piece(0, edge(3), low, high), Piece(edge(3), edge(8), high, high)))
    with open_board("serial:virtual", "sensor.source", Geometry(rows=4, columns=8)) as place:
        uploads = counted_uploads(monkeypatch)
        camera = BoardCamera(place, setting, 0.5, 8)
        made = camera.step(light, Block(0, 8))
    q, middles = 255, [0.1 + 0.9 * (k + 0.5) / 3 for k in range(3)]
    steps = [round(0.5 * m * q) for m in middles] + [round(0.5 * q)] * 5
    charge = np.zeros((4, 8), np.int64)
    size, settings = Geometry(rows=4, columns=8), Settings(threshold=0)
    truth = [planes(size, settings, np.full((4, 8), s), 1, charge) for s in steps]
    np.testing.assert_array_equal(made.planes().astype(bool), np.concatenate(truth))
    assert (len(uploads), camera.sensor.wrong_bits) == (4, 0)
    assert 0 < camera.worst <= 0.5 / q


@pytest.fixture(params=["serial", "udp"])
def address(request) -> Iterator[str]:
    """A virtual board, of the run itself or over UDP."""
    if request.param == "serial":
        yield "serial:virtual"
        return
    with EthernetBoard("udp:127.0.0.1:0", level="model") as board:
        yield board.port


def test_a_run_with_a_board_at_both_ends(address: str, tmp_path: Path) -> None:
    """Eight bars: each fires at its own rate to the electron, and the sink has shown them all."""
    name, scenario = load(
        "step",
        [
            f"sensor.source={address}", "display.sink=serial:virtual", "duration=1.1 ms",
            "image.at=[22]",
        ],
    )  # fmt: skip
    done = run_scenario(
        name, scenario, tmp_path / "run", options=Options("numba"), progress=SilentProgress(),
        began=time.perf_counter(), report=lambda machine, run: [],
    )  # fmt: skip
    result, folder = done.result, done.folder
    metric = {key: each.value for key, each in result.metrics.items()}
    found = [metric[n] for n in ("board_bits_wrong", "sink_crc_wrong", "sink_planes")]
    assert found == [0, 0, 44]
    assert 0 < metric["board_quantisation"] <= 0.5 / 255
    assert (result.error.value, result.kept, result.left_out) == (None, [], [])
    stream = open_stream(folder)
    assert (stream.shape, stream.cycles) == ((SIDE, SIDE), 44)
    counts = count_spikes(stream, 0, 44)
    before = scenario.scene.before
    wanted = 0.6 * before * (np.arange(SIDE) * 8 // SIDE + 1) / 8  # white fires at 0.6 a cycle
    np.testing.assert_array_equal(counts, np.broadcast_to(counts[0], counts.shape))
    assert np.abs(counts[0] - 44 * wanted).max() <= 1 + 44 * 0.5 / 255


def test_the_report_of_a_board_names_it_and_the_comparison(tmp_path: Path) -> None:
    sets = [key for key in STEP[2:] if key != "--set"]
    name, scenario = load("step", [*sets, "duration=3 ms", "scene.at=1 ms"])
    done = run_scenario(
        name, scenario, tmp_path / "run", options=Options("numba"), progress=SilentProgress(),
        began=time.perf_counter(), report=write_report,
    )  # fmt: skip
    page = re.sub("<[^>]*>", "", (done.folder / "report.html").read_text())  # terms are marked
    assert "a test board, 40 kHz, 120 cycles" in page
    assert "compared with the cycle model bit by bit. Bits that differ: 0." in page


@pytest.mark.parametrize(
    ("more", "must"),
    [
        (("sensor.crosstalk=0.1",), "sensor.crosstalk must be absent with sensor.source"),
        (("sensor.source=usb",), "sensor.source must be serial:PORT"),
        (("sensor.source=serial:/dev/none",), "no serial port answers to /dev/none"),
        (("sensor.source=udp:127.0.0.1:9",), "must be the address of a board that answers"),
        (("duration=30 s",), "duration must be at most 1048576 cycles"),
        (("display.sink=serial:virtual", "sensor.source=serial:"), "sensor.source must be serial:"),
        (("sensor.pixel=asynchronous",), "absent unless sensor.pixel = latched"),
    ],
)
def test_what_a_board_cannot_do_is_one_line(refused, tmp_path, more, must) -> None:
    sets = [word for key in more for word in ("--set", key)]
    assert must in refused(*STEP, *sets, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_stream_that_the_sink_does_not_hold_is_refused(refused, tmp_path) -> None:
    said = refused(
        "run", "step", "--set", "sensor.chip=spikeone", "--set", "display.sink=serial:virtual",
        "--out", tmp_path / "run",
    )  # fmt: skip
    assert "of 32 x 32 pixels, the size of the virtual board, not of 400 x 250" in said


@pytest.mark.parametrize("command", ["plan", "accuracy"])
def test_only_a_run_has_a_board(refused, command) -> None:
    said = refused(command, "step", "--set", "sensor.source=serial:virtual")
    assert "sensor.source must be absent except for viform run" in said


def test_a_link_has_no_board_for_its_sensor(refused) -> None:
    said = refused("run", "light-link", "--set", "sensor.source=serial:virtual")
    assert "sensor.source must be absent in a link" in said


LINK = (
    "sensor.chip=spikeone", "link.panel.width=128", "link.panel.height=128", "link.size=1",
    "link.modem.cell=2", "link.modem.ticks=2", "link.modem.line=8b10b", "link.modem.parity=32",
    "link.loop=serial:virtual",
)  # fmt: skip


class FourPlanes:
    """The first planes of a transmission, as a whole one."""

    planes = 4

    def __init__(self, sent: Transmission) -> None:
        self.words = sent.words


def test_a_links_planes_come_back_bit_for_bit() -> None:
    _, scenario = load("light-link", LINK)
    sent = set_up_link(scenario, camera_setting(scenario), "numba", SilentProgress()).sent
    loop = open_loop(scenario)
    assert loop is not None
    with closing(loop):
        loop.send(FourPlanes(sent), SilentProgress())  # type: ignore[arg-type]
        metric = {name: each.value for name, each in loop.metrics().items()}
        assert (metric, loop.fault) == ({"loop_planes": 4, "loop_bits_wrong": 0}, None)


def test_a_board_of_another_size_does_not_hold_the_panel(refused, tmp_path) -> None:
    with VirtualBoard(level="model") as board:
        words = [word for key in LINK[:-1] for word in ("--set", key)]
        said = refused(
            "run", "light-link", *words, "--set", f"link.loop=serial:{board.port}",
            "--out", tmp_path / "run",
        )  # fmt: skip
    assert "link.panel must be of 32 x 32 pixels" in said and "not of 128 x 128" in said


@pytest.mark.slow
def test_a_run_of_a_link_says_what_came_back(viform, tmp_path) -> None:
    words = [word for key in LINK for word in ("--set", key)]
    code, out, err = viform("run", "light-link", *words, "--json", "--out", tmp_path / "run")
    assert code in (0, 1), err  # whether the file arrives is the air's affair
    metric = {name: each["value"] for name, each in json.loads(out)["metrics"].items()}
    assert metric["loop_bits_wrong"] == 0 < metric["loop_planes"]
