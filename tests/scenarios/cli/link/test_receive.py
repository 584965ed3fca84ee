"""`viform link receive`: a stream file in, a file or a verdict out."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from cosim import InputError, Viform
from cosim.files import write_stream
from link.sending import FileTransmission, PlaneStream
from scenarios.cli.link.receive import link_receive
from tests.link.receiving.toy import CLOCK, MODE, small

app = typer.Typer()
app.command()(link_receive)
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
    got = CliRunner().invoke(app, [str(tmp_path / "cut.zarr"), "--out", str(tmp_path / "got")])
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
