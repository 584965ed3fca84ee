"""`viform convert` between every ordered pair of formats: nothing lost that the formats hold, what
they do not hold is said, and what they cannot hold is refused with nothing half-written."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from cosim import Clock, Events, Viform
from cosim.files import open_stream, write_events, write_stream
from cosim.files.event_file import read_events
from cosim.spikes.viform import words_for

USUAL, SLOW = Clock(40_000), Clock(20_000)


@dataclass(frozen=True)
class Format:
    """How a format is asked for; keeps: whether clock and start are kept."""

    name: str
    keeps: bool
    size: tuple[int, int] | None = None
    """The only one that it holds."""
    options: tuple[str, ...] = ()
    read_as: str | None = None
    """--size that it is always read with; without it, the stream's own where one is needed."""


FORMATS = {
    "dat": Format("dat", False),
    "head": Format("dat", False, (400, 250), ("--head",), "416x250"),
    "raw": Format("raw", False, (1000, 1000)),
    "npz": Format("npz", True),
    "zarr": Format("zarr", True),
    "events": Format("events.npz", True),
}
STREAMS = {
    "400x250": (5, (250, 400)),
    "1000x1000": (5, (1000, 1000)),
    "13x7": (70, (7, 13)),
}


def holds(kind: str, stream: str) -> bool:
    size = FORMATS[kind].size
    return stream != "13x7" if kind == "dat" else size is None or stream == "{}x{}".format(*size)


def size_of(kind: str, stream: str) -> str | None:
    return FORMATS[kind].read_as or (stream if kind == "dat" else None)


@pytest.fixture(scope="module")
def streams() -> dict[str, Viform]:
    """At 20 kHz, from cycle 640 on."""
    made = {}
    for name, (cycles, shape) in STREAMS.items():
        shape = (words_for(cycles), *shape)
        words = np.zeros(shape, np.uint32) - np.uint32(1)
        for seed in range(4):  # one spike in 16 cycles
            words &= np.random.default_rng(seed).integers(0, 2**32, shape, np.uint32)
        words[-1] &= np.uint32((1 << (cycles % 32)) - 1)
        made[name] = Viform(words, cycles, SLOW, 640)
    return made


@pytest.fixture(scope="module")
def sources(streams, tmp_path_factory) -> dict[tuple[str, str], Path]:
    """Every stream in every format that holds it."""
    folder, made = tmp_path_factory.mktemp("sources"), {}
    for name, stream in streams.items():
        for kind, form in FORMATS.items():
            if holds(kind, name):
                made[name, kind] = folder / f"{name}-{kind}.{form.name}"
                write_stream(stream, made[name, kind], head=kind == "head")
    return made


PAIRS = [
    (name, one, two) for name in STREAMS for one in FORMATS for two in FORMATS if holds(one, name)
]


@pytest.mark.parametrize(("name", "one", "two"), PAIRS, ids=str)
def test_every_pair_keeps_all_that_both_hold(
    viform, streams, sources, tmp_path, name: str, one: str, two: str
) -> None:
    source, out = sources[name, one], tmp_path / f"a.{FORMATS[two].name}"
    size = size_of(one, name)
    command = ["convert", source, out, *FORMATS[two].options, *(["--size", size] if size else [])]
    answer = viform(*command)
    if not holds(two, name):
        assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1)
        assert name in answer.err
        assert list(tmp_path.iterdir()) == []
        return
    assert answer.code == 0 and answer.out.startswith(f"{out}: ")
    stream, kept = streams[name], FORMATS[one].keeps and FORMATS[two].keeps
    again_size = size_of(two, name)
    pixels = tuple(int(n) for n in again_size.split("x")) if again_size else None
    again = open_stream(out, pixels)
    assert (again.cycles, again.shape) == (stream.cycles, stream.shape)
    for w in range(words_for(stream.cycles)):
        np.testing.assert_array_equal(again.read_words(w, w + 1), stream.read_words(w, w + 1))
    found = (again.clock, getattr(again, "start", 0))
    assert found == ((SLOW, 640) if kept else (USUAL, 0))
    # What is lost in this step, and only that, is said.
    lost = FORMATS[one].keeps and not FORMATS[two].keeps
    assert (f"{out} does not keep the clock of 20 kHz: it is read as 40 kHz" in answer.err) == lost
    assert (f"{out} does not keep that the first cycle is 640" in answer.err) == lost
    said = f"{out} does not keep its size: read it with --size {again_size}"
    assert (said in answer.err) == (two == "dat" and name == "1000x1000")
    if one == two:
        assert again.clock == open_stream(source, pixels).clock
        if two in ("dat", "head", "raw", "events"):
            assert out.read_bytes() == source.read_bytes()


@pytest.mark.parametrize("kind", FORMATS)
def test_image_opens_every_format(viform, sources, streams, tmp_path, kind: str) -> None:
    import cv2

    name = "1000x1000" if kind == "raw" else "400x250"
    size = size_of(kind, name)
    out = tmp_path / "a.png"
    assert viform(
        "image", sources[name, kind], "--at", 3, "--window", 1, "--out", out,
        *(["--size", size] if size else []),
    ) == (0, "", "")  # fmt: skip
    spikes = (streams[name].words[0] >> np.uint32(3)) & np.uint32(1)
    np.testing.assert_array_equal(cv2.imread(str(out), cv2.IMREAD_UNCHANGED), 255 * spikes)


def test_image_says_how_an_ambiguous_file_was_read(viform, refused, tmp_path) -> None:
    path, out = tmp_path / "a.dat", tmp_path / "a.png"
    command = ("image", path, "--at", 3, "--window", 1, "--out", out)
    path.write_bytes(bytes(10 * 12_500))
    said = f"{path} is read as 400x250 (10 frames); it may be 1000x1000 (1 frame): --size says"
    assert viform(*command) == (0, "", f"viform: {said} which\n")
    assert viform(*command, "--size", "400x250") == (0, "", "")
    out.unlink()
    path.write_bytes(bytes(26 * 12_500))
    assert refused(*command) == (
        f"{path} must be of a size that its length tells, not 325000 bytes, which fit 400x250 (26 "
        "frames) and 416x250 with head (25); give --size 400x250, --size 416x250"
    )
    assert not out.exists()


def test_a_folder_with_a_config_goes_there_and_back(viform, refused, tmp_path) -> None:
    source, folder = tmp_path / "a.npz", tmp_path / "set"
    folder.mkdir()
    stream = Viform(np.arange(128, dtype=np.uint32).reshape(1, 8, 16), 7, USUAL)
    write_stream(stream, source)
    code, _, err = viform("convert", source, folder / "rec.dat", "--config")
    assert (code, "--size" in err) == (0, False)
    for given in (folder, folder / "config.yaml", folder / "rec.dat"):
        code, text, _ = viform("convert", given, tmp_path / "b.npz", "--json")
        assert (code, json.loads(text)["width"]) == (0, 16)
        again = open_stream(tmp_path / "b.npz")
        np.testing.assert_array_equal(again.read_words(0, 1), stream.words)
    before = (folder / "rec.dat").read_bytes()
    assert refused("convert", folder, folder / "rec.dat").startswith("OUT must be another file")
    assert refused("convert", source, folder / "x.npz", "--config").startswith("--config must be")
    assert (folder / "rec.dat").read_bytes() == before
    assert sorted(p.name for p in folder.iterdir()) == ["config.yaml", "rec.dat"]


@pytest.mark.parametrize(
    ("options", "out", "expected"),
    [
        (["--head"], "a.npz", "--head must be given with a .dat to write, not a.npz; leave --head "
         "out"),
        (["--config"], "a.raw", "--config must be given with a .dat to write, not a.raw; leave "
         "--config out"),
        (["--head"], "a.mp4", "--head must be given with a .dat to write, not a.mp4; leave --head "
         "out"),
        (["--head"], "a.dat", "a stream written with --head must be 400x250, not 1000x1000; leave "
         "--head out"),
    ],
)  # fmt: skip
def test_flags_of_dat_are_refused_elsewhere(
    refused, sources, tmp_path, monkeypatch, options, out, expected
) -> None:
    monkeypatch.chdir(tmp_path)
    assert refused("convert", sources["1000x1000", "zarr"], out, *options) == expected
    assert list(tmp_path.iterdir()) == []


def test_events_of_an_asynchronous_chip_stay_events(viform, refused, tmp_path) -> None:
    events = Events(
        np.array([0, 0, 1], np.uint16), np.array([1, 1, 2], np.uint16), np.array([5, 5, 9]),
        np.array([6, 1, 10]), (2, 4), 20, Clock(10**9), 0, np.array([2, 1, 2], np.uint16), 2,
    )  # fmt: skip
    source = tmp_path / "a.events.npz"
    write_events(events, source)
    answer = viform("convert", source, tmp_path / "b.events.npz")
    assert (answer.code, answer.err) == (0, "")
    assert read_events(tmp_path / "b.events.npz") == events
    for out in ("c.npz", "c.zarr", "c.dat", "c.mp4"):
        assert refused("convert", source, tmp_path / out).startswith(
            f"{source} must be full spikes alone, at most one a pixel and tick, to be held in "
        )
    assert refused("image", source, "--at", 5, "--out", tmp_path / "c.png").startswith(f"{source} ")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.events.npz", "b.events.npz"]


def test_widths_that_are_lost_are_said(viform, tmp_path) -> None:
    events = Events(
        np.array([0, 1], np.uint16), np.array([1, 2], np.uint16), np.array([5, 9]),
        np.array([6, 3]), (2, 4), 20, Clock(40_000),
    )  # fmt: skip
    source = tmp_path / "a.events.npz"
    write_events(events, source)
    assert viform("convert", source, tmp_path / "b.zarr") == (
        0, f"{tmp_path / 'b.zarr'}: 20 cycles of 4 x 2\n",
        f"viform: 1 of 2 events of {source} have a width that is not the interval between "
        "spikes, which is all that planes keep\n",
    )  # fmt: skip


def test_a_raw_capture_says_what_it_leaves_out_and_where_it_is_damaged(
    viform, refused, sources, tmp_path
) -> None:
    content = sources["1000x1000", "raw"].read_bytes()
    path = tmp_path / "a.raw"
    path.write_bytes(content[640:-64])
    assert viform("convert", path, tmp_path / "b.raw") == (
        0, f"{tmp_path / 'b.raw'}: 3 cycles of 1000 x 1000\n",
        f"viform: bytes of {path} left out: 127360 before the first whole frame, 127936 "
        "after the last\n",
    )  # fmt: skip
    assert (tmp_path / "b.raw").read_bytes() == content[128_000:-128_000]
    path.write_bytes(content[: 3 * 128_000 + 64] + content[3 * 128_000 + 192 :])
    assert "at byte 384064 in frame 3, not " in refused("convert", path, tmp_path / "c.npz")
    # Damage in the middle that no look at the ends shows: met while it is written.
    damaged = bytearray(content)
    damaged[2 * 128_000 + 63] ^= 0x40
    path.write_bytes(damaged)
    assert open_stream(path).cycles == 5
    line = refused("convert", path, tmp_path / "c.dat")
    assert "at byte 256000 in frame 2, not channel 1 line 500, a damaged marker; keep what" in line
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.raw", "b.raw"]


def test_it_says_what_it_wrote_and_what_it_replaced(viform, tmp_path: Path) -> None:
    source, out = tmp_path / "a.npz", tmp_path / "b.zarr"
    write_stream(Viform(np.zeros((1, 4, 8), np.uint32), 20, Clock(40_000)), source)
    assert viform("convert", source, out).out == f"{out}: 20 cycles of 8 x 4\n"
    again = viform("convert", source, out).out
    assert again == f"{out}: 20 cycles of 8 x 4, in place of an earlier one\n"
