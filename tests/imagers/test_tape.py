"""The tape of an interrupted run under damage: what remains of it is a sound beginning, or it is
refused. A run that is resumed from it gives the frames of a run that was left alone."""

from __future__ import annotations

import random
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import zarr

from cosim import InputError, Interrupted
from imagers.catalogue import IMAGERS
from imagers.run.tape import Tape
from sensor.frame_pixels import Exposed
from tests.imagers.linear_imager import LinearKind, LinearModel
from tests.imagers.test_machine import run

SHAPE = (4, 6)
RECORDS = 5
HEAD = 53
"""Bytes before the first record: name and version, and the digest of the run."""
RECORD = 4 * 8 + 2 * SHAPE[0] * SHAPE[1] + 4


def rows(frame: int) -> Exposed:
    return Exposed(np.zeros(SHAPE), np.ones(SHAPE[0]), np.zeros(SHAPE[0]), 0, frame)


def values(frame: int) -> np.ndarray:
    return np.random.default_rng(frame).integers(0, 4096, SHAPE).astype(np.uint16)


@pytest.fixture
def written(tmp_path: Path) -> bytes:
    tape = Tape(tmp_path / "written", "a run", False)
    for frame in range(RECORDS):
        tape.record(rows(frame), values(frame))
    tape.close()
    data = (tmp_path / "written").read_bytes()
    assert len(data) == HEAD + RECORDS * RECORD
    return data


def played(path: Path) -> int:
    """Number of records that a tape plays; their values are as they were recorded."""
    tape = Tape(path, "a run", True)
    try:
        for frame in range(RECORDS + 1):
            found = tape.play(rows(frame))
            if found is None:
                return frame
            np.testing.assert_array_equal(found, values(frame))
    finally:
        tape.close()
    raise AssertionError("more records than were written")


def test_every_flipped_bit_ends_the_tape_before_its_record(tmp_path: Path, written: bytes) -> None:
    path = tmp_path / "tape"
    for at in range(HEAD, len(written)):
        damaged = bytearray(written)
        damaged[at] ^= 1 << at % 8
        path.write_bytes(damaged)
        assert played(path) == (at - HEAD) // RECORD


@pytest.mark.parametrize("fill", [b"", b"\0"])
def test_a_tape_that_ends_or_is_zero_from_any_byte_on_is_torn(
    tmp_path: Path, written: bytes, fill: bytes
) -> None:
    """So it is when the machine stopped before the rest was on the disk."""
    path = tmp_path / "tape"
    for at in range(len(written)):
        rest = written[at:]
        path.write_bytes(written[:at] + fill * len(rest))
        gone = bool(rest.strip(b"\0")) or not fill  # zeros may have been there before
        assert played(path) == (max(at - HEAD, 0) // RECORD if gone else RECORDS)


def test_records_that_are_exchanged_lost_or_repeated_end_the_tape(
    tmp_path: Path, written: bytes
) -> None:
    path = tmp_path / "tape"
    head, *records = (written[:HEAD], *(
        written[HEAD + n * RECORD : HEAD + (n + 1) * RECORD] for n in range(RECORDS)
    ))  # fmt: skip
    for order, sound in (([0, 2, 1, 3, 4], 1), ([0, 1, 3, 4], 2), ([0, 1, 1, 2], 2), ([3], 0)):
        path.write_bytes(head + b"".join(records[n] for n in order))
        assert played(path) == sound


def test_a_flipped_bit_of_the_head_is_refused(tmp_path: Path, written: bytes) -> None:
    path = tmp_path / "tape"
    for at in range(HEAD):
        damaged = bytearray(written)
        damaged[at] ^= 1 << at % 8
        path.write_bytes(damaged)
        with pytest.raises(InputError, match="one of this same scenario, not one of another, or"):
            Tape(path, "a run", True)


def test_a_tape_goes_on_from_its_last_sound_record(tmp_path: Path, written: bytes) -> None:
    path = tmp_path / "tape"
    path.write_bytes(written[:-3])
    tape = Tape(path, "a run", True)
    while tape.play(rows(RECORDS - 1 - tape.remaining)) is not None:
        pass
    tape.record(rows(RECORDS - 1), values(RECORDS - 1))
    tape.close()
    assert path.read_bytes() == written


@pytest.fixture
def interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Path, Path]]:
    """Folders of a run that was interrupted after frame 5 and of one that was left alone."""
    monkeypatch.setitem(IMAGERS, "linear", LinearKind())
    run(tmp_path / "whole", LinearModel())
    with pytest.raises(Interrupted):
        run(tmp_path / "cut", LinearModel(broken=5))
    yield tmp_path / "cut", tmp_path / "whole"


@pytest.mark.parametrize("number", range(10))
def test_a_run_of_a_damaged_tape_gives_the_same_frames(
    tmp_path: Path, interrupted: tuple[Path, Path], number: int
) -> None:
    cut, whole = interrupted
    rng = random.Random(number)
    tape = bytearray((cut / "checkpoint.tape").read_bytes())
    at = rng.randrange(HEAD, len(tape))
    if number % 3 == 0:
        tape[at:] = bytes(len(tape) - at)
    elif number % 3 == 1:
        del tape[at:]
    else:
        tape[at] ^= 1 << rng.randrange(8)
    shutil.copytree(cut, tmp_path / "again")
    (tmp_path / "again" / "checkpoint.tape").write_bytes(tape)
    run(tmp_path / "again", LinearModel(), resume=True)
    found, expected = (
        zarr.open_group(folder / "frames.zarr", mode="r") for folder in (tmp_path / "again", whole)
    )
    assert dict(found.attrs) == dict(expected.attrs)
    for name in expected.array_keys():
        np.testing.assert_array_equal(found[name][:], expected[name][:])
