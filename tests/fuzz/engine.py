"""A fuzzer: sound inputs with damage, each made again from its number.

A case is a function of its target's name and its number alone. What a target must do with it: read
it, or refuse it in one line of at most `LONGEST` characters, in at most `SLOWEST` times the usual
processor time and within `MEMORY` bytes.
"""

from __future__ import annotations

import random
import re
import resource
import statistics
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from cosim.errors import ViformError

LONGEST = 400
"""Characters of a refusal; the case's own path counts as its name."""
SLOWEST = 10
"""Times the median of the target, or the sound inputs' time where that is more."""
NOISE_S = 0.1
"""Processor time below which a case is never slow: garbage collection, first imports."""
MEMORY = 1 << 30
"""Bytes that a case may take."""
GUARD = 6 << 30
"""Bytes of address space beyond today's at which a case is stopped, for the machine's sake."""

_WORDS = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF,
          1 << 40, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)  # fmt: skip
_NUMBERS = (b"0", b"-1", b"1e308", b"1e999", b"nan", b"inf", b"-0.0", b"1e-320", b"9" * 30,
            b"0x10", b"2147483648", b"18446744073709551616", b"null", b"true", b'""', b"[]",
            b"{}", b"9" * 5000)  # fmt: skip
_TOKENS = (b"[", b"{", b'"', b"'", b"\n", b"\r\n", b"\0", b"\xff", b"\xc3\x28", b",", b":", b"=",
           b"\xef\xbb\xbf", b"..", b"/", b"#")  # fmt: skip


@dataclass(frozen=True)
class Target:
    """A reader or a wire.

    Attributes:
        name: short; cases depend on it.
        seeds: sound inputs.
        read: reads a damaged input, written into this folder where it must be a file.
        text: whether the input is text.
        weight: costs of a case, in cases of a usual target: as many fewer are run.
    """

    name: str
    seeds: Callable[[Path], list[bytes]]
    read: Callable[[bytes, Path], object]
    text: bool = False
    weight: int = 1


@dataclass(frozen=True)
class Failure:
    """A case that went wrong.

    Attributes:
        target, number: which.
        why: in a line.
    """

    target: str
    number: int
    why: str


def case(target: Target, number: int, seeds: list[bytes]) -> bytes:
    """The damaged input of this number."""
    rng = random.Random(f"{target.name}:{number}")
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.choice((1, 1, 1, 2, 3, 5))):
        _damage(data, rng, target.text, seeds)
    return bytes(data[: 1 << 22])


def _damage(data: bytearray, rng: random.Random, text: bool, seeds: list[bytes]) -> None:
    """One fault, in place."""
    size = len(data)
    at = rng.randrange(size + 1)
    length = min(rng.choice((1, 2, 4, 16, 100, 1000)), size - at)
    kinds = ["flip", "set", "cut", "remove", "repeat", "insert", "zero", "splice"]
    kinds += ["number", "token", "line", "nest"] if text else ["word"] * 3
    kind = rng.choice(kinds)
    if kind == "flip" and at < size:
        data[at] ^= 1 << rng.randrange(8)
    elif kind == "set" and at < size:
        data[at] = rng.randrange(256)
    elif kind == "cut":
        del data[at:]
    elif kind == "remove":
        del data[at : at + length]
    elif kind == "repeat":
        data[at:at] = data[at : at + length] * rng.choice((1, 2, 50))
    elif kind == "insert":
        data[at:at] = rng.randbytes(rng.choice((1, 3, 8, 64)))
    elif kind == "zero":
        data[at : at + length] = bytes(length)
    elif kind == "splice":
        other = rng.choice(seeds)
        data[at:] = other[rng.randrange(len(other) + 1) :]
    elif kind == "word":
        order = rng.choice("<>") + rng.choice("BHIQ")
        width = struct.calcsize(order)
        data[at : at + width] = struct.pack(order, rng.choice(_WORDS) % (1 << 8 * width))
    elif kind == "number":
        numbers = list(re.finditer(rb"-?\d[\d.e+-]*", data))
        if numbers:
            chosen = rng.choice(numbers)
            data[chosen.start() : chosen.end()] = rng.choice(_NUMBERS)
    elif kind == "token":
        data[at:at] = rng.choice(_TOKENS)
    elif kind == "line":
        lines = bytes(data).split(b"\n")
        one, two = (rng.randrange(len(lines)) for _ in range(2))
        lines[one] = rng.choice((b"", lines[two]))
        data[:] = b"\n".join(lines)
    elif kind == "nest":
        data[at:at] = rng.choice((b"[", b"{", b"a.", b"(", b'{"a":')) * rng.choice((3, 300, 9000))


def run(target: Target, first: int, cases: int, folder: Path) -> list[Failure]:
    """Runs cases `first` to `first + cases`. folder: for their files."""
    made = folder / "seeds"
    made.mkdir(exist_ok=True)
    seeds = target.seeds(made)
    place = folder / "case"
    place.mkdir(exist_ok=True)
    sound = [_judge(target, seed, place) for seed in seeds for _ in range(2)]
    wrong = [why for why, _ in sound if why]
    if wrong:
        return [Failure(target.name, -1, f"a sound input: {wrong[0]}")]
    failures, times = [], []
    for number in range(first, first + cases):
        why, seconds = _judge(target, case(target, number, seeds), place)
        times.append(seconds)
        if why:
            failures.append(Failure(target.name, number, why))
    usual = max([statistics.median(times), *(seconds for _, seconds in sound)])
    limit = max(SLOWEST * usual, NOISE_S)
    for number in (first + n for n, seconds in enumerate(times) if seconds > limit):
        again = min(_judge(target, case(target, number, seeds), place)[1] for _ in range(3))
        if again > limit:
            why = f"takes {again:.2g} s where {usual:.2g} s are usual"
            failures.append(Failure(target.name, number, why))
    return failures


def _judge(target: Target, data: bytes, place: Path) -> tuple[str, float]:
    """Why a case is wrong, "" where it is not, and its processor time."""
    why = ""
    with _bounded() as peak:
        begin = time.process_time()
        try:
            target.read(data, place)
        except ViformError as exc:
            why = _refusal(str(exc), place)
            if _cause_is_memory(exc):
                why = "out of memory behind a refusal"
        except MemoryError:
            why = f"takes more than {GUARD >> 30} GiB"
        except Exception as exc:
            why = f"{type(exc).__name__}: {str(exc)[:200]}"
        seconds = time.process_time() - begin
        grown = peak()
    if not why and grown > MEMORY:
        why = f"takes {grown / 1e9:.2g} GB"
    return why, seconds


def _refusal(line: str, place: Path) -> str:
    """What is wrong with a refusal."""
    line = line.replace(str(place), "FOLDER")
    if "\n" in line or "\r" in line:
        return f"refused in more than a line: {line[:200]!r}"
    if len(line) > LONGEST:
        return f"refused in {len(line)} characters: {line[:200]!r}"
    if not line.isprintable():
        return f"refused with control characters: {line[:200]!r}"
    return ""


def _cause_is_memory(exc: BaseException | None) -> bool:
    while exc is not None:
        if isinstance(exc, MemoryError):
            return True
        hidden = exc.__suppress_context__  # the library's own limit, and not the machine's
        exc = exc.__cause__ or (None if hidden else exc.__context__)
    return False


@contextmanager
def _bounded() -> Iterator[Callable[[], int]]:
    """Limits the address space; gives a function that says how far resident memory has grown."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    status = Path("/proc/self/status")
    before = _kilobytes(status, "VmRSS")
    resource.setrlimit(resource.RLIMIT_AS, (_kilobytes(status, "VmSize") * 1024 + GUARD, hard))
    with suppress(OSError):  # without it the peak is that of the whole process
        Path("/proc/self/clear_refs").write_text("5")
    try:
        yield lambda: (_kilobytes(status, "VmHWM") - before) * 1024
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def _kilobytes(status: Path, key: str) -> int:
    found = re.search(rf"{key}:\s+(\d+) kB", status.read_text())
    assert found is not None
    return int(found[1])
