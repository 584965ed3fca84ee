"""Exposure selection and sequencer with their registers, frame by frame, without pixels.

The caller provides the statistics of each frame: the whole imager, or a sequencer under constant
light.

The decision takes place when the last pixel of a frame has left. The next frame is being exposed
then, so the new exposure applies to the frame after it: exposure(k + 2) = decide(frame k). The
decision starts from the exposure of frame k, not from the multiplier register, which the decision
on frame k - 1 may have changed meanwhile. Starting from the register would follow one change of
light twice.

`SteadySequencer` is the sequencer under constant light behind a serial line.
"""

from __future__ import annotations

from typing import NamedTuple

from imagers.adaptive.device.decision import LONGEST, Decision, Search, Statistics, Window, decide
from imagers.adaptive.device.registers import DEFAULT_SHAPE, design_of
from imagers.adaptive.device.timing import FrameTiming, Sequencer, Timing, disturbed
from imagers.adaptive.pixels import CmosSetting
from imagers.common.registers import RegisterFile

_WORD = 0xFFFFFFFF


class Counting(NamedTuple):
    """Settings of the statistics of a frame, taken when the frame began.

    Attributes:
        window: pixels that count.
        threshold: number of saturated pixels that is allowed.
        whole_scan: whether the largest value is sought in the whole frame.
    """

    window: Window
    threshold: int
    whole_scan: bool


class Judged(NamedTuple):
    """Settings of the decision on a frame.

    Attributes:
        counting: settings of the statistics.
        multiplier: exposure of the frame, in units of T.
        search: how an exposure with too many saturated pixels is shortened.
        longest: exponent of the largest multiplier.
        user: exposure set by the user, in units of T; None for automatic exposure.
    """

    counting: Counting
    multiplier: int
    search: Search
    longest: int
    user: int | None

    def decision(self, statistics: Statistics) -> Decision:
        """The decision of the automatic exposure."""
        return decide(
            self.multiplier, statistics.saturated, statistics.largest,
            threshold=self.counting.threshold, search=self.search, longest=self.longest,
        )  # fmt: skip

    def chosen(self, statistics: Statistics) -> int:
        """The exposure of the frame after the next, in units of T."""
        return self.decision(statistics).multiplier if self.user is None else self.user


class Controller:
    """The controller. Call open() at clock frame.start and close() at frame.start +
    timing.deciding.

    Attributes:
        registers: register file.
        judged: settings of the last decision; None before it.

    Args:
        timing: timing of the sequencer.
        origin: clock at which it starts.
    """

    def __init__(self, timing: Timing, origin: int = 0) -> None:
        self.timing = timing
        self.registers = RegisterFile(design_of(timing))
        self.restart(origin)

    def restart(self, origin: int) -> None:
        """Restarts at a clock, with the present register values. The first two exposures are chosen
        by `begin`, so that earlier writes apply to them."""
        self._sequencer = Sequencer(self.timing, origin)
        self._past: list[FrameTiming] = []
        self._coming: list[tuple[FrameTiming, int]] = []
        self._counting: Counting | None = None
        self.judged: Judged | None = None

    def begin(self) -> None:
        """Starts the first exposures, of T or of the user's setting (document 001, section 2).
        Does nothing if they have started."""
        if self._coming:
            return
        first = 1 if self.registers.active("adaptive_automatic") else self._user
        self.registers.set("adaptive_multiplier", first)
        self._choose(first)
        self._choose(first)

    @property
    def frame(self) -> FrameTiming:
        """The frame that is read out now or next."""
        return self._coming[0][0]

    @property
    def following(self) -> FrameTiming:
        """The frame after it, whose rows may be being reset already."""
        return self._coming[1][0]

    @property
    def multiplier(self) -> int:
        """Exposure of `frame`, in units of the T of its decision; 0 before `begin`."""
        return self._coming[0][1] if self._coming else 0

    @property
    def opened(self) -> Counting | None:
        """Settings of the statistics of `frame`; None before `open`."""
        return self._counting

    def open(self) -> Counting:
        """Begins the frame: the registers of the window take effect."""
        self.registers.update("frame")
        at = self.registers.active
        rows, columns = at("adaptive_rows"), at("adaptive_columns")
        window = Window(rows & 0xFFFF, rows >> 16, columns & 0xFFFF, columns >> 16)
        self._counting = Counting(window, at("adaptive_threshold"), bool(at("adaptive_whole_scan")))
        return self._counting

    def close(self, statistics: Statistics) -> dict[str, float]:
        """Ends the frame when its last pixel has left: decides, and goes on to the next frame.
        Returns the figures of this frame. Raises RuntimeError for a frame that was not opened."""
        if self._counting is None:
            raise RuntimeError("a frame that was not opened cannot be closed")
        at = self.registers.active
        self.judged = Judged(
            self._counting, self.multiplier, Search(at("adaptive_search") or 1),
            min(at("adaptive_longest"), LONGEST),
            None if at("adaptive_automatic") else self._user,
        )  # fmt: skip
        flag = int(self.judged.decision(statistics).flag)
        chosen = self.judged.chosen(statistics)
        frame, largest = self.frame, 256 if statistics.largest is None else statistics.largest
        for name, value in (
            ("multiplier", chosen),
            ("last_frame", frame.number & _WORD),
            ("last_saturated", statistics.saturated),
            ("last_largest", largest),
            ("last_multiplier", self.multiplier),
            ("last_flag", flag),
            ("frames", (frame.number + 1) & _WORD),
        ):
            self.registers.set(f"adaptive_{name}", value)
        state = {
            "multiplier": self.multiplier,
            "exposure_clocks": frame.exposure,
            "saturated": statistics.saturated,
            "largest": largest,
            "flag": flag,
            "next_multiplier": chosen,
            "hold_clocks": frame.hold,
            "period_clocks": frame.period,
            "counter": frame.counter,
            "disturbed": disturbed(self.timing, [*self._past, frame]),
        }
        self._past = [frame]
        self._coming.pop(0)
        self._choose(chosen)
        self._counting = None
        return {name: float(value) for name, value in state.items()}

    @property
    def _minimum(self) -> int:
        return max(1, self.registers.active("adaptive_minimum"))

    @property
    def _user(self) -> int:
        return min(max(1, self.registers.active("adaptive_user")), 1 << LONGEST)

    def _choose(self, multiplier: int) -> None:
        timing = self._sequencer.step(multiplier * self._minimum)
        self._coming.append((timing, multiplier))


class SteadySequencer:
    """The sequencer; see `BusTarget`.

    Args:
        timing: timing of the array.
        lux: constant illuminance on every pixel.
        setting: setting of the signal chain; None for the default.
    """

    def __init__(self, timing: Timing, lux: float = 100.0, setting: CmosSetting | None = None):
        self._core = Controller(timing)
        self._lux, self._setting = lux, setting or CmosSetting()

    @property
    def registers(self) -> RegisterFile:
        return self._core.registers

    def advance(self, clock: int) -> None:
        """Runs all edges before a clock."""
        core = self._core
        if clock > 0:
            core.begin()
        while core.frame.start < clock:
            if core.opened is None:
                core.open()
            if core.frame.start + core.timing.deciding >= clock:
                return
            core.close(self._statistics())

    def reset(self, clock: int) -> None:
        """Restarts at a clock."""
        self._core.restart(clock)
        self._core.begin()

    def _statistics(self) -> Statistics:
        seconds = self._core.frame.exposure / self._core.timing.clock.hz
        value, saturated = self._setting.value(self._lux, seconds)
        opened = self._core.opened
        pixels = opened.window.size if opened is not None else 0
        if pixels == 0:
            return Statistics(0, None)
        return Statistics(pixels, None) if saturated else Statistics(0, value)


def bus_target() -> SteadySequencer:
    """The sensor of `viform board virtual`: 256 x 256 pixels (assumed) at 100 frames/s, 100 lx."""
    return SteadySequencer(Timing.of(*DEFAULT_SHAPE))
