"""First-spike files: whole, refused when damaged, and no larger in memory than they say."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Clock, InputError, Viform
from sensor.codec.coding import Code, recode
from sensor.codec.columns import Damaged, pack_column, unpack_column
from sensor.codec.files import read_fsc, write_fsc

CODES = (Code("line"), Code("repeat"), Code("statistical", 3.0, 100.0, 2.0, 4))
HEAD = 96


@pytest.fixture(scope="module")
def stream() -> Viform:
    """1000 cycles of 3 x 4 pixels, from dark to bright, some of them steady."""
    random = np.random.default_rng(8)
    planes = random.random((1000, 3, 4)) < np.linspace(0, 0.6, 12).reshape(3, 4)
    planes[:, 1, :] = (np.arange(1000)[:, None] % np.array([3, 7, 20, 90])) == 0
    return Viform(Viform.from_planes(planes, Clock(1)).words, 1000, Clock(30_000_000, 1001), -5)


@pytest.mark.parametrize("code", CODES, ids=lambda code: code.name)
def test_a_file_holds_what_is_left_of_its_stream_and_says_by_what_code(stream, tmp_path, code):
    path = tmp_path / "a.fsc"
    assert write_fsc(stream, path, code) == path.stat().st_size
    again, how = read_fsc(path)
    assert how == code
    assert again == recode(stream, code)
    assert (again == stream) == code.lossless
    assert (again.clock, again.start) == (stream.clock, -5)


def test_a_head_is_what_the_format_says(stream, tmp_path):
    path = tmp_path / "a.fsc"
    write_fsc(stream, path, Code("statistical", 3.0, 100.0, 2.0, 4))
    data = path.read_bytes()
    assert data[:12] == b"VIFSC1\r\n\x02\x04\0\0"
    assert struct.unpack("<5I", data[12:32]) == (3, 4, 16, 16_384, 1000)
    assert struct.unpack("<qQQ3d", data[32:80]) == (-5, 30_000_000, 1001, 3.0, 100.0, 2.0)
    assert struct.unpack("<I", data[92:96])[0] == zlib.crc32(data[:92])


def refused(path) -> str:
    with pytest.raises(InputError) as caught:
        read_fsc(path)
    text = str(caught.value)
    assert text.startswith(f"{path} must be a whole first-spike file, not ") and "\n" not in text
    return text


def test_any_flipped_bit_and_any_cut_is_noticed(stream, tmp_path):
    path = tmp_path / "a.fsc"
    write_fsc(stream, path, Code("line"))
    data = path.read_bytes()
    random = np.random.default_rng(4)
    for at in [*range(HEAD + 8), *random.integers(HEAD, len(data), 100)]:
        damaged = bytearray(data)
        damaged[at] ^= 1 << int(random.integers(8))
        path.write_bytes(damaged)
        refused(path)
    for length in [0, 5, HEAD - 1, HEAD, HEAD + 3, len(data) - 1]:
        path.write_bytes(data[:length])
        refused(path)
    path.write_bytes(data + b"\0")
    assert "after its last frame" in refused(path)
    path.write_bytes(b"")
    refused(path)


def sealed(data: bytes) -> bytes:
    """The same file with every checksum made good, as far as its frames can be followed."""
    made = bytearray(data)
    made[92:96] = struct.pack("<I", zlib.crc32(made[:92]))
    at, number = HEAD, 0
    while at + 8 <= len(made):
        length = struct.unpack("<I", made[at : at + 4])[0]
        body = made[at + 8 : at + 8 + length]
        crc = zlib.crc32(body, zlib.crc32(struct.pack("<I", number)))
        made[at + 4 : at + 8] = struct.pack("<I", crc)
        at, number = at + 8 + length, number + 1
    return bytes(made)


@given(st.integers(0, 2), st.lists(st.tuples(st.integers(0, 10**6), st.binary(min_size=1,
       max_size=6)), min_size=1, max_size=3))  # fmt: skip
def test_a_file_whose_checksums_were_made_good_is_read_or_refused(tmp_path_factory, which, changes):
    folder = tmp_path_factory.getbasetemp()
    path = folder / "fuzz.fsc"
    random = np.random.default_rng(8)
    planes = random.random((700, 2, 3)) < 0.2
    write_fsc(Viform.from_planes(planes, Clock(40_000)), path, CODES[which])
    data = bytearray(path.read_bytes())
    for at, new in changes:
        at %= len(data)
        data[at : at + len(new)] = new[: len(data) - at]
    path.write_bytes(sealed(bytes(data)))
    try:
        again, _ = read_fsc(path)
    except InputError as exc:
        assert "\n" not in str(exc)
        return
    assert again.words.dtype == np.uint32


def test_a_short_file_cannot_ask_for_much_memory(stream, tmp_path):
    path = tmp_path / "a.fsc"
    write_fsc(stream, path, Code("line"))
    data = bytearray(path.read_bytes())
    data[12:20] = struct.pack("<II", 2**31, 2**31)
    path.write_bytes(sealed(bytes(data)))
    assert "cut off" in refused(path)
    # A column that says it has more values than its chunk can hold.
    at = HEAD + 8 + 1
    data = bytearray(path.read_bytes())
    data[12:20] = struct.pack("<II", 3, 4)
    data[at : at + 4] = struct.pack("<I", 2**31)
    path.write_bytes(sealed(bytes(data)))
    assert "a column's head" in refused(path)


@pytest.fixture(scope="module")
def dark(tmp_path_factory):
    """A file of about 100 bytes a band and chunk that is 32 MB of planes."""
    path = tmp_path_factory.mktemp("dark") / "dark.fsc"
    words = np.zeros((128, 250, 256), np.uint32)
    size = write_fsc(Viform(words, 4096, Clock(40_000)), path, Code("line"))
    assert size < words.nbytes / 1000
    return path, words.nbytes


def test_a_file_whose_planes_are_larger_than_what_is_free_is_refused(dark, monkeypatch):
    path, planes = dark
    free = SimpleNamespace(available=planes)
    monkeypatch.setattr("cosim.compute.memory.psutil.virtual_memory", lambda: free)
    with pytest.raises(InputError, match=r"in memory must be small enough for the 0\.0305 GiB"):
        read_fsc(path)
    free.available = 4 * planes
    assert not read_fsc(path)[0].words.any()
    free.available = path.stat().st_size - 1
    with pytest.raises(InputError, match=r"dark\.fsc must be small enough"):
        read_fsc(path)


@pytest.mark.parametrize("code", CODES, ids=lambda code: code.name)
def test_decoding_takes_no_more_memory_than_is_checked_for(stream, tmp_path, monkeypatch, code):
    path, asked = tmp_path / "a.fsc", []
    words = np.random.default_rng(2).integers(0, 2**32, (48, 128, 129), np.uint32)
    write_fsc(Viform(words, 48 * 32, Clock(40_000)), path, code)
    read_fsc(path)  # what is made once: compiled code, tables
    monkeypatch.setattr(
        "sensor.codec.coding.check_memory", lambda what, need, mend: asked.append(need)
    )
    tracemalloc.start()
    read_fsc(path)
    most = tracemalloc.get_traced_memory()[1] - path.stat().st_size
    tracemalloc.stop()
    assert words.nbytes < most < asked[0] + 2**20  # what Python itself takes


def test_memory_that_a_process_may_not_take_is_not_called_damage(dark, monkeypatch):
    def short(*_):
        raise MemoryError

    monkeypatch.setattr("sensor.codec.coding.decode_band", short)
    with pytest.raises(InputError, match="the memory that this process may take") as caught:
        read_fsc(dark[0])
    assert "\n" not in str(caught.value)


def test_a_file_of_another_version_is_refused(stream, tmp_path):
    path = tmp_path / "a.fsc"
    write_fsc(stream, path, Code("line"))
    data = bytearray(path.read_bytes())
    data[5:6] = b"2"
    path.write_bytes(sealed(bytes(data)))
    assert "another version" in refused(path)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="readable"):
        read_fsc(tmp_path / "no.fsc")


@given(st.lists(st.one_of(st.integers(0, 9), st.integers(0, 2**32 - 1)), max_size=300),
       st.sampled_from([None, 3]))  # fmt: skip
def test_columns_of_any_numbers_come_back(values, level):
    column = np.array(values, np.uint32)
    packed = pack_column(column, level)
    again, rest = unpack_column(memoryview(packed + b"rest"), len(values))
    np.testing.assert_array_equal(again, column)
    assert bytes(rest) == b"rest"


@given(st.binary(max_size=60))
def test_any_bytes_are_a_column_or_refused(data):
    try:
        column, rest = unpack_column(memoryview(data), 1000)
    except Damaged:
        return
    assert len(column) <= 1000 and len(rest) <= len(data)


def test_an_exp_golomb_code_is_the_textbook_one():
    # Order 0: 0 -> 1, 1 -> 01 0, 2 -> 01 1, 3 -> 001 00 (bits in the order they are written).
    bits = "1" + "010" + "011" + "00100"
    packed = pack_column(np.array([0, 1, 2, 3], np.uint32), None)
    assert packed[:9] == struct.pack("<BII", 0, 4, 2)
    assert np.unpackbits(np.frombuffer(packed[9:], np.uint8), bitorder="little").tolist() == [
        int(b) for b in bits.ljust(16, "0")
    ]
