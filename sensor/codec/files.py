"""First-spike and packet files, which open and are written beside the formats of cosim.

`.fsc` is a spike stream as first spikes. All numbers are little-endian.

head    96 bytes: "VIFSC1\r\n"; code (1 byte: its place in CODES), refine (1), 2 bytes that
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
from typing import Any

from cosim import Clock, InputError, SpikeStream, Viform
from cosim.compute.memory import check_memory
from cosim.config.units import KINDS, parse_quantity
from cosim.files import FORMATS, ending_of, open_stream
from cosim.files.atomic import atomic_write
from sensor.codec.coding import BAND, CHUNK, CODES, LONGEST, Code, decode, encode, frame_count
from sensor.codec.columns import Damaged
from sensor.codec.packets.catalogue import KINDS as KINDS_OF_CODES
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.vfl import VFL, VflStream, write_vfl

FSC = ".fsc"
"""Ending of the files."""
_MAGIC = b"VIFSC1\r\n"
_HEAD = struct.Struct("<8sBB2xIIIIIqQQddd12x")
_CRC = struct.Struct("<I")
_FRAME = struct.Struct("<II")
_WHOLE = _HEAD.size + _CRC.size
_SHORTER = "code it in shorter pieces"


def open_any(path: Path, size: tuple[int, int] | None) -> tuple[SpikeStream, list[str]]:
    """A stream of any format, and notes beyond those of `notes_of`. Raises InputError."""
    if not is_coded(path):
        ending = ending_of(path)
        if path.exists() and not path.is_dir() and ending not in FORMATS and ending != ".yaml":
            raise InputError(
                "the stream", f"a {', '.join((*FORMATS, FSC, VFL))} or the folder of a run",
                str(path),
                "film a clip with `viform run film --set scene.path=...`, or convert the stream",
            )  # fmt: skip
        return open_stream(path, size), []
    stream: SpikeStream
    code: Code | StreamCode
    if path.suffix.lower() == VFL:
        packets = VflStream(path)
        stream, code = packets, packets.code
    else:
        stream, code = read_fsc(path)
    height, width = stream.shape
    if size not in (None, (width, height)):
        raise InputError("--size", f"{width}x{height} for {path}", f"{size[0]}x{size[1]}",
                         "leave it out")  # fmt: skip
    if code.lossless:
        return stream, []
    return stream, [f"{path} holds what is left of a stream: {left(code)}"]


def is_coded(path: Path) -> bool:
    """Whether a name is that of a first-spike or packet file."""
    return path.suffix.lower() in (FSC, VFL)


def left(code: Code | StreamCode) -> str:
    """What a code that loses something keeps."""
    if isinstance(code, StreamCode) and code.kind == "layered":
        return f"the first {code.layers} layers, with the other spikes spread evenly"
    means = f", means of {code.refine} widths" if code.refine else ""
    noise = f" with noise of {code.threshold_noise:g} e" if code.threshold_noise else ""
    return (
        f"changes beyond {code.k:g} standard deviations at a threshold of "
        f"{code.threshold:g} e{noise}{means}"
    )


def choose_code(
    out: Path,
    name: str | None,
    k: float | None,
    threshold: str | None,
    noise: str | None,
    refine: int | None,
    layers: int | None,
    cycles: int | None,
) -> Code | StreamCode | None:
    """The code that the command line options select; None if `out` is no coded file.

    Raises InputError for options that exclude each other.
    """
    packets = {"--layers": layers, "--cycles": cycles}
    settings = {"--k": k, "--threshold": threshold, "--threshold-noise": noise, "--refine": refine}
    ending = out.suffix.lower()
    given = [o for o, value in {"--code": name, **settings, **packets}.items() if value is not None]
    needs = FSC if not given or given[0] not in packets else VFL
    if given and (not is_coded(out) or (needs == VFL and ending != VFL)):
        raise InputError(
            given[0], f"given with a {needs} to write", str(out), f"leave {given[0]} out"
        )
    if not is_coded(out):
        return None
    names, usual = (tuple(KINDS_OF_CODES), "layered") if ending == VFL else (CODES, "line")
    if name not in (None, *names):
        raise InputError("--code", f"one of {', '.join(names)}", repr(name), "choose one")
    chosen = name or usual
    options = [option for option, value in settings.items() if value is not None]
    if chosen != "statistical" and options:
        raise InputError(
            options[0], "given with --code statistical", f"with {chosen}",
            f"leave {options[0]} out",
        )  # fmt: skip
    if chosen != "layered" and layers is not None:
        raise InputError("--layers", "given with --code layered", f"with {chosen}", "leave it out")
    values: dict[str, Any] = {}
    if chosen == "statistical":
        if k is None or threshold is None:
            missing = "--threshold '1000 e'" if threshold is None else "--k 3"
            raise InputError(
                "--code statistical", "given with --k and --threshold", "without", f"add {missing}"
            )
        values = {"k": k, "refine": refine or 0, **_charges(threshold, noise)}
    if ending == VFL:
        values |= {n[2:]: value for n, value in packets.items() if value is not None}
    try:
        return StreamCode(chosen, **values) if ending == VFL else Code(chosen, **values)  # type: ignore[arg-type]
    except ValueError as exc:
        what, _, rest = str(exc).partition(" must be ")
        must, _, value = rest.rpartition(", not ")
        raise InputError(
            f"--{what.replace(' ', '-')}", must, value, "write a value of these"
        ) from None


def _charges(threshold: str, noise: str | None) -> dict[str, float]:
    """The charges of the statistical code from their options."""
    charges = {}
    for option, text in (("--threshold", threshold), ("--threshold-noise", noise or "0 e")):
        try:
            charges[option[2:].replace("-", "_")] = parse_quantity(text, KINDS["charge"])
        except ValueError:
            raise InputError(option, str(KINDS["charge"]), repr(text), "write it so") from None
    return charges


def write_coded(stream: SpikeStream, path: Path, code: Code | StreamCode) -> None:
    """Writes a first-spike or packet file."""
    if isinstance(code, StreamCode):
        write_vfl(stream, path, code)
    else:
        write_fsc(stream, path, code)


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
    with atomic_write(path) as part, part.open("wb") as file:
        file.write(head + _CRC.pack(zlib.crc32(head)))
        for number, frame in enumerate(encode(stream, code)):
            file.write(_FRAME.pack(len(frame.data), _crc(number, frame.data)))
            file.write(frame.data)
        return file.tell()


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


def _crc(number: int, data: bytes | memoryview) -> int:
    """CRC-32 of a frame and its place, so that frames that changed places are noticed."""
    return zlib.crc32(data, zlib.crc32(_CRC.pack(number & 0xFFFFFFFF)))
