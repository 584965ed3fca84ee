"""First-spike files on the command line, sizes in a run's report, and the bench of the code."""

from __future__ import annotations

import json

import numpy as np
import pytest

import scenarios.studies.codes.measure
from cosim import Clock, Viform
from cosim.config.amounts import count, number
from cosim.files import open_stream
from cosim.files.npz import write_npz
from scenarios.studies.codes import draw, markdown
from sensor.codec.coding import Code, recode
from sensor.codec.files import read_fsc
from sensor.codec.size import (
    LAYOUTS,
    coded_size,
    layout,
    measure_sizes,
    sample_places,
    size_metrics,
    size_rows,
    size_text,
    zstd_size,
)
from tests.scenarios.pages import page_of
from tests.scenarios.studies.bench.small import make_bench_small

CLOCK = Clock(40_000)


@pytest.fixture(scope="module")
def stream() -> Viform:
    """200 cycles of 8 x 16 pixels."""
    planes = np.random.default_rng(6).random((200, 8, 16)) < np.linspace(0, 0.5, 16)
    return Viform.from_planes(planes, CLOCK)


def sampled(stream) -> Viform:
    """The sample of a stream."""
    rows, columns = sample_places(stream.shape, stream.cycles)
    words = stream.read_words(0, 10**6)
    return Viform(words[:, rows, columns], stream.cycles, stream.clock)


@pytest.fixture
def recording(stream, tmp_path):
    path = tmp_path / "a.npz"
    write_npz(stream, path)
    return path


@pytest.mark.parametrize("options", [[], ["--code", "line"], ["--code", "repeat"]])
def test_a_lossless_file_gives_the_stream_back(viform, recording, stream, tmp_path, options):
    assert viform("convert", recording, tmp_path / "b.fsc", *options).code == 0
    assert read_fsc(tmp_path / "b.fsc")[1].name == (options or ["", "line"])[1]
    code, _, err = viform("convert", tmp_path / "b.fsc", tmp_path / "c.zarr", "--json")
    assert (code, err) == (0, "")
    np.testing.assert_array_equal(open_stream(tmp_path / "c.zarr").read_words(0, 7), stream.words)
    assert viform("image", tmp_path / "b.fsc", "--at", 3, "--out", tmp_path / "b.png").code == 0
    assert viform("image", recording, "--at", 3, "--out", tmp_path / "a.png").code == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_lossy_file_says_so(viform, recording, stream, tmp_path):
    path = tmp_path / "b.fsc"
    options = ("--code", "statistical", "--k", 3, "--threshold", "1 ke")
    assert viform("convert", recording, path, *options, "--refine", 8,
                  "--threshold-noise", "5 e").code == 0  # fmt: skip
    code = Code("statistical", 3.0, 1000.0, 5.0, 8)
    assert read_fsc(path) == (recode(stream, code), code)
    said = (
        f"viform: {path} holds what is left of a stream: changes beyond 3 standard deviations at "
        "a threshold of 1000 e with noise of 5 e, means of 8 widths\n"
    )
    assert viform("convert", path, tmp_path / "c.npz").err == said
    assert viform("image", path, "--at", 3, "--out", tmp_path / "b.png").err == said


@pytest.mark.parametrize(
    ("out", "options", "expected"),
    [
        ("b.npz", ["--code", "line"],
         "--code must be given with a .fsc to write, not {out}; leave --code out"),
        ("b.npz", ["--k", 3], "--k must be given with a .fsc to write, not {out}; leave --k out"),
        ("b.fsc", ["--code", "jpeg"],
         "--code must be one of line, repeat, statistical, not 'jpeg'; choose one"),
        ("b.fsc", ["--k", 3],
         "--k must be given with --code statistical, not with line; leave --k out"),
        ("b.fsc", ["--code", "repeat", "--refine", 8],
         "--refine must be given with --code statistical, not with repeat; leave --refine out"),
        ("b.fsc", ["--code", "statistical", "--k", 3],
         "--code statistical must be given with --k and --threshold, not without; "
         "add --threshold '1000 e'"),
        ("b.fsc", ["--code", "statistical", "--threshold", "9 e"],
         "--code statistical must be given with --k and --threshold, not without; add --k 3"),
        ("b.fsc", ["--code", "statistical", "--k", 3, "--threshold", "9 lux"],
         "--threshold must be a charge such as '1000 e', not '9 lux'; write it so"),
        ("b.fsc", ["--code", "statistical", "--k", 0, "--threshold", "9 e"],
         "--k must be above 0 and at most 1000, not 0; write a value of these"),
        ("b.fsc", ["--code", "statistical", "--k", 3, "--threshold", "9 e",
                   "--threshold-noise", "10 e"],
         "--threshold-noise must be 0 to the threshold, not 10 e; write a value of these"),
        ("b.fsc", ["--code", "statistical", "--k", 3, "--threshold", "9 e", "--refine", 1],
         "--refine must be 0, or 2 to 255, not 1; write a value of these"),
    ],
)  # fmt: skip
def test_options_that_do_not_go_together_are_refused(refused, recording, tmp_path, out, options,
                                                     expected):  # fmt: skip
    path = tmp_path / out
    assert refused("convert", recording, path, *options) == expected.format(out=path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_a_file_of_another_size_or_that_is_damaged_is_refused(viform, refused, recording, tmp_path):
    path, out = tmp_path / "b.fsc", tmp_path / "c.npz"
    viform("convert", recording, path)
    assert refused("convert", path, out, "--size", "8x16") == (
        f"--size must be 16x8 for {path}, not 8x16; leave it out"
    )
    path.write_bytes(path.read_bytes()[:-1])
    assert refused("convert", path, out) == (
        f"{path} must be a whole first-spike file, not a file that is cut off; "
        "copy or convert it again"
    )
    assert refused("convert", tmp_path / "no.fsc", out).startswith("the stream must be readable")


# Sizes.


def test_planes_of_a_long_stream_are_laid_out_in_parts() -> None:
    words = np.random.default_rng(3).integers(0, 2**32, (79, 3, 8), np.uint32)
    words[-1] &= (1 << 4) - 1
    stream = Viform(words, 2500, Clock(40_000))
    planes = np.unpackbits(
        words.transpose(1, 2, 0).copy().view(np.uint8), axis=-1, bitorder="little"
    )[..., :2500]  # fmt: skip
    bits = np.unpackbits(np.frombuffer(layout(stream, "plane"), np.uint8), bitorder="little")
    assert np.array_equal(bits.reshape(2500, 3, 8), planes.transpose(2, 0, 1))


def test_the_three_orders_hold_the_same_bits(stream):
    planes = stream.planes()
    bits = np.unpackbits(np.frombuffer(layout(stream, "plane"), np.uint8), bitorder="little")
    np.testing.assert_array_equal(bits.reshape(planes.shape), planes)
    assert layout(stream, "word") == stream.words.tobytes()
    pixels = np.frombuffer(layout(stream, "pixel"), np.uint32).reshape(8, 16, 7)
    np.testing.assert_array_equal(np.moveaxis(pixels, 2, 0), stream.words)


def test_a_sample_is_spread_over_the_plane_and_whole_where_it_fits(stream):
    assert sampled(stream) == stream
    assert sample_places((1000, 1000), 20_000)[1].shape == (26, 128)
    assert sample_places((1000, 1000), 400_000)[1].shape == (16, 10)
    assert sample_places((1000, 1000), 10**7)[1].shape == (16, 8)
    height, width = 300, 700
    number = np.arange(height * width, dtype=np.uint32).reshape(1, height, width)
    words = np.concatenate([number, number + 1, number + 2])
    part = sampled(Viform(words, 96, CLOCK))
    assert part.shape == (128, 128)
    rows, columns = np.divmod(part.words[0], width)
    assert (np.diff(rows[:, 0].astype(int)) >= 2).all()
    assert (np.diff(columns.astype(int), axis=1) == 1).all()
    # Its runs start evenly over the width: 4.9 standard errors of uniform ones are far wider.
    assert abs(columns[:, 0].mean() - (width - 128) / 2) < 15
    np.testing.assert_array_equal(part.words[2], part.words[0] + 2)


def test_sizes_are_those_of_the_frames_and_of_zstd(stream):
    sizes = measure_sizes(stream, 128, 1000.0, 5.0)
    assert sizes.zstd == min(zstd_size(stream, 3).values())
    assert sizes.line == coded_size(stream, Code("line"))[0]
    assert sizes.repeat == coded_size(stream, Code("repeat"))[0]
    assert sizes.statistical == coded_size(stream, Code("statistical", 3.0, 1000.0, 5.0, 8))[0]
    assert (sizes.pixels, sizes.all_pixels) == (128, 128)
    metrics = size_metrics(sizes)
    assert metrics["size_first_spike"].value == min(sizes.line, sizes.repeat)
    assert {m.unit for m in metrics.values()} == {"bit/pixel-cycle"}
    rows = size_rows(sizes)
    assert [row[1] for row in rows[:3]] == ["1", number(sizes.zstd), number(sizes.repeat)]
    assert "the whole stream" in size_text(sizes)


def test_random_bits_are_not_made_smaller():
    # 2^18 fair coins hold 2^18 bits: whoever says less counts wrongly.
    words = np.random.default_rng(2).integers(0, 2**32, (64, 16, 8), dtype=np.uint32)
    coins = Viform(words, 2048, CLOCK)
    sizes = measure_sizes(coins, 128, 1.0, 0.0)
    assert min(sizes.zstd, sizes.repeat, sizes.line) > 0.999


def test_a_run_tells_the_size_of_its_stream(step_run):
    metrics = step_run.result.metrics
    stream = open_stream(step_run.folder)
    part = sampled(stream)
    assert metrics["size_line"].value == coded_size(part, Code("line"))[0]
    page = page_of(step_run.folder)
    assert "Size of the stream" in page
    assert f"a sample, {count(16_384)} of its {count(100_000)} pixels" in page
    assert f"<td>{number(metrics['size_zstd'].value)}</td>" in page


# The bench.


@pytest.fixture
def document(monkeypatch, device):
    """The bench over two small scenes and one steady light."""
    make_bench_small(monkeypatch, "code")
    return scenarios.studies.codes.measure.bench_code(device)


def test_the_bench_tells_still_from_moving_and_agrees_with_the_closed_forms(document, tmp_path):
    rows = {(r["scene"], r["shot_noise"]): r for r in document["sizes"]}
    still, moving = rows["step", False], rows["pan", False]
    # Eight bars: a line each pixel, and nothing else.
    assert still["sent"]["line"] * still["spike_rate"] * 640 == pytest.approx(1, abs=1e-9)
    assert still["line"] < min(still["repeat"], *(still["zstd"][f"{n}_3"] for n in LAYOUTS))
    assert moving["sent"]["line"] > 5 * still["sent"]["line"]
    for row in rows.values():
        assert row["psnr"]["stream"]["tfp"] > 20
        assert row["statistical"]["k5"] <= row["statistical"]["k1"]
        assert sorted(row["layered"].values()) == list(row["layered"].values())
        assert row["psnr"]["8"] == row["psnr"]["stream"]  # all layers: every bit
        assert row["psnr"]["3"]["tfp"] > row["psnr"]["k3"]["tfp"]
    (steady,) = document["steady"]
    assert steady["floor"] < min(steady["zstd"], steady["repeat"], steady["line"])
    for k in ("k1", "k2", "k3"):
        assert steady["measured"][k] == pytest.approx(steady["predicted"][k], rel=0.2)
    assert steady["level_error"]["stream"] < steady["level_error"]["k5r"]
    assert steady["level_error"]["k5r"] < steady["level_error"]["k5"] / 2
    text = markdown(document)
    assert text.count("| step | ") == text.count("| pan | ") == 6
    draw(document, tmp_path / ".a.png.part")
    assert (tmp_path / ".a.png.part").read_bytes().startswith(b"\x89PNG")


def test_the_bench_of_the_code_is_a_command(viform, refused, monkeypatch, tmp_path):
    empty: dict[str, list[object]] = {"sizes": [], "steady": []}
    monkeypatch.setattr("scenarios.studies.codes.bench_code", lambda device: empty)
    code, out, _ = viform("bench", "code", "--json")
    assert code == 0 and json.loads(out) == empty
    assert refused("bench", "--figure", tmp_path / "a.png") == (
        "--figure must be given with bench code, continuous, events, not without; leave it out"
    )
    assert refused("bench", "code", "--figure", "a.jpg").startswith("--figure must be a name")
