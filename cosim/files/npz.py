"""`.npz`: a whole stream as one numpy archive, for use in other programs.

An archive of this project has `words` (n, H, W) uint32, `cycles`, `clock` (numerator, denominator
in Hz) and `start`. Archives of other programs with one (T, H, W) array of 0 and 1 are read as well.
"""

from __future__ import annotations

from operator import index
from pathlib import Path

import numpy as np

from cosim.archive import ArchiveWriter, load_arrays
from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.atomic import atomic_write
from cosim.files.dat import DAT_CLOCK
from cosim.spikes.viform import WORD, SpikeStream, Viform, pack_planes, words_for


def write_npz(stream: SpikeStream, path: Path) -> None:
    """Writes a stream as `.npz` without loss, a word at a time."""
    n = words_for(stream.cycles)
    words = (stream.read_words(w, w + 1) for w in range(n))
    with atomic_write(path) as part, part.open("wb") as file, ArchiveWriter(file) as archive:
        archive.write_parts("words", np.uint32, (n, *stream.shape), words)
        archive.write("cycles", np.int64(stream.cycles))
        archive.write("clock", np.array([stream.clock.num, stream.clock.den], np.int64))
        archive.write("start", np.int64(getattr(stream, "start", 0)))


def read_npz(path: Path) -> Viform:
    """A stream from an `.npz` of this project, or of another program with a clock of 40 kHz.

    Raises InputError for any other file, OSError if the file cannot be read.
    """

    def bad(value: str) -> InputError:
        return InputError(
            f"{path}",
            "an .npz with `words`, `cycles`, `clock` and `start`, or with one (T, H, W) array of 0 "
            "and 1",
            value,
            "save the spikes with numpy.savez(path, spikes=array)",
        )

    try:
        arrays = load_arrays(path)
    except ValueError as exc:
        raise bad(f"a file that cannot be read ({exc})") from exc
    if "words" in arrays:
        try:
            cycles, start = (index(arrays[name][()]) for name in ("cycles", "start"))
            num, den = (index(x) for x in arrays["clock"])
            stream = Viform(arrays["words"], cycles, Clock(num, den), start)
        except KeyError as exc:
            raise bad(f"one without {exc}") from exc
        except (ValueError, TypeError) as exc:
            raise bad(f"one where {exc}") from exc
        if 0 in stream.shape:
            raise bad("one without pixels")
        return stream
    found = [a for a in arrays.values() if a.ndim == 3 and a.dtype.kind in "bui"]
    if len(found) != 1 or 0 in found[0].shape:
        raise bad(f"arrays {sorted(arrays)}")
    (planes,) = found
    words = np.empty((words_for(len(planes)), *planes.shape[1:]), np.uint32)
    for n, word in enumerate(words):  # not at once: that takes several times the memory
        part = planes[n * WORD : (n + 1) * WORD]
        if ((part != 0) & (part != 1)).any():
            raise bad(f"arrays {sorted(arrays)}")
        word[...] = pack_planes(part.astype(np.uint8))[0]
    return Viform(words, len(planes), DAT_CLOCK)
