"""Refusals of a few commands say how to mend what they refuse, before anything is computed; those
of the parser are in the words of the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim import InputError
from cosim.files.opening import open_stream
from cosim.run.workers import check_workers
from scenarios.cli.entry import parser_refusal
from scenarios.cli.options import check_figure
from scenarios.studies.batch.axes import latin_hypercube, read_axis


@pytest.mark.parametrize(
    ("name", "endings", "says"),
    [
        ("a.gif", (), "--figure must be a name ending in .png, not {}/a.gif; try {}/a.png"),
        ("a", (".png", ".svg"), "--figure must be a name ending in .png or .svg, not {}/a; "
         "try {}/a.png"),
        ("no/a.png", (), "--figure must be in a folder that exists, not {}/no/a.png; "
         "create the folder"),
    ],
)  # fmt: skip
def test_a_figure_that_cannot_be_written_is_refused(tmp_path, name, endings, says):
    with pytest.raises(InputError) as caught:
        check_figure(tmp_path / name, *endings)
    assert str(caught.value) == says.replace("{}", str(tmp_path))
    check_figure(tmp_path / "a.PNG")
    check_figure(None)


def test_accuracy_refuses_a_figure_of_another_format_at_once(refused, tmp_path):
    assert refused("accuracy", "film", "--figure", tmp_path / "a.gif").startswith(
        "--figure must be a name ending in .png"
    )


def test_an_image_is_a_png_or_an_array(refused, tmp_path):
    said = refused("reconstruct", tmp_path / "s.dat", "--at", 1, "--out", tmp_path / "a.bmp")
    assert said.startswith("--out must be a name ending in .png or .npy, not ")


def test_a_source_without_a_name_is_not_the_current_folder(refused):
    said = refused("run", "playback", "--set", "sensor.source=file:")
    assert said == "sensor.source must be the name of a file, not 'file:'; write the name"


def run_folder(folder: Path, *stores: str) -> Path:
    folder.mkdir()
    (folder / "result.json").write_text("{}")
    for store in stores:
        (folder / store).mkdir()
    return folder


def test_a_run_without_a_stream_says_why_it_has_none(tmp_path):
    with pytest.raises(InputError, match="run it again without --store none"):
        open_stream(run_folder(tmp_path / "bare"))
    with pytest.raises(InputError, match="a run of frames; name the run of a spike camera"):
        open_stream(run_folder(tmp_path / "frames", "frames.zarr"))


@pytest.mark.parametrize(
    ("text", "mend"),
    [
        ("9:1:4", "write 1:9:4"), ("-1:9:4log", "raise the lower one"),
        ("2:2:4", "write two that differ"), ("1:9:1", "write 2 or more, such as 5"),
    ],
)  # fmt: skip
def test_ends_of_a_range_are_mended(text, mend):
    with pytest.raises(InputError) as caught:
        read_axis(f"image.at={text}")
    assert str(caught.value).endswith(f"; {mend}")


def test_numbers_out_of_a_range_are_sent_to_its_end():
    for workers, mend in ((0, "write 1"), (5000, "write 1024")):
        with pytest.raises(InputError, match=mend):
            check_workers(workers)
    with pytest.raises(InputError, match=r"write 1$"):
        latin_hypercube((), 0, 1)


def test_a_source_without_a_kind_is_named_before_what_its_chip_would_lack(refused, tmp_path):
    said = refused("run", "playback", "--set", "sensor.source=a.dat", "--out", tmp_path / "run")
    assert said == (
        "sensor.source must be file:PATH, pipe:PATH, serial:PORT or udp:HOST, not one without "
        "these; write --set sensor.source=file:PATH for a recording"
    )


def test_links_has_a_column_for_each_recording_of_one_name(viform, tmp_path):
    for name, share in (("a", 0.1), ("b", 0.5)):
        (tmp_path / name).mkdir()
        random = np.random.default_rng(3)
        spikes = random.random((64, 16, 16)) < share
        np.savez(tmp_path / name / "s.npz", spikes=spikes, clock_hz=40e3)
    streams = [tmp_path / name / "s.npz" for name in ("a", "b")]
    code, out, _ = viform("board", "links", *streams)
    assert code == 0
    assert all(f"{path} layered" in out for path in streams)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("board", "virtual", "--rows", "0"), "--rows must be at least 1, not '0'; see "),
        (("board", "virtual", "--rows=abc"), "--rows must be a whole number, not 'abc'; see "),
        (("view", "x", "--port", "99999"), "--port must be at most 65535, not '99999'; see "),
        (("board", "stream", "nope"),
         "SOURCE must be one of 'array', 'external', 'lines', not 'nope'; see "),
    ],
)  # fmt: skip
def test_a_value_that_the_parser_refuses(refused, arguments, says):
    assert refused(*arguments).startswith(says)


@pytest.mark.parametrize(
    ("group", "commands"),
    [
        ("link", "ber, capacity, send, receive"),
        ("design", "dynamic-range"),
        ("board", "identify, regs, prbs, bringup, capture, compare, stream, replay, virtual, "
         "gateware, links"),
    ],
)  # fmt: skip
def test_a_group_without_a_command_names_its_commands(refused, group, commands):
    assert refused(group) == (
        f"the command after `viform {group}` must be one of {commands}, not none; "
        f"see `viform {group} --help`"
    )


def test_other_texts_stay():
    for text in ("No such option: --x", "Invalid value for '--a': something else"):
        assert parser_refusal(text, ["--a", "1"]) == text
