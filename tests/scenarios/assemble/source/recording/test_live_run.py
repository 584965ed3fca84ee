"""Runs of live streams: the same result as of a whole file, and what stays of them."""

import gc
import math
import os
import signal
import sys
import threading
import time
import tracemalloc
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from cosim import Clock, InputError, Interrupted, Viform
from cosim.files import open_stream, write_stream
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from scenarios.assemble.behind.live import assemble_live
from scenarios.assemble.machine import check_options
from scenarios.assemble.schema.messages import validate
from scenarios.assemble.source.recording import live
from scenarios.report import write_report
from scenarios.run import run_scenario

SIDE, CYCLES = 32, 150
FRAME = SIDE * SIDE // 8
PANEL = {"beside": ["1000 Hz"], "projector": "none", "renderer": "numpy"}
LINK = {
    "panel": {"width": 192, "height": 192},
    "modem": {"cell": 2, "ticks": 2, "line": "8b10b", "parity": 16},
    "sensor": {"chip": "spikeone", "threshold": "1000 e", "reset": "hard"},
}  # fmt: skip
SHOWN = {"duration": "3.75 ms", "display": PANEL}
CARRIED = SHOWN | {"link": LINK, "code": {"cycles": 32, "buffer": "1 ms"}}
COUNTED = {
    "planes_received", "planes_rate", "planes_late", "planes_delay_s", "bytes_incomplete",
}  # fmt: skip
"""Metrics that only a live stream has."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A .dat, and its bytes."""
    planes = np.random.default_rng(3).random((CYCLES, SIDE, SIDE)) < 0.3
    path = tmp_path_factory.mktemp("recorded") / "a.dat"
    write_stream(Viform.from_planes(planes, Clock(40_000)), path)
    return path, path.read_bytes()


def scenario(source, *parts, **sensor):
    own = {"source": source, "width": SIDE, "height": SIDE, "white_rate": 0.5} | sensor
    data = {"title": "a", "sensor": own, "image": {"at": [60], "window": 21}}
    for part in parts:
        data |= part
    return validate(data)


def run(given, out, progress=None, resume=False, report=lambda machine, run: []):
    options = Options(resume=resume)
    check_options(given, options)
    return run_scenario(
        "a", given, out, options=options, progress=progress or SilentProgress(),
        began=time.perf_counter(), report=report,
    )  # fmt: skip


def same(done, whole):
    """Whether two runs have left the same: metrics, latencies, bits of streams, and images."""
    mine = {k: v for k, v in done.result.metrics.items() if k not in COUNTED}
    assert mine == whole.result.metrics and done.result.latency == whole.result.latency
    assert done.result.left_out == whole.result.left_out
    assert done.result.files == whole.result.files
    for name in whole.result.files:
        ours, theirs = done.folder / name, whole.folder / name
        if name.endswith(".zarr"):
            a, b = open_stream(ours), open_stream(theirs)
            assert (a.cycles, a.clock, a.shape) == (b.cycles, b.clock, b.shape)
            np.testing.assert_array_equal(a.read_words(0, 99), b.read_words(0, 99))
        elif name.startswith("images/"):
            assert ours.read_bytes() == theirs.read_bytes()


@pytest.fixture(scope="module")
def shown(recorded, tmp_path_factory):
    """The whole file on the display."""
    return run(scenario(f"file:{recorded[0]}", SHOWN), tmp_path_factory.mktemp("shown") / "run")


class Grower(SilentProgress):
    """Appends a ragged piece to a file only when all that it has before has passed the whole
    chain, so that the file never has what the run has not yet asked for.

    Attributes:
        pieces: number of pieces so far.
    """

    def __init__(self, path, data):
        self.path, self.data, self.at, self.pieces = path, data, 0, 0
        self.grow(1)

    def grow(self, planes):
        with self.path.open("ab") as file:
            file.write(self.data[self.at : self.at + planes * FRAME + 7])
        self.at = min(self.at + planes * FRAME + 7, len(self.data))
        self.pieces += 1

    def advance(self, done):
        block = done // 64 * 64
        if self.at // FRAME <= block + 64:  # the next block is not whole
            self.grow(64)

    def note(self, text): ...


class Counted(SilentProgress):
    """Counts the bytes that Python objects and arrays hold after some of the planes: the fewest in
    the ten blocks from there on, of which threads have more or fewer in work.

    Attributes:
        held: bytes by the number of planes.
    """

    def __init__(self, *places):
        self.held = dict.fromkeys(places, math.inf)

    def advance(self, done):
        for place in self.held:
            if place <= done < place + 640:
                gc.collect()
                now = tracemalloc.get_traced_memory()[0]
                self.held[place] = min(self.held[place], now)

    def note(self, text): ...


def test_what_is_kept_does_not_grow_with_the_stream(tmp_path):
    planes = 6400
    data = np.random.default_rng(5).bytes(planes * 128 * 64 // 8)
    (tmp_path / "a.dat").write_bytes(data)
    given = scenario(
        f"file:{tmp_path / 'a.dat'}", {"duration": "160 ms"}, source_timeout="60 s", width=128,
        height=64,
    )  # fmt: skip
    counted = Counted(1280, 5120)
    machine = assemble_live("a", given, None, counted)
    (tmp_path / "run").mkdir()
    chain = machine.chain(tmp_path / "run")
    tracemalloc.start()
    try:
        chain.run(counted)
    finally:
        tracemalloc.stop()
        machine.close()
    between = (5120 - 1280) * 128 * 64 // 8
    assert counted.held[5120] - counted.held[1280] < between / 8  # blocks in work


def grown(recorded, folder, *parts, run=run):
    grower = Grower(folder / "g.dat", recorded[1])
    given = scenario(f"file:{folder / 'g.dat'}", *parts, source_timeout="60 s")
    done = run(given, folder / "grown", grower)
    assert grower.pieces >= 3 and grower.at == len(recorded[1])
    return done


def test_a_file_is_shown_while_it_grows(recorded, shown, tmp_path):
    done = grown(recorded, tmp_path, SHOWN)
    same(done, shown)
    assert done.result.metrics["planes_received"].value == CYCLES
    told = " ".join(done.outcome.notes)
    assert "150 planes came from" in told and "the planes asked for are there" in told


@pytest.mark.slow
def test_a_file_is_sent_over_the_link_and_shown_while_it_grows(recorded, tmp_path):
    """With the check of the link's plan, and with the report."""
    reported = partial(run, report=write_report)
    whole = reported(scenario(f"file:{recorded[0]}", CARRIED), tmp_path / "whole")
    same(grown(recorded, tmp_path, CARRIED, run=reported), whole)
    assert open_stream(tmp_path / "grown/received.zarr").cycles == CYCLES
    pipe = piped(recorded[1], tmp_path)
    open_end = scenario(f"pipe:{pipe}", CARRIED | {"duration": None})
    same(reported(open_end, tmp_path / "after"), whole)
    path = tmp_path / "part.dat"
    path.write_bytes(recorded[1][: 100 * FRAME])
    given = scenario(f"file:{path}", CARRIED, source_timeout="60 s")
    with pytest.raises(Interrupted, match=r"after \d+ of 150 planes"):
        run(given, tmp_path / "part", Stopping())
    path.write_bytes(recorded[1])
    again = reported(given, tmp_path / "part", resume=True)
    assert again.result.throughput == []
    same(again, whole)


def piped(data, folder):
    """A named pipe into which another thread writes."""
    place = folder / "pipe"
    os.mkfifo(place)

    def write():
        with place.open("wb") as file:
            for at in range(0, len(data), 777):
                file.write(data[at : at + 777])
                file.flush()

    threading.Thread(target=write, daemon=True).start()
    return place


def test_a_named_pipe_is_shown_as_it_comes(recorded, shown, tmp_path):
    done = run(scenario(f"pipe:{piped(recorded[1], tmp_path)}", SHOWN), tmp_path / "run")
    same(done, shown)


def test_standard_input_is_shown_after_its_end_if_its_length_is_not_asked_for(
    recorded, shown, tmp_path, monkeypatch
):
    """White, too, is then that of the whole stream; the last, incomplete plane is left out."""
    whole = run(
        scenario(f"file:{recorded[0]}", {"display": PANEL}, white_rate=None), tmp_path / "w"
    )
    end, begin = os.pipe()
    os.write(begin, recorded[1] + b"rest")
    os.close(begin)
    with open(end, "rb", buffering=0) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        given = scenario("pipe:-", {"display": PANEL}, white_rate=None)
        done = run(given, tmp_path / "run", report=write_report)
    mine = {k: v for k, v in done.result.metrics.items() if k not in COUNTED}
    assert mine == whole.result.metrics
    assert done.result.metrics["bytes_incomplete"].value == 4
    told = " ".join(done.outcome.notes)
    assert "standard input: it has ended" in told and "only 4 of its 128 bytes came" in told
    page = (tmp_path / "run/report.html").read_text(encoding="utf-8")
    assert "The stream as it came" in page and "bytes of an incomplete last plane" in page


def test_a_stream_that_ends_before_its_time_is_that_of_its_length(recorded, shown, tmp_path):
    """The display was laid out for 400 cycles, and 150 came."""
    given = scenario(f"pipe:{piped(recorded[1], tmp_path)}", SHOWN | {"duration": "10 ms"})
    done = run(given, tmp_path / "run")
    same(done, shown)
    assert "before the 400 that duration asks for" in " ".join(done.outcome.notes)


class Stopping(SilentProgress):
    """The user stops the run, once, when a block of planes has come."""

    comes = False

    def start(self, what, total):
        self.comes = "received" in what

    def advance(self, done):
        if self.comes and done >= 64:
            self.comes = False
            signal.raise_signal(signal.SIGINT)

    def note(self, text): ...


@pytest.mark.parametrize("there", [100 * FRAME + 5, CYCLES * FRAME])
def test_an_interrupted_file_goes_on_and_what_came_is_readable(recorded, shown, tmp_path, there):
    path = tmp_path / "g.dat"
    path.write_bytes(recorded[1][:there])
    given = scenario(f"file:{path}", SHOWN, source_timeout="60 s")
    with pytest.raises(Interrupted) as caught:
        run(given, tmp_path / "run", Stopping())
    text = str(caught.value)
    assert " of 150 planes" in text and "; go on with the same command" in text
    kept = open_stream(tmp_path / "run/stream.zarr")
    assert 64 <= kept.cycles <= there // FRAME and f"after {kept.cycles} of" in text
    whole = open_stream(shown.folder / "stream.zarr")
    np.testing.assert_array_equal(kept.read_words(0, 2), whole.read_words(0, 2))
    path.write_bytes(recorded[1][::-1])
    with pytest.raises(InputError) as other:
        run(given, tmp_path / "run", resume=True)
    assert str(other.value) == (
        f"--resume must be given with the file that was read, not with {path}, which was written "
        "anew since; start again with another --out"
    )
    path.write_bytes(recorded[1])
    same(run(given, tmp_path / "run", resume=True), shown)


def test_a_file_that_shrinks_ends_the_run_and_what_was_processed_is_readable(recorded, tmp_path):
    path = tmp_path / "g.dat"
    path.write_bytes(recorded[1][: 70 * FRAME])

    class Shrinking(SilentProgress):
        def advance(self, done):
            if done >= 64:
                os.truncate(path, 5)

    given = scenario(f"file:{path}", source_timeout="60 s")
    with pytest.raises(InputError, match=r"which shrank to 5 bytes after \d+ were read; let its"):
        run(given, tmp_path / "run", Shrinking())
    assert open_stream(tmp_path / "run/stream.zarr").cycles == 64


def test_an_interrupted_pipe_leaves_what_came_and_is_not_resumed(recorded, tmp_path):
    os.mkfifo(tmp_path / "p")
    writer = os.open(tmp_path / "p", os.O_RDWR)  # which waits for no reader
    os.write(writer, recorded[1][: 70 * FRAME])
    given = scenario(f"pipe:{tmp_path / 'p'}")
    with pytest.raises(Interrupted) as caught:
        run(given, tmp_path / "run", Stopping())
    os.close(writer)
    store = tmp_path / "run/stream.zarr"
    kept = open_stream(store)
    assert str(caught.value) == (
        f"interrupted after {kept.cycles} planes; what came is {store}: "
        f"viform run playback --set sensor.source=file:{store}"
    )
    first = (kept.read_words(0, 1)[0, ::-1].ravel() & 1).astype(np.uint8)
    packed = np.packbits(first, bitorder="little")
    assert 64 <= kept.cycles <= 70 and packed.tobytes() == recorded[1][:FRAME]
    with pytest.raises(InputError) as refused:
        run(given, tmp_path / "run", resume=True)
    assert str(refused.value) == (
        "--resume must be given for a source that can be read again, not given for a pipe; "
        "leave it out, and give another --out"
    )


def test_a_size_that_is_assumed_is_said_and_doubted(tmp_path):
    """13 000 bytes a frame: the length tells another size than the one assumed."""
    (tmp_path / "a.dat").write_bytes(bytes(64 * 13_000))
    given = scenario(f"file:{tmp_path / 'a.dat'}", width=None, height=None, source_timeout="1 ms")
    progress = Noting()
    done = run(given, tmp_path / "run", progress)
    assert done.result.metrics["planes_received"].value == 66
    assert any("planes of 400x250 are assumed" in one for one in progress.told)
    told = " ".join(done.outcome.notes)
    assert "only 7000 of its 12500 bytes came: check sensor.width" in told
    assert "832000 bytes are whole planes of 416x250: sensor.width and sensor.height say so" in told
    part = {"duration": "1.3 ms", "image": {"at": [26], "window": 21}}
    sensor = {"width": None, "height": None, "source_timeout": "1 ms"}
    short = run(scenario(f"file:{tmp_path / 'a.dat'}", part, **sensor), tmp_path / "short")
    told = " ".join(short.outcome.notes)  # 52 planes of it are 50 of 416x250, but more would come
    assert "52 planes came" in told and "416x250" not in told


def test_a_config_beside_a_file_that_grows_tells_its_size(tmp_path):
    """416 x 250 is 400 x 250 with head, whose columns are no pixels."""
    planes = np.random.default_rng(4).random((64, 250, 400)) < 0.1
    given = Viform.from_planes(planes, Clock(40_000))
    write_stream(given, tmp_path / "a.dat", head=True, config=True)
    sensor = {"width": None, "height": None, "source_timeout": "1 ms"}
    progress = Noting()
    run(scenario(f"file:{tmp_path / 'a.dat'}", **sensor), tmp_path / "run", progress)
    assert not any("assumed" in told for told in progress.told)
    got = open_stream(tmp_path / "run/stream.zarr")
    np.testing.assert_array_equal(got.read_words(0, 2), given.words)


class Noting(SilentProgress):
    def __init__(self):
        self.told, self.texts = [], []

    def note(self, text):
        self.told.append(text)

    def tell(self, what):
        self.texts.append(what)


def test_the_progress_has_the_planes_received_and_their_rate(recorded, tmp_path, monkeypatch):
    monkeypatch.setattr(live, "_TOLD_S", 0.0)
    progress = Noting()
    run(scenario(f"pipe:{piped(recorded[1], tmp_path)}"), tmp_path / "run", progress)
    assert progress.texts[-1].startswith("a: 150 planes received at ")
    assert "planes/s" in progress.texts[-1]


@pytest.mark.parametrize(("cycles", "total", "done"), [(400, 1534, 64), (None, 0, 390)])
def test_the_share_that_is_done_is_that_of_the_chain(cycles, total, done):
    """With a link, all planes have come long before all are sent."""
    from scenarios.assemble.source.recording.live import _Received

    class Counting(Noting):
        def start(self, what, total):
            self.total = total

        def advance(self, done):
            self.done = done

    late = SimpleNamespace(late=0)
    planes = SimpleNamespace(cycles=cycles, came=390, rate=None, lateness=late)
    progress = Counting()
    received = _Received(progress, planes, "a")
    received.start("", 1534 if cycles else 10**9)
    received.advance(64)
    assert (progress.total, progress.done) == (total, done)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"width": 5}, "sensor.width and sensor.height must be a size as stored, with a product "
         "that is a multiple of 8, not 5 x 33; give the columns with those that fill up a byte"),
        ({"width": 8, "byte_order": "big-16"},
         "the bytes of a plane must be a multiple of 2, as its words are big-16, not 33; correct "
         "its size or its order of bytes"),
        ({"height": None, "width": 8},
         "sensor.height must be given with sensor.width, not absent; add it"),
        ({"source": "file:{}/a.npz", "source_timeout": "1 s"},
         "sensor.source_timeout must be given with a .dat, whose planes follow each other, not "
         "given with {}/a.npz; leave it out, or name a .dat"),
        ({"source": "pipe:{}/none"},
         "sensor.source must be a pipe that exists, not {}/none; make it: mkfifo {}/none"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_line_and_nothing_is_written(keys, says, tmp_path):
    (tmp_path / "a.npz").write_bytes(b"")
    sensor = {"source": "pipe:-", "width": 8, "height": 33} | keys
    sensor["source"] = sensor["source"].format(tmp_path)
    given = scenario(sensor.pop("source"), **sensor)
    with pytest.raises(InputError) as caught:
        run(given, tmp_path / "run")
    assert str(caught.value) == says.format(tmp_path, tmp_path)
    assert not (tmp_path / "run").exists()


def test_a_closed_pipe_is_one_line_of_the_command(refused, tmp_path, monkeypatch):
    with open(os.devnull, "rb", buffering=0) as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        said = refused(
            "run", "playback", "--set", "sensor.source=pipe:-", "--set", "sensor.width=32",
            "--set", "sensor.height=32", "--out", tmp_path / "run",
        )  # fmt: skip
    assert said == (
        "sensor.source must be a stream of at least one plane, of 128 bytes, not one of 0 bytes: "
        "it has ended; start its writer, or check sensor.width and sensor.height"
    )
    assert not (tmp_path / "run").exists()
