"""Every source before every sink: each pair runs, or is refused in exactly one line.

To add a source or a sink, add its sections to SOURCES or SINKS. A pair that cannot be has its line
in REFUSED; every other pair is run, tiny.
"""

import time

import numpy as np
import pytest

from cosim import Clock, InputError, Viform
from cosim.files import open_stream, write_stream
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from display.probes import metrics
from scenarios.assemble.behind.link import stream_link
from scenarios.assemble.schema.messages import validate
from scenarios.assemble.source import asynchronous, continuous
from scenarios.run import run_scenario

CLOCK = Clock(40_000)
STEP = {"kind": "step", "illuminance": "700 lux", "at": "1 ms"}
TARGET = {"kind": "target", "chart": "steps", "illuminance": "700 lux"}


def chip(**sensor):
    return {
        "scene": STEP, "duration": "2.5 ms",
        "sensor": {"chip": "spikeone", "threshold": "1000 e", "clock": "40 kHz"} | sensor,
    }  # fmt: skip


def imager(kind, duration="3 ms", scene=TARGET, **keys):
    return {
        "scene": scene, "duration": duration, "lens": {"f_number": 1.4},
        "imager": {"kind": kind} | keys,
    }  # fmt: skip


SMALL = {"rows": 8, "columns": 16}
BOXED = {"width": 16, "height": 12}
SOURCES = {
    "latched": chip(),
    "board": chip(source="serial:virtual"),
    "asynchronous": chip(pixel="asynchronous", asynchronous=BOXED),
    "changes": chip(pixel="asynchronous", asynchronous=BOXED | {"change": 2}),
    "continuous": chip(pixel="continuous", continuous=BOXED),
    "adaptive-exposure": imager("adaptive-exposure", frame_rate="2 kHz", **SMALL),
    "ebaps": imager("ebaps", "200 ms", rows=8, columns=16),
    "emccd": imager("emccd", "60 ms", exposure="1 ms", pulse_rate="50 Hz"),
    "hardware-chain": imager("hardware-chain", exposure="200 us", frame_rate="1 kHz", **SMALL),
    "pwm": imager("pwm", exposure="500 us", frame_rate="1 kHz", threshold="100 e", **SMALL),
    "pfm": imager("pfm", exposure="500 us", frame_rate="1 kHz", threshold="100 e", **SMALL),
    "file": {"sensor": {"source": "file:recording.npz"}},
    "bring-up": {"board": {"level": "model", "rows": 4, "columns": 40, "frames": 12}},
}
DISPLAY = {"beside": ["1000 Hz"], "projector": "none", "renderer": "numpy"}
BOARD = {"sink": "serial:virtual", "fit": "nearest"}
FILM = {"kind": "frames", "frame_rate": "1 kHz", "exposure": "300 us", "readout": "400 us"}
SPIKES = {"kind": "spikes", "sensor": {"threshold": "1000 e", "clock": "20 kHz"}}
LINK = {
    "panel": {"width": 192, "height": 192},
    "modem": {"cell": 2, "ticks": 2, "line": "8b10b", "parity": 16},
    "sensor": {"chip": "spikeone", "threshold": "1000 e", "reset": "hard"},
}  # fmt: skip
CODE = {"cycles": 64, "buffer": "1 ms"}
SINKS = {
    "none": {},
    "link": {"link": LINK, "code": CODE},
    "link, display": {"link": LINK, "code": CODE, "display": DISPLAY},
    "link, display, camera": {"link": LINK, "code": CODE, "display": DISPLAY, "camera": FILM},
    "link, board": {"link": LINK, "code": CODE, "display": BOARD},
    "display": {"display": DISPLAY},
    "display, camera": {"display": DISPLAY, "camera": FILM},
    "display, spikes": {"display": DISPLAY, "camera": SPIKES},
    "camera": {"camera": FILM},
    "board": {"display": BOARD},
    "board, camera": {"display": BOARD, "camera": FILM},
}
SLOW = {"latched", "board", "emccd", "ebaps"}
"""Sources of many pixels, of many cycles, or with probes that take their time."""

LARGE = {"latched", "emccd"}
"""Sources of whole chips: the golden renderer would take minutes, and the link is too slow."""
SLOWER = {"adaptive-exposure", "hardware-chain"}
"""Sources whose plan takes seconds: the display alone is in the ordinary suite."""
RARE = {sink for sink in SINKS if "link" in SINKS[sink] or SINKS[sink].get("display") is BOARD}
"""Sinks that take seconds before every source."""
QUICK = {("asynchronous", "link, display"), ("pwm", "board")}
"""Pairs of those that are in the ordinary suite, a link without the check of its plan."""

ALONE = (
    "camera must be absent without a [display], not given alone; add a [display], which it films, "
    "or leave it out"
)
UNLIT = (
    "camera must be absent with display.sink, not given with it; leave one of them out: a board "
    "displays the planes, and no light is rendered"
)
BRING_UP = (
    "board must be absent in a scenario with a [{}], not given with one; remove one of them: a "
    "bring-up makes no stream; sensor.source = serial:PORT puts a board into a chain"
)
LATCHED = ("latched", "board")
REFUSED = {
    **{(source, "camera"): ALONE for source in SOURCES},
    **{(source, "board, camera"): UNLIT for source in SOURCES},
    **{
        ("bring-up", sink): BRING_UP.format("display") for sink in SINKS if "display" in SINKS[sink]
    },
    **{("bring-up", sink): BRING_UP.format("link") for sink in SINKS if "link" in SINKS[sink]},
    ("bring-up", "camera"): BRING_UP.format("camera"),
}
ELSEWHERE = {
    **{
        (source, sink): "tests/scenarios/assemble/source/latched/test_boards.py"
        for source in LATCHED for sink in ("none", "board")
    },
    ("bring-up", "none"): "tests/scenarios/cli/board/test_bringup.py",
}  # fmt: skip
"""Pairs that other tests run."""


def cases():
    for source in SOURCES:
        for sink in SINKS:
            if (source, sink) in ELSEWHERE:
                continue
            slow = source in SLOW or (source in SLOWER and sink != "display")
            slow = slow or (sink in RARE and (source, sink) not in QUICK)
            slow = slow and (source, sink) not in REFUSED
            marks = [pytest.mark.slow] if slow else []
            yield pytest.param(source, sink, marks=marks, id=f"{source} - {sink}")


def data_of(source, sink):
    data = {"title": f"{source}, {sink}"} | SOURCES[source] | SINKS[sink]
    if source in LARGE and "sink" not in data.get("display", {"sink": ""}):
        data["display"] = data["display"] | {"renderer": "gl"}
    if "board" not in data and ("imager" not in data or {"display", "link"} & data.keys()):
        data["image"] = {"at": [40, 60]}
    return data


@pytest.fixture(autouse=True)
def _quick(monkeypatch, tmp_path):
    """A recording in the working directory, and no probes of displays, which have a test of their
    own."""
    monkeypatch.setattr(asynchronous.EventProbeCamera, "of", lambda machine: None)
    monkeypatch.setattr(continuous, "ContinuousProbeCamera", lambda *_: None)
    monkeypatch.setattr(metrics, "RATES", (metrics.GREY, metrics.BRIGHT))
    monkeypatch.setattr(metrics, "EDGES", ((0.0, metrics.GREY),))
    monkeypatch.chdir(tmp_path)
    planes = np.random.default_rng(1).random((100, 12, 16)) < 0.3
    write_stream(Viform.from_planes(planes, CLOCK), tmp_path / "recording.npz")


def run(data, out, report=lambda machine, run: []):
    done = run_scenario(
        "matrix", validate(data), out, options=Options(), progress=SilentProgress(),
        began=time.perf_counter(), report=report,
    )  # fmt: skip
    return done.result


def words(path):
    return open_stream(path).read_words(0, 1 << 12)


@pytest.mark.parametrize(("source", "sink"), list(cases()))
def test_a_source_before_a_sink(source, sink, tmp_path, monkeypatch):
    if (source, sink) in QUICK:
        monkeypatch.setattr(stream_link, "check_plan", lambda link, progress: (link, []))
    line = REFUSED.get((source, sink))
    if line is not None:
        with pytest.raises(InputError) as caught:
            run(data_of(source, sink), tmp_path / "run")
        assert str(caught.value) == line
        assert not (tmp_path / "run").exists()
        return
    result = run(data_of(source, sink), tmp_path / "run")
    assert result.outcome in ("ok", "degraded")
    named = {name: metric.value for name, metric in result.metrics.items()}
    if "link" in SINKS[sink]:
        assert named["frames_received"] > 0 == named["frames_lost"]
        assert (named["psnr_direct"] is None) == (source == "file")
        sent, received = (
            words(tmp_path / "run" / name) for name in
            ("stream.zarr" if source in (*LATCHED, "file") else "shown.zarr", "received.zarr")
        )  # fmt: skip
        assert sent.any()
        fits = named["packets_dropped"] == 0
        assert fits == (source not in LARGE) == np.array_equal(sent, received)
        assert fits == (named["dropped_spikes"] == named["added_spikes"] == 0)
        assert not fits or named["psnr_through_link"] == named["psnr_direct"]
    if SINKS[sink].get("display") is BOARD:
        assert named["sink_planes"] > 0 == named["sink_crc_wrong"]
    if SINKS[sink].get("display") in (None, BOARD):
        assert "total_light" not in named
        return
    assert named["total_light"] is None or 0 <= named["total_light"] < 1.5
    assert (named["psnr_spike"] is None) == (source == "file")
    assert (named.get("camera_frames", 0) >= 1) == (SINKS[sink].get("camera") is FILM)
    assert ("camera_spike_rate" in named) == (SINKS[sink].get("camera") is SPIKES)
