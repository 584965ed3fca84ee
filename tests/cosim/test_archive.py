"""Arrays in archives: complete and checked, or refused."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.archive import ArchiveWriter, load_arrays, open_arrays

ARRAYS = {
    "words": np.random.default_rng(1).integers(0, 2**32, (3, 4, 5), np.uint32),
    "a/scalar": np.array(7),
    "text": np.array("identity"),
    "empty": np.zeros((0, 3)),
}


@pytest.fixture(scope="module", params=["stored", "compressed"])
def archive(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("archive") / "a.npz"
    save = np.savez if request.param == "stored" else np.savez_compressed
    save(path, **ARRAYS)
    return path


def same(arrays: dict[str, np.ndarray]) -> bool:
    return arrays.keys() == ARRAYS.keys() and all(
        np.array_equal(arrays[name], ARRAYS[name]) and arrays[name].dtype == ARRAYS[name].dtype
        for name in ARRAYS
    )


def test_what_numpy_saves_is_loaded(archive: Path) -> None:
    assert same(load_arrays(archive))


@settings(max_examples=100)
@given(st.data())
def test_damage_is_found_or_harmless(archive: Path, damage, data: st.DataObject) -> None:
    bad = archive.with_name("bad.npz")
    bad.write_bytes(damage(data, archive.read_bytes()))
    try:
        arrays = load_arrays(bad)
    except ValueError:
        return
    assert same(arrays)


@pytest.mark.parametrize("shape", ["(2, 4, 5)", "(3, 4, 9)", "(3, -4, 5)", "(3, 5, 4)"])
def test_a_damaged_shape_is_found_though_the_array_is_readable(tmp_path: Path, shape: str) -> None:
    # A shape that is too small would leave the member's checksum unread.
    path = tmp_path / "a.npz"
    np.savez(path, **ARRAYS)
    content = path.read_bytes()
    assert content.count(b"(3, 4, 5), }") == 1
    path.write_bytes(content.replace(b"(3, 4, 5), }", f"{shape}, }}".encode()))
    with pytest.raises(ValueError, match=r"."):
        load_arrays(path)


def member(header: bytes, body: bytes = b"") -> bytes:
    """A `.npy` with any header (version 2, whose length has four bytes)."""
    return b"\x93NUMPY\x02\x00" + len(header).to_bytes(4, "little") + header + body


HEADER = "{'descr': '%s', 'fortran_order': False, 'shape': %s, }"


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (member((HEADER % ("|u1", (2**62,))).encode()), "."),
        (member((HEADER % ("|u1", (10**15,))).encode()), "."),
        (member((HEADER % ("|u1", (2**70,))).encode()), "."),
        (member((HEADER % ("|u1", "(1,)" + " " * 10**6)).encode(), b"1"), "large"),
        (member((HEADER % ("|u1", "(" * 5000)).encode(), b"1"), "."),
        (member((HEADER % ("|O", (1,))).encode(), b"cos\nsystem\n(S'true'\ntR."), "[Oo]bject"),
        (member((HEADER % ("|u1", (2,))).encode(), b"1"), "."),
        (member((HEADER % ("|u1", (2,))).encode(), b"123"), "a.npy is longer than its array"),
        (member(b"\xff\xfe"), "."),
        (b"", "."),
    ],
    ids=["2^62", "a petabyte", "2^70", "huge header", "nested", "pickle", "short", "long", "text",
         "empty"],
)  # fmt: skip
def test_members_that_are_no_arrays_are_refused(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("a.npy", content)
    with pytest.raises(ValueError, match=says):
        load_arrays(path)


def test_a_directory_entry_whose_comment_swallows_the_next_is_found(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, **ARRAYS)
    content = bytearray(path.read_bytes())
    first, second, third, _ = (m.start() for m in re.finditer(b"PK\x01\x02", content))
    content[first + 32] = third - second
    path.write_bytes(content)
    with zipfile.ZipFile(path) as archive:
        assert len(archive.infolist()) == len(ARRAYS) - 1
    with pytest.raises(ValueError, match=r"words\.npy may hide another member"):
        load_arrays(path)


def test_other_members_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("readme.txt", "hello")
    with pytest.raises(ValueError, match=r"readme\.txt is no array"):
        load_arrays(path)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"\x93NUMPY", bytes(1000), b"PK\x05\x06"])
def test_a_file_that_is_no_archive_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="zip"):
        load_arrays(path)
    plain = io.BytesIO()
    np.save(plain, np.zeros(3))
    path.write_bytes(plain.getvalue())
    with pytest.raises(ValueError, match="zip"):
        load_arrays(path)


def test_a_file_that_is_not_there_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        load_arrays(tmp_path / "a.npz")
    with pytest.raises(IsADirectoryError):
        load_arrays(tmp_path)


def test_what_is_written_in_parts_is_what_numpy_loads(tmp_path: Path) -> None:
    words = ARRAYS["words"]
    with (tmp_path / "a.npz").open("wb") as file, ArchiveWriter(file) as archive:
        archive.write_parts("words", np.uint32, words.shape, (part for part in words))
        for name in ("a/scalar", "text", "empty"):
            archive.write(name, ARRAYS[name])
    assert same(load_arrays(tmp_path / "a.npz"))
    with np.load(tmp_path / "a.npz") as arrays:
        assert same(dict(arrays))


@pytest.mark.parametrize("parts", [0, 2, 4])
def test_parts_that_do_not_add_up_are_a_fault(tmp_path: Path, parts: int) -> None:
    file = io.BytesIO()
    with pytest.raises(ValueError, match=rf"a of shape \(3, 2\) got {2 * parts} elements"):
        ArchiveWriter(file).write_parts("a", np.uint8, (3, 2), [np.zeros(2, np.uint8)] * parts)


@pytest.mark.parametrize("count", [1, 7, 60, 1000])
def test_arrays_are_read_in_parts_side_by_side(archive: Path, count: int) -> None:
    with open_arrays(archive) as readers:
        assert {name: (r.shape, r.dtype) for name, r in readers.items()} == {
            name: (a.shape, a.dtype) for name, a in ARRAYS.items()
        }
        parts = []
        while (part := readers["words"].read(count)).size:
            parts.append(part)
        assert readers["text"].read(count)[0] == "identity"
        np.testing.assert_array_equal(np.concatenate(parts), ARRAYS["words"].ravel())
        assert max(map(len, parts)) <= count


@settings(max_examples=100)
@given(st.data())
def test_damage_is_met_in_parts_as_well(tmp_path_factory, damage, data: st.DataObject) -> None:
    path = tmp_path_factory.mktemp("parts") / "a.npz"
    np.savez_compressed(path, **ARRAYS)
    path.write_bytes(damage(data, path.read_bytes()))
    try:
        with open_arrays(path) as readers:
            found = {}
            for name, reader in readers.items():
                whole = int(np.prod(reader.shape))
                parts = [reader.read(whole // 2), reader.read(whole - whole // 2)]
                found[name] = np.concatenate(parts).reshape(reader.shape)
    except ValueError:
        return
    assert same(found) or found.keys() != ARRAYS.keys()  # a member that is not named is not seen


def test_a_shape_that_leaves_a_rest_is_found_in_parts(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, a=np.arange(36_000).reshape(9000, 4))  # more than is read at once
    content = path.read_bytes()
    assert content.count(b"(9000, 4)") == 1
    path.write_bytes(content.replace(b"(9000, 4)", b"(9000, 2)"))
    with open_arrays(path) as readers:
        assert readers["a"].read(5).tolist() == [0, 1, 2, 3, 4]
        with pytest.raises(ValueError, match="longer than its array"):
            readers["a"].read(18_000)
