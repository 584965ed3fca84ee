"""Any stream in any format: round trips, atomic writing, one-line errors."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import numpy as np
import pytest

from cosim import Clock, InputError, Viform
from cosim.files import FORMATS, open_stream, write_stream
from cosim.files.atomic import atomic_write
from cosim.spikes.viform import words_for

ANY_SIZE = [ending for ending in FORMATS if ending != ".raw"]
"""Formats that hold the small streams of these tests."""
KEEPS_CLOCK = [".npz", ".zarr", ".events.npz"]


def in_memory(stream) -> Viform:
    words = stream.read_words(0, words_for(stream.cycles))
    return Viform(words, stream.cycles, stream.clock, getattr(stream, "start", 0))


class Broken:
    """A stream that fails in the middle."""

    shape, cycles, clock = (3, 8), 200, Clock(40_000)

    def read_words(self, first: int, stop: int) -> np.ndarray:
        if stop > 4:
            raise RuntimeError("the source broke")
        return np.ones((stop - first, *self.shape), np.uint32)


@pytest.mark.parametrize("chain", list(itertools.permutations(ANY_SIZE)), ids="-".join)
@pytest.mark.parametrize("cycles", [1, 75, 200])
def test_spikes_survive_every_chain_of_formats(
    tmp_path: Path, random_stream, chain: tuple[str, ...], cycles: int
) -> None:
    stream = random_stream(cycles)
    opened = stream
    for ending in chain:
        path = tmp_path / f"a{ending}"
        write_stream(opened, path)
        opened = open_stream(path, (8, 3))
    assert in_memory(opened) == stream
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(f"a{ending}" for ending in chain)


@pytest.mark.parametrize("chain", list(itertools.permutations(KEEPS_CLOCK)), ids="-".join)
def test_clock_and_start_survive_where_the_format_has_a_place_for_them(
    tmp_path: Path, random_stream, chain: tuple[str, ...]
) -> None:
    stream = random_stream(75, (3, 5), clock=Clock(2997, 100), start=640)
    opened = stream
    for ending in chain:
        write_stream(opened, tmp_path / f"a{ending}")
        opened = open_stream(tmp_path / f"a{ending}")
        assert in_memory(opened) == stream


@pytest.mark.parametrize("ending", ANY_SIZE)
def test_endings_count_in_any_case(tmp_path: Path, random_stream, ending: str) -> None:
    write_stream(random_stream(), tmp_path / f"a{ending.upper()}")
    assert in_memory(open_stream(tmp_path / f"a{ending.upper()}", (8, 3))) == random_stream()


def test_the_folder_of_a_run_stands_for_its_stream(tmp_path: Path, random_stream) -> None:
    write_stream(random_stream(), tmp_path / "stream.zarr")
    assert in_memory(open_stream(tmp_path)) == random_stream()


@pytest.mark.parametrize("ending", ANY_SIZE)
@pytest.mark.parametrize("there", [False, True])
def test_a_writer_that_breaks_off_leaves_everything_as_it_was(
    tmp_path: Path, random_stream, ending: str, there: bool
) -> None:
    path = tmp_path / f"a{ending}"
    if there:
        write_stream(random_stream(), path)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(RuntimeError, match="the source broke"):
        write_stream(Broken(), path)
    assert sorted(tmp_path.iterdir()) == before
    if there:
        assert in_memory(open_stream(path, (8, 3))) == random_stream()


@pytest.mark.parametrize("ending", ANY_SIZE)
def test_a_stream_can_be_written_over_another(tmp_path: Path, random_stream, ending: str) -> None:
    path = tmp_path / f"a{ending}"
    write_stream(random_stream(200), path)
    write_stream(random_stream(75, seed=9), path)
    assert in_memory(open_stream(path, (8, 3))) == random_stream(75, seed=9)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("ending", ANY_SIZE)
def test_a_folder_of_the_users_own_is_not_replaced(
    tmp_path: Path, random_stream, ending: str
) -> None:
    path = tmp_path / f"a{ending}"
    path.mkdir()
    (path / "thesis.tex").touch()
    with pytest.raises(InputError) as refused:
        write_stream(random_stream(), path)
    assert str(refused.value) == (
        f"{path} must be a new name, not a folder that is there; choose another name"
    )
    assert [p.name for p in tmp_path.rglob("*")] == [path.name, "thesis.tex"]


@pytest.mark.parametrize("ending", ANY_SIZE)
@pytest.mark.parametrize("place", ["missing/a", "file/a", "a" * 300])
def test_a_place_that_cannot_be_written_is_one_line(
    tmp_path: Path, random_stream, ending: str, place: str
) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="must be"):
        write_stream(random_stream(), tmp_path / f"{place}{ending}")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_the_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused, atomic_write(tmp_path / "runs/a.png"):
        pass
    assert str(refused.value) == (
        f"{tmp_path}/runs/a.png must be in a folder that exists, not in {tmp_path}/runs; "
        f"mkdir -p {tmp_path}/runs"
    )


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read anything")
@pytest.mark.parametrize("ending", ANY_SIZE)
def test_a_file_that_may_not_be_read_is_one_line(
    tmp_path: Path, random_stream, ending: str
) -> None:
    path = tmp_path / f"a{ending}"
    write_stream(random_stream(), path)
    path.chmod(0)
    try:
        with pytest.raises(InputError):
            open_stream(path, (8, 3))
    finally:
        path.chmod(0o755)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("absent.dat", "the stream must be a file that exists, not {path}; check the path"),
        (
            "a.mp4",
            f"the stream must be a {', '.join(FORMATS)} or the folder of a run, not {{path}};",
        ),
        (
            "empty",
            f"the stream must be a {', '.join(FORMATS)} or the folder of a run, not {{path}}, a "
            "folder without a stream; name a file in it",
        ),
        ("folder.dat", "{path} must be whole frames|the stream must be readable"),
        ("folder.npz", "the stream must be readable, not {path} "),
        (
            "folder.raw",
            "the stream must be readable, not {path} |{path} must be 1000x1000 raw words",
        ),
        ("folder.events.npz", "the stream must be readable, not {path} "),
        ("a" * 5000, "aaa (File name too long); check it"),
        ("nul\0.dat", "the stream must be a file that exists, not"),
    ],
)
def test_what_is_no_stream_is_one_line(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / "a.mp4").touch()
    for folder in ("empty", "folder.dat", "folder.npz", "folder.raw", "folder.events.npz"):
        (tmp_path / folder).mkdir()
    path = tmp_path / name
    with pytest.raises(InputError) as refused:
        open_stream(path)
    assert any(t.format(path=path) in str(refused.value) for t in text.split("|"))
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize("ending", KEEPS_CLOCK)
def test_a_size_that_contradicts_the_header_is_refused(
    tmp_path: Path, random_stream, ending: str
) -> None:
    path = tmp_path / f"a{ending}"
    write_stream(random_stream(), path)
    with pytest.raises(InputError) as refused:
        open_stream(path, (3, 8))
    assert str(refused.value) == f"--size must be 8x3 for {path}, not 3x8; leave it out"


def test_an_unknown_ending_is_refused_before_anything_is_written(
    tmp_path: Path, random_stream
) -> None:
    says = r"the output must be a name ending in \.dat, \.raw, \.npz, \.zarr, \.events\.npz, not "
    with pytest.raises(InputError, match=says):
        write_stream(random_stream(), tmp_path / "a.bin")
    assert not list(tmp_path.iterdir())
