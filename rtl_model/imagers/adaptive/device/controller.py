"""`Controller`: exposure selection and sequencer over the registers, frame by frame, without
pixels. The whole imager gives it what the statistics saw; so does a sequencer under plain light.

A decision is made when a frame's last pixel has left. The next frame is then exposing already, so
the new exposure is the one after: exposure(k + 2) = decide(frame k). It is reckoned from the
exposure that frame k had, not from the multiplier register, which frame k - 1's decision may have
changed meanwhile: taking that one would follow one change of light twice.
"""

from __future__ import annotations

from typing import NamedTuple

from rtl_model.imagers.adaptive.device.decision import LONGEST, Decision, Search, decide
from rtl_model.imagers.adaptive.device.registers import design_of
from rtl_model.imagers.adaptive.device.sequencer import Sequencer, disturbed
from rtl_model.imagers.adaptive.device.statistics import Statistics, Window
from rtl_model.imagers.adaptive.device.timing import FrameTiming, Timing
from rtl_model.imagers.device.register_file import RegisterFile

__all__ = ["Controller", "Counting", "Judged"]

_WORD = 0xFFFFFFFF


class Counting(NamedTuple):
    """What the statistics of a frame go by, as it stood when the frame began."""

    window: Window
    threshold: int
    whole_scan: bool


class Judged(NamedTuple):
    """How a frame was judged. counting: see there. multiplier: of its exposure. user: multiple of T
    that holds while the exposure is not automatic, else None."""

    counting: Counting
    multiplier: int
    search: Search
    longest: int
    user: int | None

    def decision(self, seen: Statistics) -> Decision:
        """What the statistics of the frame lead to."""
        return decide(
            self.multiplier, seen.saturated, seen.largest, threshold=self.counting.threshold,
            search=self.search, longest=self.longest,
        )  # fmt: skip

    def chosen(self, seen: Statistics) -> int:
        """The multiple of T that the frame after the next is exposed with."""
        return self.decision(seen).multiplier if self.user is None else self.user


class Controller:
    """frame: the next to be read out, with multiplier its multiple of T. origin: clock at which it
    starts. Call open() at frame.start and close() at frame.start + timing.deciding."""

    def __init__(self, timing: Timing, origin: int = 0) -> None:
        self.timing = timing
        self.registers = RegisterFile(design_of(timing))
        self.restart(origin)

    def restart(self, origin: int) -> None:
        """Begins anew at a clock, with the registers as they stand. The first two exposures wait
        for `begin`, so that what is written before it holds."""
        self._sequencer = Sequencer(self.timing, origin)
        self._ahead: list[tuple[int, int]] = []
        self._frames: list[FrameTiming] = []
        self._multiplier = 0
        self._counting: Counting | None = None
        self.judged: Judged | None = None
        """How the last frame was."""

    def begin(self) -> None:
        """Exposes with T, or with what the user has set (document 001, section 2); nothing where
        it has begun."""
        if self._frames:
            return
        first = 1 if self.registers.active("adaptive_automatic") else self._user
        self.registers.set("adaptive_multiplier", first)
        self._ahead = [(first * self._minimum, first)] * 2
        self._next()

    @property
    def frame(self) -> FrameTiming:
        """The frame that is read out next, or is being read out."""
        return self._frames[-1]

    @property
    def multiplier(self) -> int:
        """Its exposure over T when it was chosen."""
        return self._multiplier

    @property
    def opened(self) -> Counting | None:
        """What `open` gave for this frame; None before it."""
        return self._counting

    def open(self) -> Counting:
        """The frame begins: the window's registers are taken."""
        self.registers.update("frame")
        at = self.registers.active
        rows, columns = at("adaptive_rows"), at("adaptive_columns")
        window = Window(rows & 0xFFFF, rows >> 16, columns & 0xFFFF, columns >> 16)
        self._counting = Counting(window, at("adaptive_threshold"), bool(at("adaptive_whole_scan")))
        return self._counting

    def close(self, seen: Statistics) -> dict[str, float]:
        """The frame's last pixel has left: decides and goes on to the next frame. Returns the
        figures of this one. RuntimeError where it was not opened."""
        if self._counting is None:
            raise RuntimeError("a frame that was not opened cannot be closed")
        at = self.registers.active
        self.judged = Judged(
            self._counting, self._multiplier, Search(at("adaptive_search") or 1),
            min(at("adaptive_longest"), LONGEST),
            None if at("adaptive_automatic") else self._user,
        )  # fmt: skip
        made, chosen = self.judged.decision(seen), self.judged.chosen(seen)
        frame, largest = self.frame, 256 if seen.largest is None else seen.largest
        for name, value in (
            ("multiplier", chosen),
            ("last_frame", frame.number & _WORD),
            ("last_saturated", seen.saturated),
            ("last_largest", largest),
            ("last_multiplier", self._multiplier),
            ("last_flag", int(made.flag)),
            ("frames", (frame.number + 1) & _WORD),
        ):
            self.registers.set(f"adaptive_{name}", value)
        state = {
            "multiplier": self._multiplier,
            "exposure_clocks": frame.exposure,
            "saturated": seen.saturated,
            "largest": largest,
            "flag": int(made.flag),
            "next_multiplier": chosen,
            "hold_clocks": frame.hold,
            "period_clocks": frame.period,
            "counter": frame.counter,
            "disturbed": disturbed(self.timing, self._frames),
        }
        self._ahead.append((chosen * self._minimum, chosen))
        self._next()
        return {name: float(value) for name, value in state.items()}

    @property
    def _minimum(self) -> int:
        return max(1, self.registers.active("adaptive_minimum"))

    @property
    def _user(self) -> int:
        return min(max(1, self.registers.active("adaptive_user")), 1 << LONGEST)

    def _next(self) -> None:
        exposure, self._multiplier = self._ahead.pop(0)
        self._frames = [*self._frames[-1:], self._sequencer.step(exposure)]
        self._counting = None
