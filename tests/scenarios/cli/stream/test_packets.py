"""Packet files on the command line, and the ladder of the layered code."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from cosim import Clock, Viform
from cosim.files import open_stream
from cosim.files.npz import write_npz
from cosim.spikes.viform import words_for
from scenarios.studies.codes.ladder import draw, fidelity, ladder, middle, speed, statistical
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.vfl import VflStream
from tests.sensor.codec.packets.streams import steady


@pytest.fixture(scope="module")
def stream() -> Viform:
    """200 cycles of 16 x 24 pixels."""
    rng = np.random.default_rng(6)
    words = steady(np.linspace(0, 0.6, 24), rng.random((16, 24)), 200, 0.2)
    return Viform(words, 200, Clock(20_000))


@pytest.fixture
def recording(stream, tmp_path):
    path = tmp_path / "a.npz"
    write_npz(stream, path)
    return path


@pytest.mark.parametrize(
    ("options", "code"),
    [([], StreamCode()), (["--code", "raw"], StreamCode("raw")),
     (["--code", "first-spike", "--cycles", 512], StreamCode("first-spike", 512))],
)  # fmt: skip
def test_a_lossless_file_gives_the_stream_back(viform, recording, stream, tmp_path, options, code):
    path = tmp_path / "b.vfl"
    assert viform("convert", recording, path, *options).code == 0
    assert VflStream(path).code == code
    result = viform("convert", path, tmp_path / "c.zarr", "--json")
    assert (result.code, result.err) == (0, "")
    again = open_stream(tmp_path / "c.zarr")
    np.testing.assert_array_equal(again.read_words(0, 7), stream.words)
    assert again.clock == stream.clock
    assert viform("image", path, "--at", 30, "--out", tmp_path / "b.png").code == 0
    assert viform("image", recording, "--at", 30, "--out", tmp_path / "a.png").code == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(
    ("options", "left"),
    [(["--layers", 4], "the first 4 layers, with the other spikes spread evenly"),
     (["--code", "statistical", "--k", 3, "--threshold", "1 ke", "--refine", 8],
      "changes beyond 3 standard deviations at a threshold of 1000 e, means of 8 widths")],
)  # fmt: skip
def test_what_is_lost_is_said_in_writing_and_in_reading(viform, recording, tmp_path, options, left):
    path = tmp_path / "b.vfl"
    wrote = viform("convert", recording, path, *options)
    assert wrote.err == f"viform: {path} holds only {left}\n"
    read = viform("convert", path, tmp_path / "c.npz")
    assert read.err == f"viform: {path} holds what is left of a stream: {left}\n"


@pytest.mark.parametrize(
    ("out", "options", "expected"),
    [("b.fsc", ["--layers", 3], "--layers must be given with a .vfl to write, not {out}; "
      "leave --layers out"),
     ("b.npz", ["--cycles", 64], "--cycles must be given with a .vfl to write, not {out}; "
      "leave --cycles out"),
     ("b.vfl", ["--code", "line"], "--code must be one of raw, first-spike, statistical, layered, "
      "event, not 'line'; choose one"),
     ("b.vfl", ["--code", "raw", "--layers", 3],
      "--layers must be given with --code layered, not with raw; leave it out"),
     ("b.vfl", ["--layers", 9], "--layers must be 1 to 8, not 9; write a value of these"),
     ("b.vfl", ["--cycles", 100],
      "--cycles must be a multiple of 32 from 32 to 512, not 100; write a value of these"),
     ("b.vfl", ["--k", 3],
      "--k must be given with --code statistical, not with layered; leave --k out")],
)  # fmt: skip
def test_options_that_do_not_go_together_are_refused(refused, recording, tmp_path, out, options,
                                                     expected):  # fmt: skip
    path = tmp_path / out
    assert refused("convert", recording, path, *options) == expected.format(out=path)
    assert not path.exists()


def test_a_damaged_file_is_refused_in_a_line(viform, refused, recording, tmp_path):
    path = tmp_path / "b.vfl"
    viform("convert", recording, path)
    data = path.read_bytes()
    path.write_bytes(data[:-3])
    assert refused("convert", path, tmp_path / "c.npz") == (
        f"{path} must be a whole packet file, not a file that is cut off; copy or convert it again"
    )
    path.write_bytes(b"garbage")
    assert "must be a whole packet file" in refused(
        "image", path, "--at", 3, "--out", tmp_path / "c.png"
    )


def test_the_ladder_climbs_and_is_better_than_the_statistical_code(stream, tmp_path):
    part = middle(stream)
    assert (part.shape, part.cycles) == ((16, 24), 192)
    rungs, lossy = ladder(part, 128), statistical(part, 1000.0)
    assert all(a.size < b.size for a, b in itertools.pairwise(rungs))
    assert [r.psnr == float("inf") for r in rungs] == [False] * 7 + [True]
    assert rungs[-2].psnr > rungs[2].psnr > rungs[0].psnr
    draw({"layered, a": rungs, "layered, b": rungs, "one": lossy, "two": lossy},
         tmp_path / "a.png")  # fmt: skip
    assert (tmp_path / "a.png").stat().st_size > 10_000
    assert [row[0] for row in speed(part, 128, 1)] == ["coding, 128 cycles", "decoding, 128 cycles"]


def test_fidelity_is_that_of_counts_in_a_window(stream):
    part = middle(stream)
    dark = Viform(np.zeros_like(part.words), part.cycles, part.clock)
    assert fidelity(part, part) == float("inf")
    mean_square = np.mean((np.linspace(0, 0.6, 24)) ** 2)
    assert fidelity(dark, part) == pytest.approx(-10 * np.log10(mean_square), abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "settings"),
    [("film", []), ("wave", []), ("star", []), ("step", []), ("shockwave", []),
     ("film", ["sensor.preset=silicon"])],
)  # fmt: skip
def test_streams_of_the_scenarios_come_back_bit_by_bit(viform, tmp_path, scenario, settings):
    folder, path = tmp_path / "run", tmp_path / "a.vfl"
    chosen = [f"--set={s}" for s in ("duration=5 ms", "image.at=[50]", *settings)]
    assert viform("run", scenario, *chosen, "--out", folder).code in (0, 1)
    stream = open_stream(folder)
    assert viform("convert", folder, path).code == 0
    again = VflStream(path)
    assert again.cycles == stream.cycles
    for first in range(words_for(stream.cycles)):
        np.testing.assert_array_equal(
            again.read_words(first, first + 1), stream.read_words(first, first + 1)
        )
    assert 8 * path.stat().st_size < 0.5 * stream.cycles * stream.shape[0] * stream.shape[1]
