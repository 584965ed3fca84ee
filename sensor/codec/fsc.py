"""`.fsc`: a spike stream as first spikes. All numbers are little-endian.

head    96 bytes: "VIFSC1\\r\\n"; code (1 byte: its place in CODES), refine (1), 2 bytes that
        are 0, height (4), width (4), words in a chunk (4), pixels in a band (4), cycles (4), start
        (8, signed), clock (8 and 8: numerator and denominator in Hz), k, threshold, threshold noise
        (8 each, IEEE 754, 0 where nothing was lost), 12 bytes that are 0, CRC-32 of the 92 bytes
        before (4)
frames  for each chunk, for each band: bytes (4), CRC-32 of its number and its data (4), data:
        columns.py; which columns: follow.py and line.py

`code` tells the recorded stream (line, repeat) from one that has lost detail
(statistical, with the settings it was made with).
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from pathlib import Path

from cosim import Clock, InputError, SpikeStream, Viform
from cosim.compute.memory import check_memory
from cosim.files.whole import whole
from sensor.codec.coding import BAND, CHUNK, CODES, LONGEST, Code, decode, encode, frame_count
from sensor.codec.columns import Damaged

FSC = ".fsc"
"""Ending of the files."""
_MAGIC = b"VIFSC1\r\n"
_HEAD = struct.Struct("<8sBB2xIIIIIqQQddd12x")
_CRC = struct.Struct("<I")
_FRAME = struct.Struct("<II")
_WHOLE = _HEAD.size + _CRC.size
_SHORTER = "code it in shorter pieces"


def _crc(number: int, data: bytes | memoryview) -> int:
    """Of a frame and its place, so that frames that changed places are noticed."""
    return zlib.crc32(data, zlib.crc32(_CRC.pack(number & 0xFFFFFFFF)))


def write_fsc(stream: SpikeStream, path: Path, code: Code) -> int:
    """Writes a stream; the bytes written. Raises InputError where the file cannot be written or
    holds no such stream."""
    start = int(getattr(stream, "start", 0))
    if stream.cycles > LONGEST or abs(start) >= 2**63:
        raise InputError(
            f"{path}", f"of at most {LONGEST} cycles", f"{stream.cycles}", "write a .zarr instead"
        )
    try:
        head = _HEAD.pack(
            _MAGIC, CODES.index(code.name), code.refine, *stream.shape, CHUNK, BAND, stream.cycles,
            start, stream.clock.num, stream.clock.den, code.k, code.threshold, code.threshold_noise,
        )  # fmt: skip
    except struct.error as exc:
        raise InputError(
            f"{path}", "of a size and clock below 2^32 and 2^64", str(exc), "write a .zarr instead"
        ) from exc
    with whole(path) as part, part.open("wb") as file:
        file.write(head + _CRC.pack(zlib.crc32(head)))
        for number, frame in enumerate(encode(stream, code)):
            file.write(_FRAME.pack(len(frame.data), _crc(number, frame.data)))
            file.write(frame.data)
        return file.tell()


def _parse(data: memoryview, path: Path) -> tuple[Viform, Code]:
    """Raises ValueError (Damaged is one), struct.error, and what `decode` does."""
    magic, name, refine, height, width, chunk, band, cycles, start, num, den, k, q, noise = (
        _HEAD.unpack(data[: _HEAD.size])
    )
    if magic != _MAGIC:
        raise Damaged("another kind of file, or another version of it")
    (crc,) = _CRC.unpack(data[_HEAD.size : _WHOLE])
    if crc != zlib.crc32(data[: _HEAD.size]) or name >= len(CODES):
        raise Damaged("a head that was changed")
    if any(data[10:12]) or any(data[80:92]) or not all(map(math.isfinite, (k, q, noise))):
        raise Damaged("a head that was changed")
    if (chunk, band) != (CHUNK, BAND):
        raise Damaged(f"chunks of {chunk} words and bands of {band} pixels")
    if not (height and width and 0 < cycles <= LONGEST):
        raise Damaged(f"a stream of {cycles} cycles of {width}x{height}")
    code, clock = Code(CODES[name], k, q, noise, refine), Clock(num, den)
    chunks, bands = frame_count((height, width), cycles)
    # Every frame takes room in the file; how much more its planes take, `decode` checks.
    if len(data) < _WHOLE + chunks * bands * _FRAME.size:
        raise Damaged("a file that is cut off")
    frames, at = [], _WHOLE
    for number in range(chunks * bands):
        length, crc = _FRAME.unpack(data[at : at + _FRAME.size])
        frame = data[at + _FRAME.size : at + _FRAME.size + length]
        if len(frame) < length:
            raise Damaged("a file that is cut off")
        if crc != _crc(number, frame):
            raise Damaged(f"damaged in frame {number}")
        frames.append(frame)
        at += _FRAME.size + length
    if at != len(data):
        raise Damaged("a file with bytes after its last frame")
    return decode(code, frames, (height, width), cycles, clock, start, f"{path}"), code


def read_fsc(path: Path) -> tuple[Viform, Code]:
    """The stream of a file and the code that it went through. Raises InputError for what is no such
    file, whole and undamaged, and where memory is short."""
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            check_memory(f"{path}", size, _SHORTER)
            data = file.read(size)
        return _parse(memoryview(data), path)
    except OSError as exc:
        raise InputError("the stream", "readable", f"{path} ({exc.strerror})", "check it") from exc
    except MemoryError as exc:  # free, but not ours: a limit on the process
        must = "small enough for the memory that this process may take"
        raise InputError(f"{path}", must, "larger", _SHORTER) from exc
    except (ValueError, struct.error) as exc:
        given = str(exc) if isinstance(exc, Damaged) else "something else"
        raise InputError(
            f"{path}", "a whole first-spike file", given, "copy or convert it again"
        ) from exc
