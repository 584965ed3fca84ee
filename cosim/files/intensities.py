"""`.npz` of absolute intensities: `row`, `column`, `time`, `value`, `shape`, `ticks`, `clock`
(numerator, denominator in Hz) and `start`, as `Intensities` has them."""

from __future__ import annotations

from operator import index
from pathlib import Path
from typing import Final

import numpy as np

from cosim.archive import load_arrays
from cosim.clock import Clock
from cosim.errors import InputError
from cosim.files.atomic import atomic_write
from cosim.spikes.intensities import Intensities

ENDING: Final = ".intensities.npz"


def write_intensities(reports: Intensities, path: Path) -> None:
    """Writes reports as `.npz` without loss."""
    with atomic_write(path) as part, part.open("wb") as file:
        np.savez_compressed(
            file,
            allow_pickle=False,
            row=reports.row,
            column=reports.column,
            time=reports.time,
            value=reports.value,
            shape=np.array(reports.shape, np.int64),
            ticks=reports.ticks,
            clock=np.array([reports.clock.num, reports.clock.den], np.int64),
            start=reports.start,
        )


def read_intensities(path: Path) -> Intensities:
    """Reports from an `.npz` that `write_intensities` has written.

    Raises InputError for any other file, OSError if the file cannot be read.
    """

    def bad(value: str) -> InputError:
        return InputError(
            f"{path}",
            "an .npz of `row`, `column`, `time`, `value`, `shape`, `ticks`, `clock` and `start`",
            value,
            "give the reports of a run with continuous pixels",
        )

    try:
        arrays = load_arrays(path)
    except ValueError as exc:
        raise bad(f"a file that cannot be read ({exc})") from exc
    try:
        ticks, start = (index(arrays[name][()]) for name in ("ticks", "start"))
        height, width = (index(x) for x in arrays["shape"])
        num, den = (index(x) for x in arrays["clock"])
        return Intensities(
            arrays["row"], arrays["column"], arrays["time"], arrays["value"], (height, width),
            ticks, Clock(num, den), start,
        )  # fmt: skip
    except KeyError as exc:
        raise bad(f"one without {exc}") from exc
    except (ValueError, TypeError) as exc:
        raise bad(f"one where {exc}") from exc
