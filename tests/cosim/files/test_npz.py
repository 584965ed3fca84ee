"""`.npz`: round trips, archives of other programs, one-line errors for other files."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import Clock, InputError, Viform
from cosim.files import open_stream
from cosim.files.npz import read_npz, write_npz

PLANES = np.random.default_rng(2).random((45, 3, 5)) < 0.3


@pytest.mark.parametrize("cycles", [1, 31, 32, 75, 128])
def test_nothing_is_lost(tmp_path: Path, random_stream, cycles: int) -> None:
    stream = random_stream(cycles, (3, 5), clock=Clock(2997, 100), start=192)
    write_npz(stream, tmp_path / "a.npz")
    again = read_npz(tmp_path / "a.npz")
    assert again == stream
    assert again.clock.den == 100


def test_it_is_an_ordinary_numpy_archive(tmp_path: Path, random_stream) -> None:
    stream = random_stream(75, clock=Clock(2997, 100), start=64)
    write_npz(stream, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        np.testing.assert_array_equal(file["words"], stream.words)
        assert [int(file["cycles"]), *file["clock"], int(file["start"])] == [75, 2997, 100, 64]


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.int64, np.uint16])
@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_archives_of_others_are_read(tmp_path: Path, dtype, save) -> None:
    save(tmp_path / "a.npz", spk=PLANES.astype(dtype), rate=np.array(40_000.0), label=np.zeros(3))
    stream = read_npz(tmp_path / "a.npz")
    np.testing.assert_array_equal(stream.planes(), PLANES)
    assert stream.clock == Clock(40_000)


def test_a_fortran_ordered_array_is_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", spikes=np.asfortranarray(PLANES))
    np.testing.assert_array_equal(read_npz(tmp_path / "a.npz").planes(), PLANES)


OURS = {
    "words": np.ones((2, 3, 4), np.uint32),
    "cycles": np.array(40),
    "clock": np.array([40_000, 1]),
    "start": np.array(0),
}


@pytest.mark.parametrize(
    ("arrays", "given"),
    [
        ({}, "a file that cannot be read (it holds no arrays)"),
        ({"a": PLANES[0]}, "arrays ['a']"),
        ({"a": PLANES, "b": PLANES}, "arrays ['a', 'b']"),
        ({"a": PLANES * 2}, "arrays ['a']"),
        ({"a": PLANES.astype(float)}, "arrays ['a']"),
        ({"a": PLANES - np.ones(PLANES.shape, np.int8)}, "arrays ['a']"),
        ({"a": PLANES[:0]}, "arrays ['a']"),
        ({"a": PLANES[:, :0]}, "arrays ['a']"),
        ({"words": OURS["words"]}, "one without 'cycles'"),
        (OURS | {"cycles": np.array(65)}, "one where 65 cycles must lie in 3 words, not 2"),
        (OURS | {"cycles": np.array(0)}, "one where 0 cycles must lie in 0 words, not 2"),
        (OURS | {"cycles": np.array(-40)}, "one where -40 cycles must lie in"),
        (OURS | {"cycles": np.array(40.5)}, "one where"),
        (OURS | {"cycles": np.array(np.inf)}, "one where"),
        (OURS | {"cycles": np.array("40")}, "one where"),
        (OURS | {"cycles": np.array([40, 41])}, "one where"),
        (OURS | {"words": OURS["words"].astype(np.int32)}, "one where words must be (n, H, W)"),
        (OURS | {"words": OURS["words"].astype(">u4")}, "one where words must be (n, H, W)"),
        (OURS | {"words": OURS["words"][0]}, "one where words must be (n, H, W)"),
        (OURS | {"words": OURS["words"][:, :0]}, "one without pixels"),
        (OURS | {"words": OURS["words"] << np.uint32(8)}, "one where spikes must lie within 40"),
        (OURS | {"clock": np.array([40_000])}, "one where"),
        (OURS | {"clock": np.array(40_000)}, "one where"),
        (OURS | {"clock": np.array([40_000, 0])}, "one where clock frequency must be positive"),
        (OURS | {"clock": np.array([4e4, 1.0])}, "one where"),
        (OURS | {"start": np.array("now")}, "one where"),
    ],
)
def test_archives_that_hold_no_stream_are_refused(tmp_path: Path, arrays, given: str) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, **arrays)
    with pytest.raises(InputError) as refused:
        read_npz(path)
    text = str(refused.value)
    assert text.startswith(f"{path} must be an .npz with `words`")
    assert f", not {given}" in text
    assert text.endswith("; save the spikes with numpy.savez(path, spikes=array)")


def test_pickled_arrays_are_refused_and_never_run(tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return Path.touch, (tmp_path / "sprung",)

    path = tmp_path / "a.npz"
    np.savez(path, spikes=np.array([Trap()], object))
    with pytest.raises(InputError, match="Object arrays cannot be loaded"):
        read_npz(path)
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_a_header_that_promises_too_much_is_refused(tmp_path: Path, compression: int) -> None:
    path = tmp_path / "a.npz"
    header = b"{'descr': '|b1', 'fortran_order': False, 'shape': (1000000, 10000, 10000)}"
    with zipfile.ZipFile(path, "w", compression) as file:
        file.writestr("spikes.npy", b"\x93NUMPY\x01\x00" + bytes([len(header), 0]) + header + b"\1")
    with pytest.raises(InputError, match="not a file that cannot be read"):
        read_npz(path)


@given(st.binary(max_size=300), st.booleans())
def test_random_bytes_are_refused(tmp_path_factory, content: bytes, magic: bool) -> None:
    path = tmp_path_factory.mktemp("npz") / "a.npz"
    path.write_bytes(b"PK\x03\x04" + content + b"PK\x05\x06" if magic else content)
    with pytest.raises(InputError, match=r"must be an \.npz"):
        read_npz(path)


@settings(max_examples=100)
@given(st.data(), st.sampled_from(["ours", "foreign"]))
def test_damage_is_refused_or_harmless(
    tmp_path_factory, damage, random_stream, data: st.DataObject, whose: str
) -> None:
    path = tmp_path_factory.mktemp("npz") / "a.npz"
    if whose == "ours":
        stream = random_stream(75)
        write_npz(stream, path)
    else:
        stream = Viform.from_planes(PLANES, Clock(40_000))
        np.savez(path, spikes=PLANES)
    path.write_bytes(damage(data, path.read_bytes()))
    try:
        again = open_stream(path)
    except InputError:
        return
    assert again == stream
