"""`.npz`: a whole stream as one numpy archive, for use in other programs.

An archive of this project has `words` (n, H, W) uint32, `cycles`, `clock` (numerator, denominator
in Hz) and `start`, and what its source says beyond the spikes under names that begin with
`ancillary/` (`cosim.spikes.ancillary.to_arrays`). Archives of other programs with one (T, H, W)
array of 0 and 1 are read as well.
"""

from __future__ import annotations

import math
from operator import index
from pathlib import Path
from typing import Final

import numpy as np

from cosim.archive import ArchiveWriter, load_arrays
from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.atomic import atomic_write
from cosim.files.dat import DAT_CLOCK
from cosim.spikes.ancillary import RegisterWrite, from_arrays, to_arrays
from cosim.spikes.viform import WORD, SpikeStream, Viform, pack_planes, words_for

_ANCILLARY: Final = "ancillary/"


def _check_ancillary(stream: Viform) -> None:
    """Raises ValueError for ancillary data that do not belong to a stream."""
    height = stream.shape[0]
    for each in stream.ancillary:
        fits = stream.start <= each.cycle < stream.start + stream.cycles
        if isinstance(each, RegisterWrite):
            fits = fits and 0 <= each.rows[0] <= each.rows[1] <= height
            fits = fits and math.isfinite(each.packet) and each.packet > 0
        else:
            fits = fits and each.gain.shape == stream.shape and min(each.span, each.levels) > 0
            fits = fits and int(each.gain.max()) <= each.levels
        if not fits:
            raise ValueError(f"ancillary data of cycle {each.cycle} must fit its planes")


def write_npz(stream: SpikeStream, path: Path) -> None:
    """Writes a stream as `.npz` without loss, a word at a time."""
    n = words_for(stream.cycles)
    words = (stream.read_words(w, w + 1) for w in range(n))
    with atomic_write(path) as part, part.open("wb") as file, ArchiveWriter(file) as archive:
        archive.write_parts("words", np.uint32, (n, *stream.shape), words)
        archive.write("cycles", np.int64(stream.cycles))
        archive.write("clock", np.array([stream.clock.num, stream.clock.den], np.int64))
        archive.write("start", np.int64(getattr(stream, "start", 0)))
        for name, array in to_arrays(getattr(stream, "ancillary", ())).items():
            archive.write(f"{_ANCILLARY}{name}", array)


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
            said = from_arrays({
                name.removeprefix(_ANCILLARY): array
                for name, array in arrays.items() if name.startswith(_ANCILLARY)
            })  # fmt: skip
            stream = Viform(arrays["words"], cycles, Clock(num, den), start, said)
            _check_ancillary(stream)
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
