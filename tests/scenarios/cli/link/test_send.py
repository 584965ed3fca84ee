"""`viform link send`: a stream file that holds the file, and one line for what cannot be."""

import json

import pytest
import typer
from typer.testing import CliRunner

from cosim import InputError
from cosim.files import open_stream
from cosim.spikes.viform import unpack_planes
from link.layout import Layout
from link.mode import Mode
from link.sending import FileTransmission, Transmission
from link.setting import payload_of
from scenarios.assemble.schema.loading import load
from scenarios.cli.link.receive import link_receive
from scenarios.cli.link.send import link_send

app = typer.Typer()
app.command()(link_send)
SMALL = ("--size", "192x160", "--cell", "2", "--ticks", "1", "--line", "4b6b", "--parity", "16")


@pytest.mark.parametrize("ending", ["zarr", "npz", "events.npz", "dat"])
def test_the_stream_holds_the_planes(tmp_path, ending):
    source, out = tmp_path / "note.txt", tmp_path / f"sent.{ending}"
    source.write_bytes(b"some bytes")
    result = CliRunner().invoke(app, [str(source), "--out", str(out), *SMALL, "--json"])
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
    result = CliRunner().invoke(app, [str(source), "--out", str(out), *options])
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
    result = CliRunner().invoke(app, [str(source), "--out", str(out), *options])
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
    result = CliRunner().invoke(app, [str(source), "--out", str(tmp_path / "a.npz"), *given])
    assert isinstance(result.exception, InputError) and told in str(result.exception)
    assert "\n" not in str(result.exception) and not (tmp_path / "a.npz").exists()


def test_an_empty_file_is_sent_and_run_alike(tmp_path):
    source, out = tmp_path / "nothing.txt", tmp_path / "sent.npz"
    source.touch()
    result = CliRunner().invoke(app, [str(source), "--out", str(out), *SMALL, "--json"])
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
    result = CliRunner().invoke(app, [str(source), "--out", str(out), *options])
    assert isinstance(result.exception, InputError)
    assert str(result.exception).startswith(says)
    assert not out.exists()


def test_a_file_that_is_not_there(tmp_path):
    for name in (tmp_path / "none", tmp_path):
        result = CliRunner().invoke(app, [str(name), "--out", str(tmp_path / "sent.npz")])
        assert isinstance(result.exception, InputError)
        assert str(result.exception).startswith("FILE must be a file that can be read, not")
