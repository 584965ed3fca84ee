"""`viform link send`: a stream file that holds the file, and one line for what cannot be.

`viform link receive`: a stream file in, a file or a verdict out.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from cosim import InputError, Viform
from cosim.files import open_stream, write_stream
from cosim.spikes.viform import unpack_planes
from link.layout import Layout
from link.mode import Mode
from link.sending import FileTransmission, PlaneStream, Transmission
from link.setting import payload_of
from scenarios.assemble.schema.loading import load
from scenarios.cli.link.files import link_receive, link_send
from tests.link.receiving.toy import CLOCK, MODE, small

send_app, receive_app = typer.Typer(), typer.Typer()
send_app.command()(link_send)
receive_app.command()(link_receive)
SMALL = ("--size", "192x160", "--cell", "2", "--ticks", "1", "--line", "4b6b", "--parity", "16")


@pytest.mark.parametrize("ending", ["zarr", "npz", "events.npz", "dat"])
def test_the_stream_holds_the_planes(tmp_path, ending):
    source, out = tmp_path / "note.txt", tmp_path / f"sent.{ending}"
    source.write_bytes(b"some bytes")
    result = CliRunner().invoke(send_app, [str(source), "--out", str(out), *SMALL, "--json"])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    sent = FileTransmission(Mode(192, 160, 2, 1, "4b6b", 16), b"some bytes", "note.txt")
    stream = open_stream(out, (192, 160) if ending == "dat" else None)
    assert said["planes"] == stream.cycles == sent.planes and said["clock_hz"] == 40_000
    assert stream.shape == (160, 192)
    words = sent.words(0, sent.planes)
    assert (stream.read_words(0, len(words)) == words).all()
    assert said["tags"] == list(Layout(sent.mode).mode.tags)
    assert unpack_planes(words, 0, 1).any()


def test_words_with_soft_decisions_are_sent(tmp_path):
    """And what a link sends, it receives."""
    source, out = tmp_path / "note.txt", tmp_path / "sent.npz"
    source.write_bytes(b"some bytes")
    options = ("--size", "192x160", "--line", "scrambled", "--rate", "0.84", "--json")
    result = CliRunner().invoke(send_app, [str(source), "--out", str(out), *options])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    mode = Mode(192, 160, 2, 2, "scrambled", None, 0.84)
    assert (said["parity"], said["rate"], said["tags"]) == (None, 0.84, list(mode.tags))
    link_receive(out, tmp_path / "got", "packed", True, None, False)
    assert (tmp_path / "got" / "received" / "note.txt").read_bytes() == b"some bytes"
    received = json.loads((tmp_path / "got" / "receive.json").read_text())
    assert (received["mode"]["parity"], received["mode"]["rate"]) == (None, 0.84)


def test_blocks_with_a_rate_each_are_sent(tmp_path):
    source, out = tmp_path / "note.bin", tmp_path / "sent.npz"
    source.write_bytes(bytes(range(256)) * 200)
    options = ("--size", "192x160", "--line", "scrambled", "--rates", "0.4,0.65x2,0.97", "--json")
    result = CliRunner().invoke(send_app, [str(source), "--out", str(out), *options])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["rates"][:2] == [[0.4, 1], [0.65, 2]] and said["rates"][2:] in ([], [[0.97, 1]])
    mode = Mode(192, 160, 2, 2, "scrambled", None, adaptive=True)
    assert (said["parity"], said["rate"], said["tags"]) == (None, None, list(mode.tags))
    link_receive(out, tmp_path / "got", "packed", True, None, False)
    assert (tmp_path / "got" / "received" / "note.bin").read_bytes() == source.read_bytes()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--rates", "0.9"), "--rates must be rates of 0.4, 0.5"),
        (("--rates", "0.97x0"), "with the number of its blocks"),
        (("--rates", "0.97", "--rate", "0.8"), "--rates must be given without --rate"),
        (("--rates", "0.97", "--line", "8b10b"), "--line must be scrambled"),
    ],
)
def test_rates_that_cannot_be_are_one_line(tmp_path, options, told):
    source = tmp_path / "a"
    source.write_bytes(b"abc")
    given = ("--size", "192x160", "--line", "scrambled", *options)
    result = CliRunner().invoke(send_app, [str(source), "--out", str(tmp_path / "a.npz"), *given])
    assert isinstance(result.exception, InputError) and told in str(result.exception)
    assert "\n" not in str(result.exception) and not (tmp_path / "a.npz").exists()


def test_an_empty_file_is_sent_and_run_alike(tmp_path):
    source, out = tmp_path / "nothing.txt", tmp_path / "sent.npz"
    source.touch()
    result = CliRunner().invoke(send_app, [str(source), "--out", str(out), *SMALL, "--json"])
    said = json.loads(result.stdout)
    assert result.exit_code == 0 and (said["bytes"], said["goodput_bps"]) == (0, 0)
    assert said["frames"] == said["frames_needed"] + said["frames_repair"] + said["frames_fill"]
    assert said["symbols"] == said["training"] + 6 * said["groups"] + said["closing"]
    payload = payload_of(load("light-link", [f"link.file={source}"])[1])
    assert (payload.name, payload.data) == ("nothing.txt", b"")


@pytest.mark.parametrize("overhead", [0.0, 0.05, 0.7])
@pytest.mark.parametrize("size", [0, 1, 5000])
def test_the_room_of_the_groups_is_filled_without_another_one(size, overhead):
    mode = Mode(192, 160, 2, 1, "4b6b", 16)

    def sent(length: int) -> Transmission:
        return FileTransmission(mode, bytes(length), "a.bin", overhead=overhead)

    small = sent(size)
    room = small.outbox.room
    assert room >= size and sent(room).planes == small.planes < sent(room + 1).planes
    assert sent(room).outbox.room == room


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--size", "961x960"), "--size must be a multiple of 32 from 128 to 4640 pixels, not 961"),
        (("--size", "big"), "--size must be WIDTHxHEIGHT such as 960x960, not 'big'"),
        (("--cell", "5"), "--cell must be one of 1, 2, 3, 4, 6, 8, 12, 16, not 5"),
        (
            ("--line", "nrz"),
            "--line must be one of none, manchester, 4b6b, 8b10b, scrambled, not nrz",
        ),
        (("--parity", "33"), "--parity must be one of 16, 32, 64, 128, not 33"),
        (
            ("--rate", "0.8"),
            "--line must be scrambled with a rate, not 8b10b",
        ),
        (
            ("--rate", "0.9", "--line", "scrambled"),
            "--rate must be one of 0.75, 0.8, 0.84, 0.88, 0.91, 0.935, 0.955, 0.97, not 0.9",
        ),
        (("--overhead", "nan"), "--overhead must be 0 or more, not nan"),
        (("--clock", "40 lux"), "--clock must be a frequency such as '40 kHz', not '40 lux'"),
        (("--out", "x.mp4"), "--out must be a name ending in .dat, .raw, .npz, .zarr"),
    ],
)
def test_bad_input_is_one_line(tmp_path, options, says):
    source, out = tmp_path / "note.txt", tmp_path / "sent.npz"
    source.write_bytes(b"some bytes")
    result = CliRunner().invoke(send_app, [str(source), "--out", str(out), *options])
    assert isinstance(result.exception, InputError)
    assert str(result.exception).startswith(says)
    assert not out.exists()


def test_a_file_that_is_not_there(tmp_path):
    for name in (tmp_path / "none", tmp_path):
        result = CliRunner().invoke(send_app, [str(name), "--out", str(tmp_path / "sent.npz")])
        assert isinstance(result.exception, InputError)
        assert str(result.exception).startswith("FILE must be a file that can be read, not")


DATA = np.random.Generator(np.random.Philox(key=8)).bytes(3000)


def test_a_file_is_written_only_when_it_is_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toy = small(DATA)
    planes = toy.planes()
    write_stream(Viform.from_planes(planes, CLOCK), tmp_path / "all.npz")
    write_stream(Viform.from_planes(planes[:110], CLOCK), tmp_path / "cut.npz")

    link_receive(tmp_path / "all.npz", tmp_path / "a", "joint", True, None, False)
    assert (tmp_path / "a/received/a.bin").read_bytes() == DATA
    assert capsys.readouterr().out.startswith("received: 3000 bytes")

    with pytest.raises(typer.Exit) as left:
        link_receive(tmp_path / "cut.npz", tmp_path / "b", "joint", True, None, True)
    assert left.value.exit_code == 1
    printed = json.loads(capsys.readouterr().out)
    assert printed["outcome"] == "failed" and printed["cause"] == "truncated"
    assert json.loads((tmp_path / "b/receive.json").read_text()) == printed
    assert not (tmp_path / "b/received").exists()


@pytest.mark.parametrize(
    ("cycles", "told"),
    [(40, "too few to find a panel in"), (90, "0 of unknown frames arrived"),
     pytest.param(149, "record to the end", marks=pytest.mark.slow)],
    ids=["before a tag", "in the training", "among the groups"],
)  # fmt: skip
def test_a_recording_cut_anywhere_is_truncated_and_hands_out_nothing(
    tmp_path: Path, cycles: int, told: str
) -> None:
    toy = small(DATA * 6)
    toy.cycles = cycles
    assert cycles < 14 + toy.sent.planes and cycles % 32
    write_stream(toy.stream(), tmp_path / "cut.zarr")
    got = CliRunner().invoke(
        receive_app, [str(tmp_path / "cut.zarr"), "--out", str(tmp_path / "got")]
    )
    assert got.exit_code == 1 and got.stdout.startswith("failed: ") and told in got.stdout
    said = json.loads((tmp_path / "got/receive.json").read_text())
    assert (said["cause"], said["file"], said["ticks"]) == ("truncated", None, cycles)
    assert not (tmp_path / "got/received").exists()


def test_what_cannot_be_read_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.npz").write_bytes(b"no stream")
    for path, detector in ((tmp_path / "x.npz", "joint"), (tmp_path / "none.npz", "joint"),
                           (tmp_path / "x.npz", "best")):  # fmt: skip
        with pytest.raises(InputError):
            link_receive(path, tmp_path / "out", detector, True, None, False)
    assert not (tmp_path / "out").exists()


def test_planes_that_end_with_the_light_are_received_whole(tmp_path: Path) -> None:
    """Every group is needed, and the last one ends with the stream."""
    sent = FileTransmission(MODE, DATA, "a.bin", overhead=0)
    write_stream(PlaneStream(sent, CLOCK), tmp_path / "sent.npz")
    link_receive(tmp_path / "sent.npz", tmp_path / "out", "joint", True, None, False)
    assert (tmp_path / "out/received/a.bin").read_bytes() == DATA
    told = json.loads((tmp_path / "out/receive.json").read_text())
    assert f"whole at tick {sent.data_end * sent.ticks}" in told["verdict"]
