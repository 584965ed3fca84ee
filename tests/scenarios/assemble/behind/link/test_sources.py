"""Any source over the link: what arrives at a board, at the report, and after an interruption."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Clock, InputError, Interrupted, Viform
from cosim.files import open_stream, write_stream
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from rtl_model.stand_in import BoardDisplay
from scenarios.assemble.behind.link import stream_link
from scenarios.assemble.schema.messages import validate
from scenarios.report import write_report
from scenarios.run import run_scenario

SIDE, CYCLES = 32, 96
"""Of the stream: the virtual board has 32 x 32 pixels."""
LINK = {
    "panel": {"width": 192, "height": 192},
    "modem": {"cell": 2, "ticks": 2, "line": "8b10b", "parity": 16},
    "sensor": {"chip": "spikeone", "threshold": "1000 e", "reset": "hard"},
}  # fmt: skip
CODE = {"cycles": 32, "buffer": "1 ms"}


@pytest.fixture(autouse=True)
def _unchecked(monkeypatch: pytest.MonkeyPatch) -> None:
    """No check of the link's plan, which other tests make."""
    monkeypatch.setattr(stream_link, "check_plan", lambda link, progress: (link, []))


def file(folder: Path, hz: int = 40_000) -> dict[str, Any]:
    """A scenario of a recorded stream."""
    planes = np.random.default_rng(3).random((CYCLES, SIDE, SIDE)) < 0.3
    write_stream(Viform.from_planes(planes, Clock(hz)), folder / "a.npz")
    return {
        "title": "a", "sensor": {"source": f"file:{folder / 'a.npz'}", "white_rate": 0.5},
        "link": LINK, "code": CODE, "image": {"at": [60], "window": 21},
    }  # fmt: skip


def chip(folder: Path) -> dict[str, Any]:
    """A scenario of a latched chip of the same size."""
    return {
        "title": "chip", "duration": "2.4 ms", "link": LINK, "code": CODE, "image": {"at": [60]},
        "scene": {"kind": "step", "illuminance": "700 lux", "at": "1 ms"},
        "sensor": {"threshold": "1000 e", "width": SIDE, "height": SIDE},
    }  # fmt: skip


def run(data: dict[str, Any], out: Path, progress: Any = None, **given: Any) -> Any:
    return run_scenario(
        "any", validate(data), out, options=Options(resume=given.pop("resume", False)),
        progress=progress or SilentProgress(), began=time.perf_counter(),
        report=given.pop("report", lambda machine, run: []),
    )  # fmt: skip


def planes(path: Path) -> np.ndarray:
    stream = open_stream(path)
    words = stream.read_words(0, -(-stream.cycles // 32))
    return Viform(words, stream.cycles, stream.clock).planes().astype(bool)


@pytest.mark.slow
@pytest.mark.parametrize("source", [file, chip])
def test_a_board_displays_what_the_link_has_carried(
    source: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bit for bit: sent, decoded, and shown by the board; the report has the link's sections."""
    displayed = []
    show = BoardDisplay.show

    def noted(self: BoardDisplay, shown: np.ndarray) -> Any:
        displayed.append(shown)
        return show(self, shown)

    monkeypatch.setattr(BoardDisplay, "show", noted)
    out = tmp_path / "run"
    done = run(source(tmp_path) | {"display": {"sink": "serial:virtual"}}, out, report=write_report)
    sent = planes(out / "stream.zarr")
    assert sent.any()
    np.testing.assert_array_equal(planes(out / "received.zarr"), sent)
    np.testing.assert_array_equal(np.concatenate(displayed), sent)
    metric = {name: each.value for name, each in done.result.metrics.items()}
    assert (metric["sink_planes"], metric["sink_crc_wrong"]) == (len(sent), 0)
    assert metric["packets_late"] == metric["tiles_missing"] == metric["dropped_spikes"] == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Both ends of the link" in page and "What the link cost" in page
    against = "that of the stream sent" if source is file else "the true light"
    assert f"(of median PSNR) against {against}, the longest wait" in page
    files = {str(p.relative_to(out)) for p in out.rglob("*.*")
             if p.is_file() and ".zarr/" not in str(p)}  # fmt: skip
    assert files <= set(done.result.files) | {"stream.zarr"}
    assert {"link.zarr", "received.zarr", "figures/rates.png"} <= set(done.result.files)


@pytest.mark.slow
def test_an_interrupted_link_sends_the_recording_again(tmp_path: Path) -> None:
    class Stopping(SilentProgress):
        sending = False

        def start(self, what: str, total: int) -> None:
            self.sending = what == "the link"

        def advance(self, done: int) -> None:
            if self.sending and done == 128:
                signal.raise_signal(signal.SIGINT)

    data = file(tmp_path)
    whole = run(data, tmp_path / "whole")
    with pytest.raises(Interrupted, match="--resume"):
        run(data, tmp_path / "part", progress=Stopping())
    again = run(data, tmp_path / "part", resume=True)
    assert whole.result.metrics == again.result.metrics
    for name in ("link.zarr", "received.zarr"):
        np.testing.assert_array_equal(
            planes(tmp_path / "whole" / name), planes(tmp_path / "part" / name)
        )


def test_a_chip_of_another_clock_is_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        run(file(tmp_path, 20_000), tmp_path / "run")
    assert str(caught.value) == (
        "link.sensor.clock must be the stream's, 20000 Hz, not 40000 Hz; write --set "
        "link.sensor.clock='20000 Hz'"
    )
