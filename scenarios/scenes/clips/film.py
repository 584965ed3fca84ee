"""A clip as a scene: its frames at their instants, with linear interpolation of light in between.

Frames that are not evenly spaced have the instants of the clip's container. A clip has no
information between its frames; linear interpolation is the definition of the truth for this scene,
and a note states it. If the clip is shorter than the run, its last frame is held.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np

from cosim import PS, Block, Clock, InputError, Light, Piece, Plane, seconds_to_ps
from cosim.light.mosaic import Mosaic
from cosim.light.source import Points
from cosim.light.survey import Frames
from scenarios.scenes.clips.clip import Clip
from scenarios.scenes.clips.pictures import Pictures, open_clip
from scenarios.scenes.drawing.analytic import spread_points

_FOREVER = 2**62


class FilmSource:
    """A clip as the `Source` of a run.

    Args:
        path: file of the clip.
        shape: (height, width), pixels.
        illuminance: illuminance of the scene, lux.
        clock: latch clock.
        cycles: length of the run, cycles.
        start: time in the clip at the start of the run, s.
        rate: frame rate, 1/s; None for that of the clip.
        mosaic: filter array on the pixels, which see the colours of the clip; None for none.
        clip: the opened clip in place of that of `path`, which then only names it; None to open it.
        gain: factor of a lens by which `step` multiplies the light, which then is illuminance; None
            for exitance.

    Attributes:
        coloured: whether the light already is that behind the filters.
    """

    _MIXED = True
    """Whether the frames that the clip gives are mixed to the mosaic."""
    _BETWEEN = "light interpolated linearly in time between frames"

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
        clip: Clip | Pictures | None = None,
        gain: np.float32 | None = None,
    ) -> None:
        self.shape, self._gain = shape, gain
        self.coloured = mosaic is not None
        self._clip = clip or open_clip(path, shape, mosaic, self._MIXED, rate)
        self._lux = np.float32(illuminance * (1.0 if mosaic is None else mosaic.white))
        self._clock = clock
        self._start = seconds_to_ps(start)
        self._stop = clock.edge(cycles)
        clip_rate = self._clip.rate
        self._rate = Fraction(repr(rate)) if rate is not None and clip_rate else clip_rate
        self._timeline = self._clip.timeline if rate is None else None
        self._planes: dict[int, Plane] = {}
        self._pieces: dict[int, Piece] = {}
        self._held, self._given = False, clip is not None
        self.degraded: list[str] = []
        self.notes = list(self._clip.notes) if clip else self._clip.notes
        if not clip_rate:
            given = () if clip else (("start", start), ("frame_rate", rate))
            idle = [f"scene.{k}" for k, v in given if v]
            note = f"; {' and '.join(idle)} {'has' if len(idle) == 1 else 'have'} no effect"
            self.notes.append(f"{path.name} is a still image{note if idle else ''}")
        else:
            note = f"{path.name}: {float(self._rate):g} frames/s"
            if self._uneven():  # the container does not always have their mean rate
                note = f"{path.name}: frames not evenly spaced: each has its time in the clip"
            if self._rate != clip_rate:
                note += f" by scene.frame_rate (the clip has {float(clip_rate):g})"
            self.notes.append(f"{note}, {self._BETWEEN}")
        first = self._frame_number(0)
        if first and self._clip.frame(first) is None:
            length = self._clip.count / float(self._rate)
            by, remedy = "", "start earlier"
            if self._rate != clip_rate:
                by = f" at {float(self._rate):g} frames/s"
                remedy = (
                    "start earlier: it counts time at scene.frame_rate, where a second of the file "
                    f"takes {float(clip_rate / self._rate):.3g} s"
                )
            raise InputError(
                "scene.start", f"within the {length:.3g} s of the clip{by}", f"{start:g} s", remedy
            )  # fmt: skip

    def _uneven(self) -> bool:
        """Whether frames within the run are not evenly spaced, by the packets of the clip. False if
        the scenario sets the frame rate."""
        if self._timeline is None:
            return False
        self._timeline.number_at(self._start + self._stop)
        return self._timeline.uneven

    def _frame_number(self, ps: int) -> int:
        """Number of the frame at the instant `ps` of the run."""
        if not self._rate:
            return 0
        if self._timeline is not None:
            return self._timeline.number_at(ps + self._start)
        return Clock(self._rate.numerator, self._rate.denominator).cycle_at(ps + self._start)

    def _edge(self, n: int) -> int:
        """Instant of frame n in the run, ps."""
        if self._timeline is not None:
            return self._timeline.edge(n) - self._start
        return Clock(self._rate.numerator, self._rate.denominator).edge(n) - self._start

    def _frame(self, n: int) -> Plane | None:
        """Frame n as the pixels see it, white = 1; None if the clip ends before it."""
        return self._clip.frame(n)

    def _times(self, n: int, factor: np.float32) -> Plane | None:
        """Frame n times a factor; None if the clip ends before it."""
        if isinstance(self._clip, Pictures) and self._clip.given is not None:
            return self._clip.times(n, factor, self._gain)
        frame = self._frame(n)
        if frame is None:
            return None
        lit: Plane = frame * factor
        return lit if self._gain is None else lit * self._gain

    def _last(self) -> Plane:
        """The last frame of a clip that has ended, or a still image."""
        return self._clip.last()

    def _lit(self, n: int) -> Plane | None:
        """Exitance of frame n, lux; None if the clip ends before it."""
        if n not in self._planes:
            plane = self._times(n, self._lux)
            if plane is None:
                return None
            self._planes = {k: p for k, p in self._planes.items() if k >= n - 1}
            self._planes[n] = plane
        return self._planes[n]

    def _piece(self, n: int) -> Piece:
        """Light from frame n to frame n + 1; the last frame has no end."""
        if n not in self._pieces:
            first = self._lit(n)
            if first is None:  # the clip ends before frame n: only after a resume
                return self._piece(self._clip.count - 1)
            begin = self._edge(n) if self._rate else -self._start
            last = self._lit(n + 1) if self._rate else None
            if last is None:
                self._note_end(n, begin)
                last, stop = first, _FOREVER
            else:
                stop = self._edge(n + 1)
            self._pieces = {k: p for k, p in self._pieces.items() if k >= n - 1}
            self._pieces[n] = Piece(begin, stop, first, last)
        return self._pieces[n]

    def _note_end(self, n: int, begin: int) -> None:
        if not self._rate or self._held:
            return
        # Frames that were given last as long as they say: the last one as any other.
        if self._stop > (self._edge(n + 1) if self._given else begin):
            self._held = True
            if begin <= 0:
                self.degraded.append(
                    "the run starts at the last frame of the clip, which is held throughout; lower "
                    "scene.start"
                )
                return
            self.degraded.append(
                f"the clip ends {begin / PS * 1e3:.4g} ms into the run: its last frame is "
                "held; shorten duration or lower scene.frame_rate"
            )

    def step(self, data: None, block: Block) -> Light:
        start, stop = self._clock.edge(block.start), self._clock.edge(block.stop)
        pieces = [self._piece(self._frame_number(start))]
        n = self._frame_number(start)
        while pieces[-1].stop < stop:
            n += 1
            pieces.append(self._piece(n))
        return Light(tuple(pieces))

    def frames(self, cycles: int) -> Frames | None:
        """The frames of a run, if they are in memory on the grid of the pixels."""
        clip, first = self._clip, self._frame_number(0)
        if not (isinstance(clip, Pictures) and clip.given is not None and self._rate):
            return None
        count, stop = len(clip.given), self._clock.edge(cycles)
        n = first
        while n + 1 < count and self._edge(n + 1) < stop:
            n += 1
        used = range(first, min(n + 2, count))  # the last frame of a clip is held
        if not used:
            return None
        edges = tuple(self._edge(k) for k in used)
        table = clip.table(self._lux, self._gain)
        return Frames(clip.given[used.start : used.stop], table, edges, n + 1 - first)

    def truth(self, ps: int) -> Plane:
        if not self._rate:
            return self._last()
        n = self._frame_number(ps)
        first = self._frame(n)
        if first is None:
            return self._last()
        last = self._frame(n + 1)
        if last is None:
            return first
        return first + (last - first) * self._between(n, ps)

    def _between(self, n: int, ps: int) -> np.float32:
        """Part of the time from frame n to the next that has passed at an instant, ps."""
        edge = self._edge(n)
        return np.float32((ps - edge) / (self._edge(n + 1) - edge))

    def truth_at(self, ps: int, points: Points) -> list[float]:
        """See `cosim.light.source.truth_at`."""
        n = self._frame_number(ps)
        first, last = self._frame(n), self._frame(n + 1) if self._rate else None
        if first is None or last is None:
            plane = self.truth(ps)
            return [float(plane[row, column]) for row, column, _ in points]
        share = self._between(n, ps)
        ends = ((first[y, x], last[y, x]) for y, x, _ in points)
        return [float(a + (b - a) * share) for a, b in ends]

    def points(self) -> list[tuple[int, int, str]]:
        return spread_points(self.shape)
