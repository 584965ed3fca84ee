"""Planes from the beats of the stream, and which of them are lost."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.stream.ring import Beat

_NUMBERS = 1 << 20  # a head has the plane's number modulo this


class Received(NamedTuple):
    """What a reader makes of a stream.

    Attributes:
        planes: (rows, columns) bool by number of the plane, counted on from its first 20 bits; rows
            that are missing are dark.
        rows: rows that arrived, by number of the plane.
        incomplete: planes of which the ring has lost rows.
        missing: planes of which no row arrived, between two that arrived.
    """

    planes: dict[int, npt.NDArray[np.bool_]]
    rows: dict[int, list[int]]
    incomplete: set[int]
    missing: set[int]


def read_stream(beats: Iterable[Beat], geometry: Geometry) -> Received:
    """Reads whole packets. The last plane is only known to be complete when another follows.

    The number of a plane is extended beyond 20 bits, which cannot detect a loss of 2^20 planes. A
    number that does not rise is a cleared sensor, and raises.

    Args:
        beats: beats in order, from the stream's start.
        geometry: geometry of the build.

    Raises:
        InputError: for beats that are no packets of this geometry.
    """
    found = Received({}, {}, set(), set())
    plane = row = -1
    words: list[int] | None = None  # of the row; None when a head is due
    for place, beat in enumerate(beats):
        if words is None:
            row, number = beat.data & 0xFFF, beat.data >> 12
            if beat.last or row >= geometry.rows or number >= _NUMBERS:
                raise _refusal(f"a head of a row below {geometry.rows}", place, beat)
            if beat.user & 1:
                step = (number - plane) % _NUMBERS if plane >= 0 else 0
                if plane >= 0 and not 0 < step < _NUMBERS // 2:
                    raise _refusal(f"a plane after number {plane}", place, beat)
                if beat.user & 2:
                    if plane < 0:
                        raise _refusal("a first plane with none before it", place, beat)
                    found.incomplete.add(plane)
                found.missing.update(range(plane + 1, plane + step))
                plane = plane + step if plane >= 0 else number
                found.planes[plane] = np.zeros((geometry.rows, geometry.columns), bool)
                found.rows[plane] = []
            elif plane < 0 or number != plane % _NUMBERS or row <= found.rows[plane][-1]:
                raise _refusal(f"a later row of plane {plane}", place, beat)
            words = []
            continue
        words.append(beat.data)
        if beat.user or beat.last != (len(words) == geometry.tiles):
            raise _refusal(f"the end of a row after {geometry.tiles} tiles", place, beat)
        if beat.last:
            found.rows[plane].append(row)
            found.planes[plane][row] = _pixels(words, geometry)
            words = None
    return found


def _pixels(words: list[int], geometry: Geometry) -> npt.NDArray[np.bool_]:
    data = b"".join(word.to_bytes(geometry.lanes // 8, "little") for word in words)
    bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little")
    return bits[: geometry.columns].astype(bool)


def _refusal(expected: str, place: int, beat: Beat) -> InputError:
    return InputError(
        f"beat {place} of the stream", expected,
        f"0x{beat.data:x} (last {int(beat.last)}, user {beat.user})",
        "read from the stream's start, and reset its reader with it",
    )  # fmt: skip
