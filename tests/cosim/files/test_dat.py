"""`.dat`: the packing formula byte for byte, a real recording, and other files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import InputError, Viform
from cosim.files import open_stream
from cosim.files.dat import DAT_CLOCK, DatStream, check_dat_size, write_dat
from cosim.spikes.viform import count_spikes, words_for


def formula(planes: np.ndarray) -> bytes:
    """The format from its definition: (T, H, W) of 0 and 1 to bytes."""
    flat = planes[:, ::-1].reshape(len(planes), -1)
    return np.packbits(flat, axis=1, bitorder="little").tobytes()


def read(stream: DatStream) -> Viform:
    return Viform(stream.read_words(0, words_for(stream.cycles)), stream.cycles, stream.clock)


@st.composite
def random_planes(draw: st.DrawFn) -> np.ndarray:
    """(T, H, W) with H W a multiple of 8."""
    shapes = [(1, 8), (8, 1), (4, 2), (2, 4), (3, 8), (5, 16), (6, 20)]
    height, width = draw(st.sampled_from(shapes))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return rng.random((draw(st.integers(1, 100)), height, width)) < 0.5


@given(random_planes())
def test_what_is_written_is_the_packing_formula(tmp_path_factory, planes: np.ndarray) -> None:
    path = tmp_path_factory.mktemp("dat") / "a.dat"
    write_dat(Viform.from_planes(planes, DAT_CLOCK), path)
    assert path.read_bytes() == formula(planes)


@given(random_planes())
def test_what_the_formula_writes_is_read(tmp_path_factory, planes: np.ndarray) -> None:
    path = tmp_path_factory.mktemp("dat") / "a.dat"
    path.write_bytes(formula(planes))
    stream = DatStream(path, (planes.shape[2], planes.shape[1]))
    assert (stream.cycles, stream.shape, stream.clock) == (len(planes), planes.shape[1:], DAT_CLOCK)
    np.testing.assert_array_equal(read(stream).planes(), planes)
    if stream.cycles > 32:
        np.testing.assert_array_equal(stream.read_words(1, 2), read(stream).words[1:2])


def test_one_spike_sets_the_bit_that_the_format_says(tmp_path: Path) -> None:
    # Cycle 1, second row from the top of 250, column 9: 248 rows of 50 bytes come before it.
    planes = np.zeros((2, 250, 400), np.uint8)
    planes[1, 1, 9] = 1
    path = tmp_path / "a.dat"
    write_dat(Viform.from_planes(planes, DAT_CLOCK), path)
    content = path.read_bytes()
    assert len(content) == 2 * 12_500
    assert np.flatnonzero(np.frombuffer(content, np.uint8)).tolist() == [12_500 + 248 * 50 + 1]
    assert content[12_500 + 248 * 50 + 1] == 1 << 1


def test_a_real_recording_comes_back_byte_for_byte(shared_data: Path, tmp_path: Path) -> None:
    source = shared_data / "reds_200_part1.dat"
    stream = open_stream(source)
    assert (stream.cycles, stream.shape) == (301, (250, 400))
    write_dat(stream, tmp_path / "a.dat")
    assert (tmp_path / "a.dat").read_bytes() == source.read_bytes()


def test_a_real_recording_stands_upright(shared_data: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    truth = cv2.imread(str(shared_data / "reds_200_part1_gt.png"), cv2.IMREAD_GRAYSCALE)
    stream = open_stream(shared_data / "reds_200_part1.dat")
    image = count_spikes(stream, 130, 171)

    def likeness(other: np.ndarray) -> float:
        return float(np.corrcoef(image.ravel(), other.ravel())[0, 1])

    assert likeness(truth) > 0.97
    assert max(likeness(truth[::-1]), likeness(truth[:, ::-1])) < 0.5


@pytest.mark.parametrize("size", [(3, 3), (1, 1), (399, 250), (0, 8), (8, 0), (-8, 8), (-8, -8)])
def test_a_size_that_is_no_whole_number_of_bytes_is_refused(
    tmp_path: Path, random_stream, size: tuple[int, int]
) -> None:
    width, height = size
    says = (
        "the size of a .dat frame must be WIDTHxHEIGHT with a product that is a multiple of 8, "
        f"not {width}x{height}; use .npz or .zarr for other sizes"
    )
    with pytest.raises(InputError) as refused:
        check_dat_size(width, height)
    assert str(refused.value) == says
    path = tmp_path / "a.dat"
    path.write_bytes(bytes(72))
    with pytest.raises(InputError) as refused:
        DatStream(path, size)
    assert str(refused.value) == says
    if width > 0 and height > 0:
        with pytest.raises(InputError):
            write_dat(random_stream(shape=(height, width)), tmp_path / "b.dat")
        assert [p.name for p in tmp_path.iterdir()] == ["a.dat"]


@pytest.mark.parametrize(
    ("length", "given"),
    [
        (0, "0 bytes"),
        (5, "5 bytes, which is 0 frames and 5 bytes over"),
        (3 * 12_500 - 1, "37499 bytes, which is 2 frames and 12499 bytes over"),
    ],
)
def test_a_file_of_broken_frames_is_refused(tmp_path: Path, length: int, given: str) -> None:
    path = tmp_path / "a.dat"
    path.write_bytes(bytes(length))
    with pytest.raises(InputError) as refused:
        open_stream(path)
    assert str(refused.value) == (
        f"{path} must be whole frames of 12500 bytes (400x250), not {given}; "
        "give its true size (--size, or sensor.width and sensor.height), or take a whole file"
    )


@given(
    length=st.integers(0, 200),
    size=st.none() | st.tuples(st.integers(-2, 20), st.integers(-2, 20)),
)
def test_any_length_and_size_is_read_or_refused(tmp_path_factory, length: int, size) -> None:
    path = tmp_path_factory.mktemp("dat") / "a.dat"
    content = np.random.default_rng(length).bytes(length)
    path.write_bytes(content)
    try:
        stream = open_stream(path, size)
    except InputError:
        if size is not None and min(size) > 0 and size[0] * size[1] % 8 == 0:
            assert length == 0 or length % (size[0] * size[1] // 8)
        return
    assert formula(read(stream).planes()) == content
