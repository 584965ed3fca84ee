"""`.npz`: a whole stream as one numpy archive, for use in other programs.

Ours holds `words` (n, H, W) uint32, `cycles`, `clock` (numerator, denominator in Hz) and `start`.
Also read: archives of others with one (T, H, W) array of 0 and 1.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.dat import DAT_CLOCK
from cosim.files.whole import whole
from cosim.viform import WORD, SpikeStream, Viform, words_for

__all__ = ["read_npz", "write_npz"]


def write_npz(stream: SpikeStream, path: Path) -> None:
    """Writes a stream as `.npz`; nothing of it is lost."""
    words = stream.read_words(0, words_for(stream.cycles))
    clock = np.array([stream.clock.num, stream.clock.den], np.int64)
    start = getattr(stream, "start", 0)
    with whole(path) as part, part.open("wb") as file:
        np.savez_compressed(
            file, allow_pickle=False, words=words, cycles=stream.cycles, clock=clock, start=start
        )


def read_npz(path: Path) -> Viform:
    """A stream from an `.npz` of ours or of another program."""

    def bad(given: str) -> InputError:
        return InputError(
            f"{path}",
            "an .npz with `words`, `cycles` and `clock`, or with one (T, H, W) array of 0 and 1",
            given,
            "save the spikes with numpy.savez(path, spikes=array)",
        )

    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zipfile.LargeZipFile,
            NotImplementedError, SyntaxError, MemoryError, RuntimeError) as exc:  # fmt: skip
        raise bad("a file that numpy cannot read") from exc
    except Exception as exc:  # zlib.error and struct.error come from damaged members
        raise bad("a damaged file") from exc
    if "words" in arrays:
        try:
            words, cycles = arrays["words"], int(arrays["cycles"])
            num, den = (int(x) for x in arrays["clock"])
            stream = Viform(words, cycles, Clock(num, den), int(arrays.get("start", 0)))
        except (KeyError, ValueError, TypeError) as exc:
            raise bad(f"one where {exc}") from exc
        if 0 in stream.shape:
            raise bad("one without pixels")
        if cycles % WORD and (words[-1] >> np.uint32(cycles % WORD)).any():
            raise bad("one with spikes beyond its last cycle")
        return stream
    planes = [a for a in arrays.values() if a.ndim == 3 and a.dtype.kind in "bui"]
    if len(planes) != 1 or 0 in planes[0].shape or not ((planes[0] == 0) | (planes[0] == 1)).all():
        raise bad(f"arrays {sorted(arrays)}")
    return Viform.from_planes(planes[0].astype(np.uint8), DAT_CLOCK)
