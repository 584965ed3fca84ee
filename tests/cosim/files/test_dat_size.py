"""Size of a `.dat`: with head, from --size, from a config.yaml, from its length."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Clock, InputError, Viform
from cosim.files import notes_of, open_stream, write_stream
from cosim.files.dat import guess_size, write_dat
from cosim.spikes.viform import unpack_planes

DAT, HEAD, LARGE, PRINTED = 12_500, 13_000, 125_000, 11_250
CLOCK = Clock(40_000)


@pytest.fixture(scope="module")
def planes() -> np.ndarray:
    """3 cycles of 400 x 250 pixels."""
    return np.random.default_rng(5).random((3, 250, 400)) < 0.4


def with_head(planes: np.ndarray, seed: int | None = None) -> bytes:
    """The format from its definition; with a seed, columns 400 to 415 are noise."""
    frames = np.zeros((len(planes), 250, 416), np.uint8)
    if seed is not None:
        frames[:, :, 400:] = np.random.default_rng(seed).random((len(planes), 250, 16)) < 0.5
    frames[:, :, :400] = planes
    flat = frames[:, ::-1].reshape(len(planes), -1)
    return np.packbits(flat, axis=1, bitorder="little").tobytes()


def planes_in(path: Path, size: tuple[int, int] | None = None) -> np.ndarray:
    stream = open_stream(path, size)
    return unpack_planes(stream.read_words(0, -(-stream.cycles // 32)), 0, stream.cycles)


def test_what_is_written_with_head_is_the_formula(tmp_path: Path, planes: np.ndarray) -> None:
    path = tmp_path / "a.dat"
    write_dat(Viform.from_planes(planes, CLOCK), path, head=True)
    assert path.read_bytes() == with_head(planes)


@pytest.mark.parametrize("how", ["size", "length", "config"])
def test_the_head_is_no_part_of_the_image(tmp_path: Path, planes: np.ndarray, how: str) -> None:
    path = tmp_path / "a.dat"
    path.write_bytes(with_head(planes, seed=1))
    if how == "config":
        (tmp_path / "config.yaml").write_text("filename: a\nspike_w: 416\nspike_h: 250\n")
    stream = open_stream(path, (416, 250) if how == "size" else None)
    assert (stream.shape, stream.cycles) == ((250, 400), 3)
    np.testing.assert_array_equal(unpack_planes(stream.read_words(0, 1), 0, 3), planes)
    said = (f"{path} is read as 400x250 with head, which its length says",)
    assert notes_of(stream) == (said if how == "length" else ())


def test_a_stream_as_wide_as_a_frame_with_head_is_not_written(tmp_path: Path) -> None:
    wide = Viform.from_planes(np.ones((1, 250, 416), bool), CLOCK)
    with pytest.raises(InputError, match="must be another than 416x250, which is read as 400x250"):
        write_stream(wide, tmp_path / "a.dat")
    with pytest.raises(InputError, match="written with --head must be 400x250, not 416x250"):
        write_stream(wide, tmp_path / "a.dat", head=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("length", "size", "note"),
    [
        (0, (400, 250), None),
        (301 * DAT, (400, 250), None),
        (7 * HEAD, (416, 250), "{path} is read as 400x250 with head, which its length says"),
        (500 * DAT, (400, 250), "{path} is read as 400x250 (500 frames); it may be 1000x1000 "
         "(50 frames): --size says which"),
        (LARGE, (400, 250), "{path} is read as 400x250 (10 frames); it may be 1000x1000 "
         "(1 frame): --size says which"),
        (301 * DAT + 1, (400, 250), None),
        (301 * PRINTED, (450, 200), "{path} is read as 450x200 (301 frames), which its length "
         "says"),
        (320 * PRINTED, (400, 250), "{path} is read as 400x250 (288 frames); it may be 450x200 "
         "(320 frames): --size says which"),
        (52 * PRINTED, (416, 250), "{path} is read as 400x250 with head, which its length says; it "
         "may be 450x200 (52 frames): --size says which"),
    ],
)  # fmt: skip
def test_the_length_tells_the_size(length: int, size: tuple[int, int], note: str | None) -> None:
    path = Path("a.dat")
    expected = (note.format(path=path),) if note else ()
    assert guess_size(path, length) == (size, expected)


@pytest.mark.parametrize(
    ("length", "given"),
    [
        (26 * DAT, "325000 bytes, which fit 400x250 (26 frames) and 416x250 with head (25); give "
         "--size 400x250, --size 416x250"),
        (130 * DAT, "1625000 bytes, which fit 400x250 (130 frames) and 416x250 with head (125) and "
         "1000x1000 (13 frames); give --size 400x250, --size 416x250, --size 1000x1000"),
    ],
)  # fmt: skip
def test_a_length_that_fits_two_sizes_is_refused(length: int, given: str) -> None:
    with pytest.raises(InputError) as refused:
        guess_size(Path("a.dat"), length)
    assert str(refused.value) == f"a.dat must be of a size that its length tells, not {given}"


@given(st.integers(1, 4000), st.sampled_from([DAT, HEAD, LARGE, PRINTED]))
def test_no_length_is_silently_taken_for_another_size(frames: int, frame: int) -> None:
    true = {DAT: (400, 250), HEAD: (416, 250), LARGE: (1000, 1000), PRINTED: (450, 200)}[frame]
    try:
        size, notes = guess_size(Path("a.dat"), frames * frame)
    except InputError as exc:
        assert "--size 416x250" in str(exc)
        return
    named = {LARGE: "1000x1000", PRINTED: "450x200"}.get(frame, "no other")
    assert size == true or (notes and named in notes[0])


def test_size_settles_what_is_ambiguous(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    content = np.random.default_rng(3).bytes(130 * DAT)
    path.write_bytes(content)
    (tmp_path / "config.yaml").write_text("filename: a\nspike_w: 416\nspike_h: 250\n")
    for size, cycles in (((400, 250), 130), ((416, 250), 125), ((1000, 1000), 13), (None, 125)):
        stream = open_stream(path, size)
        assert stream.cycles == cycles
        assert notes_of(stream) == ()
    write_stream(open_stream(path, (1000, 1000)), tmp_path / "b.dat")
    assert (tmp_path / "b.dat").read_bytes() == content


@pytest.mark.parametrize(
    ("shape", "cycles", "head", "said"),
    [
        ((250, 400), 7, False, None),
        ((250, 400), 10, False, None),
        ((250, 400), 7, True, None),
        ((250, 400), 26, False, "{path} does not keep its size: read it with --size 400x250"),
        ((250, 400), 25, True, "{path} does not keep its size: read it with --size 416x250"),
        ((1000, 1000), 1, False, "{path} does not keep its size: read it with --size 1000x1000"),
        ((3, 8), 7, False, "{path} does not keep its size: read it with --size 8x3"),
    ],
)
def test_a_size_that_will_not_be_guessed_is_said_when_written(
    tmp_path: Path, shape: tuple[int, int], cycles: int, head: bool, said: str | None
) -> None:
    path = tmp_path / "a.dat"
    stream = Viform.from_planes(np.ones((cycles, *shape), bool), CLOCK)
    assert write_stream(stream, path, head=head) == ([said.format(path=path)] if said else [])
    assert write_stream(stream, path, head=head, config=True) == []
    assert planes_in(path).shape == (cycles, *shape)


def test_clock_and_start_that_are_lost_are_said(tmp_path: Path, random_stream) -> None:
    path = tmp_path / "a.dat"
    lines = write_stream(random_stream(clock=Clock(20_000), start=640), path, config=True)
    assert lines == [
        f"{path} does not keep the clock of 20 kHz: it is read as 40 kHz",
        f"{path} does not keep that the first cycle is 640: it is read as 0",
    ]
