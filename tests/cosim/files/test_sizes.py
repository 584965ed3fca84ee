"""Small files that state large contents: refused before anything of that size is in memory."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import zarr

from cosim import Clock, InputError, Viform
from cosim.archive import load_arrays
from cosim.files import ZarrStream, write_stream
from cosim.files.npz import read_npz
from cosim.files.zarr_store import content_size
from tests.measured import reading

MIB = 1 << 20
GIB = 1 << 30
LIMIT = GIB
"""Bytes that a process may take in these tests, beyond what it takes before."""
OPEN = (
    "from cosim.files import open_stream\nimport cosim.files.opening, cosim.files.zarr_store, zarr"
)


def opened(path: Path, most: int = LIMIT) -> tuple[str, int]:
    return reading(OPEN, f"s = open_stream(Path({str(path)!r})); s.read_words(0, 2)", most)


def archive(path: Path, head: bytes, zeros: int) -> int:
    """Writes an .npz of one array: a header, and so many bytes of 0. Returns the file's size."""
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file,
        file.open("a.npy", "w") as member,
    ):
        member.write(head)
        for _ in range(zeros // MIB):
            member.write(bytes(MIB))
    return path.stat().st_size


def test_an_archive_that_unpacks_to_more_than_half_of_the_memory_is_refused(tmp_path: Path) -> None:
    head = io.BytesIO()
    shape = (600, 1024, 1024)
    np.lib.format.write_array_header_1_0(
        head, {"descr": "|u1", "fortran_order": False, "shape": shape}
    )
    assert archive(tmp_path / "a.npz", head.getvalue(), 600 * MIB) < MIB
    said, took = opened(tmp_path / "a.npz")
    assert said.startswith(f"the arrays of {tmp_path / 'a.npz'}, twice, must be small enough")
    assert took < 50 * MIB
    said, took = opened(tmp_path / "a.npz", 3 * GIB)
    assert said == "read" and took < 2 * 600 * MIB


def test_a_header_of_gigabytes_is_not_read(tmp_path: Path) -> None:
    head = b"\x93NUMPY\x02\x00" + (600 * MIB).to_bytes(4, "little")
    assert archive(tmp_path / "a.npz", head, 600 * MIB) < MIB
    said, took = opened(tmp_path / "a.npz")
    assert f"the header of a.npy is too large: {600 * MIB} bytes" in said
    assert took < 50 * MIB
    with zipfile.ZipFile(tmp_path / "a.events.npz", "w") as file:
        file.writestr("time.npy", zipfile.ZipFile(tmp_path / "a.npz").read("a.npy")[:MIB])
    assert "too large" in opened(tmp_path / "a.events.npz")[0]


def test_an_array_that_its_member_does_not_hold_is_not_allocated(tmp_path: Path) -> None:
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"descr": "<f8", "fortran_order": False, "shape": (10**9,)}
    )
    archive(tmp_path / "a.npz", head.getvalue(), MIB)
    with pytest.raises(ValueError, match=r"a\.npy is shorter than its array"):
        load_arrays(tmp_path / "a.npz")


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_methods_that_numpy_does_not_write_are_refused(tmp_path: Path, method: int) -> None:
    data = io.BytesIO()
    np.save(data, np.zeros(3))
    with zipfile.ZipFile(tmp_path / "a.npz", "w", method) as file:
        file.writestr("a.npy", data.getvalue())
    with pytest.raises(ValueError, match="compressed by method"):
        load_arrays(tmp_path / "a.npz")


def test_planes_of_another_program_are_packed_in_parts(tmp_path: Path) -> None:
    planes = np.random.default_rng(2).integers(0, 2, (75, 5, 9))
    for dtype in (np.uint8, np.int64, bool):
        np.savez(tmp_path / "a.npz", spikes=planes.astype(dtype))
        np.testing.assert_array_equal(
            read_npz(tmp_path / "a.npz").words,
            Viform.from_planes(planes.astype(np.uint8), Clock(40_000)).words,
        )
    planes[70, 2, 3] = 2
    np.savez(tmp_path / "a.npz", spikes=planes)
    with pytest.raises(InputError, match="not arrays"):
        read_npz(tmp_path / "a.npz")


@pytest.fixture
def store(tmp_path: Path) -> Path:
    rng = np.random.default_rng(3)
    planes = (rng.random((64, 16, 20)) < 0.4).astype(np.uint8)
    write_stream(Viform.from_planes(planes, Clock(40_000)), tmp_path / "a.zarr")
    return tmp_path / "a.zarr"


def test_a_store_of_more_pixels_than_memory_holds_is_refused(store: Path) -> None:
    about = store / "words" / "zarr.json"
    told = json.loads(about.read_text())
    told["shape"] = [2, 20_000, 20_000]
    told["chunk_grid"]["configuration"]["chunk_shape"] = [2, 20_000, 20_000]
    about.write_text(json.dumps(told))
    said, took = opened(store)
    assert said.startswith(f"{store}, 20000x20000 pixels must be small enough for")
    assert took < 50 * MIB


def test_a_chunk_that_unpacks_to_more_than_a_chunk_is_not_unpacked(store: Path) -> None:
    codec = zarr.codecs.ZstdCodec(level=1)._zstd_codec
    (chunk,) = (store / "words" / "c").rglob("0/0/0")
    chunk.write_bytes(codec.encode(bytes(600 * MIB)))
    assert chunk.stat().st_size < MIB
    said, took = opened(store)
    assert said.startswith(f"{store} must be the stream.zarr of a finished run, not damaged in")
    assert took < 50 * MIB


@pytest.mark.parametrize("name", ["raw", "gzip", "blosc"])
def test_stores_of_other_codecs_are_refused(tmp_path: Path, name: str) -> None:
    other = {"raw": None, "gzip": zarr.codecs.GzipCodec(), "blosc": zarr.codecs.BloscCodec()}[name]
    group = zarr.create_group(tmp_path / "a.zarr")
    group.attrs.update(viform=1, cycles=64, clock=[40_000, 1], start=0, complete=True)
    group.create_array(
        "words", shape=(2, 4, 4), chunks=(2, 4, 4), dtype="uint32", compressors=other
    )[:] = 1
    if other is None:
        assert ZarrStream(tmp_path / "a.zarr").read_words(0, 2).all()
        return
    with pytest.raises(InputError, match=f"not one with chunks of bytes, {name}; "):
        ZarrStream(tmp_path / "a.zarr")


def test_what_a_store_names_is_not_loaded(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Zarr imports the code of any codec that is installed, and reads an older format too."""
    about = store / "words" / "zarr.json"
    told = json.loads(about.read_text())
    opened: list[object] = []
    monkeypatch.setattr("zarr.open_group", lambda *given, **_: opened.append(given))
    sharded = {"name": "sharding_indexed", "configuration": {}}
    whole = {"name": "zstd", "configuration": {"level": 1, "checksum": True}}
    first = told["codecs"][0]
    for changed in (
        {"codecs": [first, {"name": "numcodecs.pickle"}]}, {"codecs": [sharded]}, {"codecs": []},
        {"codecs": [whole, first]}, {"codecs": 7}, {"zarr_format": 2}, {"node_type": "group"},
    ):  # fmt: skip
        about.write_text(json.dumps(told | changed))
        with pytest.raises(InputError, match=r"must be the stream\.zarr of a finished run, not"):
            ZarrStream(store)
    about.write_bytes(b" " * (1 << 20) + json.dumps(told).encode())
    with pytest.raises(InputError, match="not something else"):
        ZarrStream(store)
    assert not opened


def test_a_store_of_format_2_is_refused(tmp_path: Path) -> None:
    group = zarr.create_group(tmp_path / "a.zarr", zarr_format=2)
    group.attrs.update(viform=1, cycles=64, clock=[40_000, 1], start=0, complete=True)
    group.create_array(
        "words", shape=(2, 4, 4), chunks=(2, 4, 4), dtype="uint32", compressors=None
    )[:] = 1
    with pytest.raises(InputError, match="not something else"):
        ZarrStream(tmp_path / "a.zarr")


@pytest.mark.parametrize("size", [0, 1, 255, 256, 257, 65_791, 65_792, 1 << 20])
@pytest.mark.parametrize("checksum", [False, True])
def test_the_size_that_a_frame_states(size: int, checksum: bool) -> None:
    codec = zarr.codecs.ZstdCodec(level=1, checksum=checksum)._zstd_codec
    assert content_size(codec.encode(bytes(size))[:18]) == size


@pytest.mark.parametrize(
    ("head", "size"),
    [
        (b"", None), (b"\x28\xb5\x2f\xfd", None), (b"\x28\xb5\x2f\xfd\x00\x58", None),
        (b"\x28\xb5\x2f\xfd\x20\x07", 7), (b"\x28\xb5\x2f\xfd\x60\x01\x00", 257),
        (b"\x28\xb5\x2f\xfd\xe3\x00\x00\x00\x00" + (1 << 40).to_bytes(8, "little"), 1 << 40),
        (b"\x28\xb5\x2f\xfd\x80\x58\x05\x00\x00", None), (b"\x22\xb5\x2f\xfd\x20\x07", None),
    ],
)  # fmt: skip
def test_headers_of_frames(head: bytes, size: int | None) -> None:
    """RFC 8878, 3.1.1.1: the descriptor's flags, a dictionary's number, 256 that two bytes leave
    out, and headers that are cut."""
    assert content_size(head) == size
