"""The course of light over a call: a few planes and weights, from which kernels compute each cycle.

The light of a cycle is base + sum of weight x (plane - base). For a cycle within a piece, the base
is the first plane of the piece, and the weight of its last plane is the position of the middle of
the cycle in the piece. For a cycle in which pieces meet, the weights are the integrals of the
linear pieces over the cycle. Weights depend on the cycle and the row only, so every cycle gets the
same numbers however a run is split. Where the light is constant all planes are equal, and the sum
is the base to the last bit; so pixels outside the changed boxes need no weights.

Most kernels that step from cycle to cycle add a whole number to the light instead of weighing
planes.
They start from an anchor: the first cycle of a piece, or of each 32 cycles of the clock in it.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from itertools import pairwise
from operator import attrgetter
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.light.light import Box, Light, Piece, Plane
from cosim.spikes.viform import WORD
from sensor.latched.fast.joints import Joint, Weights, merged, weighed
from sensor.latched.sampling import RowMoves

MOST_PLANES: Final = 16
"""Most planes of a segment, including its base, and of a launch of a kernel."""


@dataclass(frozen=True, eq=False)
class Segment:
    """Cycles of a call that share planes.

    Attributes:
        first: first cycle, within the call.
        cycles: number of cycles.
        base: (H, W) float32, light of weight 0.
        planes: (H, W) float32 each.
        weights: (cycles, rows of the box or 1, planes) float32. With moves of the sampling instants
            a further one: the length of a cycle without moves over that of this cycle.
        anchors: (words, rows of the box or 1, 3) float32, weight at the anchor of each 32 cycles of
            the clock; the anchor, in cycles from the start of the call; and the number of cycles
            for which it holds, which may lie outside the call. None for no ramp.
        slope: change of the weight in a cycle.
    """

    first: int
    cycles: int
    base: Plane
    planes: tuple[Plane, ...]
    weights: Weights
    anchors: Weights | None = None
    slope: float = 0.0


@dataclass(frozen=True, eq=False)
class Course:
    """Light of a call.

    Attributes:
        steady: (H, W) light outside the box.
        box: rows and columns in which the light changes, None if it is constant everywhere.
        segments: light inside the box.
        pieces: all pieces of the call, whose planes must be checked.
        longest: upper limit of the length of a cycle over that of one without moves of the sampling
            instants.
    """

    steady: Plane
    box: Box | None
    segments: list[Segment]
    pieces: tuple[Piece, ...]
    longest: float = 1.0


def _box(met: tuple[Piece, ...]) -> Box | None:
    """The box of all changes from the start of the first of these pieces, None if there are
    none."""
    height, width = met[0].first.shape
    boxes = []
    for n, piece in enumerate(met):
        if piece.constant and (n == 0 or piece.first is met[n - 1].last):
            continue
        boxes.append(piece.changed or (0, height, 0, width))
    if not boxes:
        return None
    y0, y1, x0, x1 = zip(*boxes, strict=True)
    return min(y0), max(y1), min(x0), max(x1)


def _met(light: Light, begin: int, end: int) -> tuple[Piece, ...]:
    """The pieces of light between two instants, ps."""
    begun = bisect_left(light.pieces, end, key=attrgetter("start"))
    ended = bisect_right(light.pieces, begin, key=attrgetter("stop"))
    return light.pieces[ended:begun] or light.pieces[:1]


def parts_of(
    light: Light, clock: Clock, offsets: npt.NDArray[np.int64], start: int, cycles: int
) -> list[tuple[int, int]]:
    """Parts of a call, (first cycle within it, cycles): those in which the light of most of the
    plane changes, and the others. They begin with words of the output.

    Args:
        light, clock, offsets, start, cycles: see `course_of`.
    """
    earliest, latest = _ends_of(offsets)
    parts: list[tuple[int, int]] = []
    most = False
    for first in range(0, cycles, WORD):
        until = min(first + WORD, cycles)
        begin, end = clock.edge(start + first) + earliest, clock.edge(start + until) + latest
        y0, y1, x0, x1 = _box(_met(light, begin, end)) or (0, 0, 0, 0)
        wide = 2 * (y1 - y0) * (x1 - x0) > light.shape[0] * light.shape[1]
        if parts and wide == most:
            parts[-1] = parts[-1][0], until - parts[-1][0]
        else:
            parts.append((first, until - first))
        most = wide
    return parts


def _ends_of(offsets: npt.NDArray[np.int64]) -> tuple[int, int]:
    """The least and the most of the offsets."""
    if offsets.size == 1:
        return int(offsets[0]), int(offsets[0])
    return int(offsets.min()), int(offsets.max())


class _Run(NamedTuple):
    """Cycles `first` to `until` of the clock, which lie within a piece in all rows, as those up to
    `last` do."""

    first: int
    until: int
    last: int
    piece: Piece


def _positions(
    runs: list[_Run],
    clock: Clock,
    run_of: npt.NDArray[np.intp],
    cycles: npt.NDArray[np.int64],
    offsets: npt.NDArray[Any],
) -> npt.NDArray[np.float64]:
    """Position in their pieces, 0 to 1, of the middles of cycles, (n, rows).

    Args:
        runs: runs of cycles.
        clock: clock of the cycles.
        run_of: (n,) run of each cycle.
        cycles: (n, 1) or (n, rows).
        offsets: (rows,) or (n, rows) ps of these middles.
    """
    unit = PS * clock.den  # a cycle is unit / clock.num ps; integers are divided only once
    origins, begun, lengths = [], [], []
    for run in runs:
        piece = run.piece
        origin = clock.cycle_at(piece.start)
        origins.append(origin)
        begun.append((origin * unit - piece.start * clock.num) / unit + 0.5)
        lengths.append((piece.stop - piece.start) * clock.num / unit)
    phase = np.array(begun)[run_of, None] + offsets / (unit / clock.num)
    since = (cycles - np.array(origins)[run_of, None]).astype(np.float64)
    return np.asarray((phase + since) / np.array(lengths)[run_of, None])


def _begins(
    piece: Piece, clock: Clock, rows: npt.NDArray[np.int64], least: int, most: int
) -> npt.NDArray[np.int64]:
    """First cycle of each row that begins within a piece, (rows,). rows: offsets, ps, from `least`
    to `most`."""

    def first(offset: int) -> int:
        instant = max(piece.start - offset, 0)
        cycle = clock.cycle_at(instant)
        return cycle + (clock.edge(cycle) < instant)

    lowest = first(most)
    begins = np.full(rows.shape, lowest)
    for cycle in range(lowest, first(least)):
        begins += rows < piece.start - clock.edge(cycle)
    return begins


def _anchors(
    runs: list[_Run], clock: Clock, start: int, rows: npt.NDArray[np.int64]
) -> list[Weights]:
    """Anchors of each run; see `Segment`. They depend on the piece, the cycle and the row only.
    start: first cycle of the call."""
    words, run_of, cuts = [], [], []
    for n, run in enumerate(runs):
        some = range(run.first // WORD, (run.until - 1) // WORD + 1)
        words += [WORD * word for word in some]
        run_of += [n] * len(some)
        cuts.append(len(words))
    which, begin = np.array(run_of), np.array(words)[:, None]
    least, most = _ends_of(rows)
    begins = np.array([_begins(run.piece, clock, rows, least, most) for run in runs])
    cycles = np.maximum(begin, begins[which])
    ends = np.array([run.last for run in runs])[which, None]
    anchors = np.empty((*cycles.shape, 3), np.float32)
    anchors[..., 0] = _positions(runs, clock, which, cycles, rows)
    anchors[..., 1] = cycles - start
    anchors[..., 2] = np.minimum(begin + WORD, ends) - cycles
    return [anchors[a:b] for a, b in pairwise([0, *cuts])]


def _segments(
    parts: list[Any],
    clock: Clock,
    call: tuple[int, int],
    rows: npt.NDArray[np.int64],
    ends: npt.NDArray[np.int64] | None,
    dark: Plane | None,
    anchored: bool,
) -> list[Segment]:
    """The segments of the cycles of a call, from runs and segments in which pieces meet.

    All runs are computed at once, with few kinds of calls of numpy: the code of each has left the
    caches while the kernels of the previous call ran. Arguments: see `course_of`.
    """
    start, stop = call
    moving = [part for part in parts if isinstance(part, _Run) and not part.piece.constant]
    tick = PS * clock.den / clock.num
    # Weights of the last plane of a piece, of the dark plane, and of dead time. Other cycles have
    # any number.
    width = rows.size if ends is None else ends.shape[1]
    weights = np.empty((stop - start, width, 3), np.float32)
    middles: npt.NDArray[Any] = rows
    longer: Any = 0.0
    if ends is not None:
        middles, longer = (ends[:-1] + ends[1:]) / 2, (ends[1:] - ends[:-1]) / tick
        weights[..., 1], weights[..., 2] = -longer, 1 / (1 + longer)
    anchors: list[Weights] = []
    if moving:
        run_of = np.zeros(stop - start, np.intp)
        for n, run in enumerate(moving):
            run_of[run.first - start : run.until - start] = n
        each = np.arange(start, stop)[:, None]
        weights[..., 0] = _positions(moving, clock, run_of, each, middles) * (1 + longer)
        if anchored and dark is None:
            anchors = _anchors(moving, clock, start, rows)
    ramps = iter(anchors)
    segments = []
    for part in parts:
        if isinstance(part, Segment):
            segments.append(part)
            continue
        piece, first = part.piece, part.first - start
        planes = () if piece.constant else (piece.last,)
        columns = slice(int(piece.constant), 1 if dark is None else 3)
        mine = weights[first : part.until - start, :, columns]
        ramp = None if piece.constant else next(ramps, None)
        slope = 0.0 if ramp is None else tick / (piece.stop - piece.start)
        segments.append(
            Segment(
                first, part.until - part.first, piece.first,
                planes if dark is None else (*planes, dark), mine, ramp, slope,
            )
        )  # fmt: skip
    return segments


def _reach(offsets: npt.NDArray[np.int64], moves: RowMoves | None) -> tuple[int, int]:
    """Earliest and latest instant of a row from an edge, ps, with their moves."""
    earliest, latest = _ends_of(offsets)
    slack = 0 if moves is None else moves.most
    return earliest - slack, latest + slack


def check_covered(
    light: Light, clock: Clock, offsets: npt.NDArray[np.int64], start: int, cycles: int,
    moves: RowMoves | None = None,
) -> None:  # fmt: skip
    """Raises ValueError if the light does not cover the cycles; arguments: see `course_of`."""
    earliest, latest = _reach(offsets, moves)
    begin, end = max(clock.edge(start) + earliest, 0), clock.edge(start + cycles) + latest
    if light.pieces[0].start > begin or light.pieces[-1].stop < end:
        raise ValueError(
            f"light must cover {begin} to {end} ps, not "
            f"{light.pieces[0].start} to {light.pieces[-1].stop} ps"
        )


def course_of(
    light: Light,
    clock: Clock,
    offsets: npt.NDArray[np.int64],
    start: int,
    cycles: int,
    most: Any = np.inf,
    moves: RowMoves | None = None,
    dark: Plane | None = None,
    anchored: bool = False,
    band: tuple[int, int] | None = None,
) -> Course:
    """The course of light over cycles `start` to `start + cycles` of a clock.

    With moves of the sampling instants, a cycle that is longer by the share s has the light of a
    cycle, less -s of it: a plane that gathers nothing has the weight -s.

    Args:
        light: light on the pixels.
        clock: clock of the latches.
        offsets: (H,) or (1,) int64, ps from an edge to the sampling instant of a row.
        start: first cycle.
        cycles: number of cycles.
        most: upper limit of the light, one or (H, W).
        moves, dark: moves of the sampling instants, and a plane that gathers nothing; None for
            none.
        anchored: whether segments get anchors.
        band: rows (first, stop) that are the box whether or not their light changes; None for a box
            by the light.

    Raises:
        ValueError: the light does not cover the cycles.
    """
    check_covered(light, clock, offsets, start, cycles, moves)
    earliest, latest = _reach(offsets, moves)
    begin, end = clock.edge(start) + earliest, clock.edge(start + cycles) + latest
    met = _met(light, begin, end)
    box = _box(met) if band is None else (*band, 0, light.shape[1])
    if box is None:
        return Course(met[0].first, None, [], met)
    rows = offsets if offsets.size == 1 else offsets[box[0] : box[1]]
    if earliest == latest:
        rows = rows[:1]
    # Instants at which the cycles begin and end, (cycles + 1, rows) ps from their edges.
    ends = None if moves is None else rows + moves.moves(start, cycles + 1)
    stops = [p.stop for p in met]
    parts: list[_Run | Joint | Segment] = []
    c, stop = start, start + cycles
    while c < stop:
        begin, end = clock.edge(c) + earliest, clock.edge(c + 1) + latest
        n = bisect_right(stops, begin)
        piece = met[n]
        if begin >= piece.start and end <= piece.stop:
            last = clock.cycle_at(piece.stop - latest)
            parts.append(_Run(c, min(last, stop), last, piece))
            c = min(last, stop)
            continue
        meet = tuple(p for p in met[n:] if p.start < end) or met[:1]
        parts.append(Joint(c, meet))
        c += 1
    joints = [part for part in parts if isinstance(part, Joint)]
    known = iter(weighed(joints, clock, rows, ends, start, dark))
    for n, part in enumerate(parts):
        if isinstance(part, Joint):
            planes, weights = next(known)
            base = part.pieces[0].first
            if len(planes) >= MOST_PLANES:
                base, planes = merged(base, planes, weights, box, most), ()
                weights = weights[:, :0] if dark is None else weights[:, -1:]
            parts[n] = Segment(part.cycle - start, 1, base, planes, weights[None])
    segments = _segments(parts, clock, (start, stop), rows, ends, dark, anchored)
    longest = 1.0
    if ends is not None:
        longest += float((ends[1:] - ends[:-1]).max() * clock.num / (PS * clock.den)) + 1e-6
    return Course(met[0].first, box, segments, met, longest)
