"""A clip as a scene whose light moves along the optical flow between its frames.

The scene is defined by planes between two frames, as many as keep any motion between them below
MOTION_STEP pixels, and linear interpolation from plane to plane; `Between` draws them. So the light
is a function of the clip alone, whatever the blocks of a run, and it is drawn as the run needs it:
two pairs of frames are held.

What cannot be known without a look at all frames is found in a pass over the clip, when the scene
is made: for how many pixels the flows disagree, and the range of the light.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim import PS, Block, Clock, InputError, Light, Piece, Plane
from cosim.config.amounts import number, percent
from cosim.light.mosaic import Mosaic
from cosim.light.source import Points, Sketch
from cosim.run.result import Metric
from scenarios.scenes.clips.film import FilmSource
from scenarios.scenes.clips.motion import Between
from scenarios.scenes.drawing.analytic import MOTION_STEP

_SKETCHED: Final = 4
"""Every how many planes one is drawn for the range of the light."""
_KEPT: Final = 2
"""Passes over clips that are remembered: a scene is made anew for each pass of a run."""
_COURSES: dict[Any, _Course] = {}


@dataclass(frozen=True, eq=False)
class _Course:
    """What a pass over the frames of a run finds.

    Attributes:
        share: share of pixels and time for which the flows disagree.
        difference: RMS difference from linear interpolation midway between frames, white = 1.
        longest: largest motion from frame to frame where the flows agree, pixels.
        cuts: number of pairs of frames without common motion.
        planes: new planes of light in the run.
        least, most: range of the light, (H, W), white = 1.
        example: first frame of the pair with the greatest difference from linear interpolation.
    """

    share: float
    difference: float
    longest: float
    cuts: int
    planes: int
    least: Plane
    most: Plane
    example: int


@dataclass(frozen=True, eq=False)
class Example:
    """The light midway between two frames, with both kinds of interpolation, (H, W), white = 1.

    Attributes:
        seconds: its instant in the run, s.
        linear, motion: the light.
    """

    seconds: float
    linear: Plane
    motion: Plane


class MotionFilm(FilmSource):
    """A clip as the `Source` of a run, with motion between its frames.

    Args: those of `FilmSource`. Raises InputError for a still image.

    Attributes:
        metrics: what of the light is interpolated linearly, and the difference from linear
            interpolation.
    """

    _MIXED = False
    _BETWEEN = "light moved along the optical flow between frames"

    def __init__(
        self,
        path: Path,
        shape: tuple[int, int],
        illuminance: float,
        clock: Clock,
        cycles: int,
        start: float = 0.0,
        rate: float | None = None,
        mosaic: Mosaic | None = None,
    ) -> None:
        super().__init__(path, shape, illuminance, clock, cycles, start, rate, mosaic)
        if not self._rate:
            raise InputError(
                "scene.interpolation", "linear for a still image", f"motion with {path}",
                "leave it out, or give a clip as scene.path",
            )  # fmt: skip
        self._mosaic = mosaic
        self._spans: dict[int, Between | None] = {}
        self._lights: dict[tuple[int, int], Plane] = {}
        self._parts: dict[tuple[int, int], Piece] = {}
        self._truths: dict[tuple[int, int], Plane] = {}
        file = path.stat()
        key = (path.resolve(), file.st_mtime_ns, file.st_size, shape, clock, cycles, start, rate,
               mosaic)  # fmt: skip
        if key not in _COURSES:
            for old in list(_COURSES)[: 1 - _KEPT]:
                del _COURSES[old]
            _COURSES[key] = self._survey()
        self._course = course = _COURSES[key]
        self.metrics = {
            "motion_linear": Metric(course.share, "1"),
            "motion_difference": Metric(course.difference, "1"),
        }
        note = (
            f"the flows forward and backward disagree for {percent(course.share)} of the pixels, "
            "which are interpolated linearly; elsewhere light moves by at most "
            f"{number(course.longest)} pixels a frame, drawn every {MOTION_STEP:g} pixel; midway "
            "between frames it differs from linear interpolation by "
            f"{number(course.difference, 2)} RMS, white = 1"
        )
        if course.cuts:
            note += f"; pairs of frames without common motion, as across a cut: {course.cuts}"
        self.notes.append(note)

    # Frames and planes, white = 1.

    def _mixed(self, plane: Plane) -> Plane:
        return plane if self._mosaic is None else self._mosaic.mixed(plane)

    def _frame(self, n: int) -> Plane | None:
        frame = self._clip.frame(n)
        return None if frame is None else self._mixed(frame)

    def _last(self) -> Plane:
        return self._mixed(self._clip.last())

    def _span(self, n: int) -> Between | None:
        """The light from frame n to frame n + 1; None if the clip ends before the latter."""
        if n not in self._spans:
            first, last = self._clip.frame(n), self._clip.frame(n + 1)
            self._spans = dict(list(self._spans.items())[-1:])
            self._spans[n] = None if first is None or last is None else Between(first, last)
        return self._spans[n]

    def _survey(self) -> _Course:
        n = example = self._frame_number(0)
        spent = share = square = longest = greatest = 0.0
        cuts = planes = 0
        first = self._frame(n)
        assert first is not None  # `FilmSource` refuses a run that starts beyond the end
        least, most = first.copy(), first.copy()
        while self._edge(n) < self._stop and (span := self._span(n)) is not None:
            part = (min(self._edge(n + 1), self._stop) - max(self._edge(n), 0)) / PS
            spent, share = spent + part, share + part * span.share
            square += part * span.difference**2
            longest, cuts = max(longest, span.longest), cuts + (span.share == 1)
            planes += span.planes
            if span.difference > greatest:
                example, greatest = n, span.difference
            half = span.planes // 2
            for k in {*range(_SKETCHED, span.planes, _SKETCHED), half, span.planes}:
                drawn = self._mixed(span.at(k))
                np.minimum(least, drawn, out=least)
                np.maximum(most, drawn, out=most)
            n += 1
        self._spans = {}
        spent = spent or 1.0  # the last frame is held throughout
        difference = float(np.sqrt(square / spent))
        return _Course(share / spent, difference, longest, cuts, planes, least, most, example)

    # Light in the run.

    def _knot(self, n: int, span: Between, k: int) -> int:
        """Instant of plane k between frame n and the next, ps."""
        begin = self._edge(n)
        return begin + (self._edge(n + 1) - begin) * k // span.planes

    def _number(self, n: int, span: Between, ps: int) -> int:
        """Number of the last plane at or before an instant between frame n and the next."""
        begin = self._edge(n)
        k = (ps - begin) * span.planes // (self._edge(n + 1) - begin)
        return k + 1 if self._knot(n, span, k + 1) <= ps else k

    def _light(self, n: int, span: Between, k: int) -> Plane:
        """Exitance at plane k after frame n, lux; frames have one plane each."""
        if k == span.planes:
            n, k = n + 1, 0
        if k == 0:
            plane = self._lit(n)
            assert plane is not None
            return plane
        if (n, k) not in self._lights:
            self._lights = dict(list(self._lights.items())[-1:])
            self._lights[n, k] = self._mixed(span.at(k)) * self._lux
        return self._lights[n, k]

    def _part(self, ps: int) -> tuple[tuple[int, int], Piece]:
        """The piece of light that contains an instant, and its key."""
        n = self._frame_number(ps)
        span = self._span(n)
        if span is None:
            return (n, 0), self._piece(n)
        k = self._number(n, span, ps)
        if (n, k) not in self._parts:
            start, stop = self._knot(n, span, k), self._knot(n, span, k + 1)
            self._parts[n, k] = Piece(
                start, stop, self._light(n, span, k), self._light(n, span, k + 1)
            )
        return (n, k), self._parts[n, k]

    def frames(self, cycles: int) -> None:
        """None: the light between frames is none of theirs."""

    def step(self, data: None, block: Block) -> Light:
        start, stop = self._clock.edge(block.start), self._clock.edge(block.stop)
        first, piece = self._part(start)
        pieces = [piece]
        while pieces[-1].stop < stop:
            pieces.append(self._part(pieces[-1].stop)[1])
        self._parts = {key: part for key, part in self._parts.items() if key >= first}
        return Light(tuple(pieces))

    # The truth, white = 1.

    def _true(self, n: int, span: Between, k: int) -> Plane:
        if (n, k) not in self._truths:
            self._truths = dict(list(self._truths.items())[-1:])
            self._truths[n, k] = self._mixed(span.at(k))
        return self._truths[n, k]

    def _share(self, n: int, span: Between, k: int, ps: int) -> np.float32:
        """Position of an instant from plane k to the next, 0 to 1."""
        start, stop = self._knot(n, span, k), self._knot(n, span, k + 1)
        return np.float32((ps - start) / (stop - start))

    def truth(self, ps: int) -> Plane:
        n = self._frame_number(ps)
        span = self._span(n)
        if span is None:
            return super().truth(ps)
        k = self._number(n, span, ps)
        first, last = self._true(n, span, k), self._true(n, span, k + 1)
        return first + (last - first) * self._share(n, span, k, ps)

    def truth_at(self, ps: int, points: Points) -> list[float]:
        """See `cosim.light.source.truth_at`."""
        n = self._frame_number(ps)
        span = self._span(n)
        if span is None or self._mosaic is not None:
            plane = self.truth(ps)
            return [float(plane[row, column]) for row, column, _ in points]
        k = self._number(n, span, ps)
        share, found = self._share(n, span, k, ps), []
        for y, x, _ in points:
            first, last = (span.at(j, (y, y + 1, x, x + 1))[0, 0] for j in (k, k + 1))
            found.append(float(first + (last - first) * share))
        return found

    def example(self) -> Example | None:
        """The light midway between the two frames for which motion matters most; None if it is
        linear throughout."""
        n = self._course.example
        span = self._span(n)
        if span is None or span.planes == 1:
            return None
        half = span.planes // 2
        return Example(
            self._knot(n, span, half) / PS, self._mixed(span.linear(0.5)),
            self._mixed(span.at(half)),
        )  # fmt: skip

    def sketch(self, cycles: int, samples: int) -> Sketch:
        """The range of the light: from every `_SKETCHED`-th plane, whatever `samples` is."""
        course, (height, width) = self._course, self.shape
        planes = [course.least * self._lux, course.most * self._lux]
        moves = course.longest > 0
        box = (0, height, 0, width) if moves else (0, 0, 0, 0)
        reach = _SKETCHED / 2 * MOTION_STEP if moves else 0.0
        return Sketch(planes, reach, box, course.planes / cycles)
