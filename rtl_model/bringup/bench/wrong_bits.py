"""Wrong bits of captured planes, and the pixel, row, column, lane or frame that they share."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Planes = npt.NDArray[np.bool_]

_REMEDIES = {
    "pixel": "check that pixel's charge memory and its bit of the row's word",
    "row": "check the row counter and that row's address in charge and pattern memory",
    "column": "check the path of that bit through capture memory and the row's words",
    "lane": "check that lane's adder and comparator, which every tile uses",
    "frame": "check what changes between frames: the clear, the frame counter, the tick",
    "scattered": "run `viform board compare` with fewer frames, and check the clock's timing",
}


class WrongBits(NamedTuple):
    """Difference between captured and expected planes.

    Attributes:
        bits: number of wrong bits.
        compared: number of compared bits.
        frame, row, column, got: position and value of the first wrong bit in time.
        shape: smallest location that contains all wrong bits: pixel, row, column, lane, frame or
            scattered.
        place: number of that location ("row, column" for a pixel).
        stuck: 0 or 1 if every bit of the location reads that value although both values are
            expected; None otherwise.
    """

    bits: int
    compared: int
    frame: int
    row: int
    column: int
    got: int
    shape: str
    place: str
    stuck: int | None

    @property
    def text(self) -> str:
        """The difference in one clause."""
        wrong = f"{self.bits} of {self.compared} bits are wrong"
        first = (
            f"the first in frame {self.frame}, row {self.row}, column {self.column} "
            f"({self.got} in place of {1 - self.got})"
        )
        stuck = "" if self.stuck is None else f", stuck at {self.stuck}"
        shapes = {
            "pixel": f"all in the one pixel at row, column {self.place}",
            "row": f"all in row {self.place}",
            "column": f"all in column {self.place}",
            "lane": f"all in lane {self.place} of every tile",
            "frame": f"all in frame {self.place}",
            "scattered": "with no pixel, row, column or lane in common",
        }
        return f"{wrong}, {first}; {shapes[self.shape]}{stuck}"

    @property
    def remedy(self) -> str:
        """What to check."""
        return _REMEDIES[self.shape]

    def document(self) -> dict[str, Any]:
        """The JSON document of the difference."""
        return self._asdict() | {"text": self.text, "mend": self.remedy}


def compare(got: Planes, expected: Planes, lanes: int) -> WrongBits | None:
    """Compares captured with expected planes; None if they are equal.

    Args:
        got, expected: (frames, rows, columns) bool.
        lanes: pixels computed in one clock; lane n computes the columns n, n + lanes, ...

    Raises:
        ValueError: if the shapes differ.
    """
    if got.shape != expected.shape:
        raise ValueError(f"planes must be of one shape, not {got.shape} and {expected.shape}")
    wrong = got != expected
    count = int(np.count_nonzero(wrong))
    if count == 0:
        return None
    frames, rows, columns = np.nonzero(wrong)
    frame, row, column = int(frames[0]), int(rows[0]), int(columns[0])
    shape, place = _shape(frames, rows, columns, lanes, got.shape)
    return WrongBits(
        count, got.size, frame, row, column, int(got[frame, row, column]), shape, place,
        _stuck(got, expected, shape, place, lanes),
    )  # fmt: skip


def _shape(
    frames: npt.NDArray[np.intp],
    rows: npt.NDArray[np.intp],
    columns: npt.NDArray[np.intp],
    lanes: int,
    size: tuple[int, ...],
) -> tuple[str, str]:
    """The smallest location that contains all wrong bits, and its number."""
    one_row, one_column = np.unique(rows).size == 1, np.unique(columns).size == 1
    if one_row and one_column:
        return "pixel", f"{rows[0]}, {columns[0]}"
    if one_column:
        return "column", str(columns[0])
    if one_row:
        return "row", str(rows[0])
    if size[2] > lanes and np.unique(columns % lanes).size == 1:
        return "lane", str(columns[0] % lanes)
    if size[0] > 1 and np.unique(frames).size == 1:
        return "frame", str(frames[0])
    return "scattered", ""


def _stuck(got: Planes, expected: Planes, shape: str, place: str, lanes: int) -> int | None:
    """The value of every bit of the location, if both values are expected there."""
    if shape == "pixel":
        row, column = (int(part) for part in place.split(","))
        part, truth = got[:, row, column], expected[:, row, column]
    elif shape == "row":
        part, truth = got[:, int(place)], expected[:, int(place)]
    elif shape == "column":
        part, truth = got[:, :, int(place)], expected[:, :, int(place)]
    elif shape == "lane":
        part, truth = got[:, :, int(place) :: lanes], expected[:, :, int(place) :: lanes]
    else:
        return None
    alike = bool((part == part.flat[0]).all())
    return int(part.flat[0]) if alike and not bool((truth == part.flat[0]).all()) else None
