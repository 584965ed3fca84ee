"""The EBAPS board's registers and its sequencer, without pixels: VSYNC, exposure, KEY, high
voltage, exposure loop and dark frames.

The names KEY, step, window and the exposures' limits are document 002's; addresses and the rest are
ours. Exposures are in ns, as the document gives them; the high voltage is its magnitude in volts.

A frame has two events: at its VSYNC it takes exposure, KEY, voltage and shutter from the registers;
after its last pixel was read, the loop judges its mean. A function provides the pixels, so that the
sequencer also runs without them (registers over a serial line, clock counts).

Behind a serial line (`bus_target`) it runs in steady light. The light gives the middle of the
loop's window at an exposure of 20 ms, without dark level, so that the loop can be observed through
its registers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from imagers.common.registers import RegisterFile
from imagers.ebaps.board.timing import CLOCK_HZ, Timing
from imagers.ebaps.device.exposure import (
    DARKS,
    DEFAULT_EXPOSURE,
    SHORTEST_EXPOSURE,
    STEP,
    WINDOW,
    ExposureRule,
)
from rtl_model.registers import Field, Register
from rtl_model.registers.design import Design

_ON, _EVERY, _RAW = 1, 2, 4
_WANTED = 20_000_000
"""ns."""
HIGH_VOLTAGE = 1500
"""Largest high voltage of the tests, V: document 002, section 4."""
REGISTERS: tuple[Register, ...] = (
    Register("ebaps_key", 0x300, "rw", 0, 1, "KEY: 1 stores dark frames, 0 stores live ones"),
    Register("ebaps_high_voltage", 0x304, "rw", HIGH_VOLTAGE, 11, "V below ground, 1500 at most"),
    Register("ebaps_exposure", 0x308, "rw", DEFAULT_EXPOSURE, 26, "ns; the loop writes it too"),
    Register(
        "ebaps_loop", 0x30C, "rw", 1, 3, "exposure loop",
        fields=(
            Field("on", 0, 0, "1 lets the loop set the exposure, except while darks are taken"),
            Field("every", 1, 1, "1 acts on every frame, 0 on those that show its last action"),
            Field("raw", 2, 2, "1 takes the mean before dark subtraction, 0 after it"),
        ),
    ),
    Register("ebaps_window_low", 0x310, "rw", WINDOW[0], 16, "DN, least mean that stays"),
    Register("ebaps_window_high", 0x314, "rw", WINDOW[1], 16, "DN, largest mean that stays"),
    Register("ebaps_step", 0x318, "rw", STEP, 26, "ns"),
    Register("ebaps_shortest", 0x31C, "rw", SHORTEST_EXPOSURE, 26, "T_min, ns"),
    Register("ebaps_longest", 0x320, "rw", Timing().longest_exposure, 26, "T_max, ns"),
    Register("ebaps_subtract", 0x324, "rw", 1, 1, "1 takes the mean of four darks away"),
    Register("ebaps_pedestal", 0x328, "rw", 0, 16, "DN added to the difference"),
    Register(
        "ebaps_shutter", 0x32C, "rw", 2, 2, "0 open, 1 closed, 2 closed while KEY is 1 (3 as 2)"
    ),
    Register(
        "ebaps_refresh", 0x330, "rw", 0, 1,
        "1 stores four darks by itself when the loop rests at an exposure they were not taken at",
    ),
    Register("ebaps_frames", 0x340, "ro", 0, 32, "frames read since power-on"),
    Register("ebaps_mean", 0x344, "ro", 0, 16, "DN, of the last live frame, rounded down"),
    Register("ebaps_dark_exposure", 0x348, "ro", 0, 26, "ns, of the darks; 0 if not four alike"),
    Register(
        "ebaps_status", 0x34C, "ro", 0, 6, "what the last frame said",
        fields=(
            Field("settled", 0, 0, "its mean lies in the window and its exposure stands"),
            Field("dark", 1, 1, "too dark even at the longest exposure"),
            Field("bright", 2, 2, "too bright even at the shortest exposure"),
            Field("darks", 3, 3, "four dark frames are stored"),
            Field("stale", 4, 4, "they are of another exposure or voltage than stands now"),
            Field("key", 5, 5, "it was a dark frame"),
        ),
    ),
)  # fmt: skip
DESIGN = Design(
    "ebaps",
    2,
    "EBAPS imaging circuit",
    (Timing().rows, Timing().columns),
    CLOCK_HZ,
    REGISTERS,
    {
        entry.name: "frame"
        for entry in REGISTERS
        if entry.mode == "rw" and entry.name in ("ebaps_key", "ebaps_high_voltage", "ebaps_shutter")
    },
)
"""What is taken with a frame is taken when its VSYNC falls; limits and the loop act at once."""


@dataclass(frozen=True)
class Shot:
    """Settings of a frame at its VSYNC.

    Attributes:
        number: number from 0.
        exposure: ns.
        volts: magnitude.
        key: stored as a dark frame, in `region`.
        closed: the shutter.
    """

    number: int
    exposure: int
    volts: int
    key: bool
    closed: bool
    region: int


@dataclass(frozen=True)
class Read:
    """Sums over a frame that was read.

    Attributes:
        raw, total: sums of all values before and after subtraction of darks, DN.
        pixels: how many.
    """

    raw: int
    total: int
    pixels: int


@dataclass(frozen=True)
class Judged:
    """How a live frame was judged.

    Attributes: rule: the loop with the register values of that time. standing: exposure of the
    register at that time, ns. exposed: exposure of the frame, ns. raw: before subtraction of darks.
    acts: whether the loop sets the exposure.
    """

    rule: ExposureRule
    standing: int
    exposed: int
    raw: bool
    acts: bool

    def chosen(self, total: int, pixels: int) -> int:
        """The exposure after this judgement, ns. total: sum of the values of the frame, DN."""
        if not self.acts:
            return self.standing
        return self.rule.judged(self.standing, self.exposed, total, pixels)


def no_light(shot: Shot) -> Read:
    """A frame of zeros."""
    return Read(0, 0, 1)


class Sequencer:
    """registers: of the board. frames: makes the pixels of a frame that has been exposed."""

    def __init__(
        self, frames: Callable[[Shot], Read] = no_light, timing: Timing | None = None
    ) -> None:
        self.registers = RegisterFile(DESIGN)
        self.timing = Timing() if timing is None else timing
        self.frames = frames
        for name in ("mean", "dark_exposure", "status", "frames"):
            self.registers.on_read[f"ebaps_{name}"] = lambda n=name: self._told[n]  # type: ignore[misc]
        self.reset(0)

    def reset(self, clock: int) -> None:
        """Restarts frames at number 0; time continues. Dark frames must be stored again."""
        self._origin = clock
        self._next = 0  # frame whose VSYNC comes next
        self._waiting: list[Shot] = []
        self._darks: list[tuple[int, int]] = []
        self._region = 0
        self._ahead = 0  # dark frames that the refresh has still to begin
        self._told = {"mean": 0, "dark_exposure": 0, "status": 0, "frames": 0}
        self.last: Shot | None = None
        self.judged: Judged | None = None

    @property
    def rule(self) -> ExposureRule:
        """The loop with the present register values."""
        at = self._at
        return ExposureRule(
            at("window_low"), at("window_high"), at("step"), at("shortest"),
            min(at("longest"), self.timing.longest_exposure), not at("loop") & _EVERY,
        )  # fmt: skip

    @property
    def has_darks(self) -> bool:
        """Whether four dark frames are stored."""
        return len(self._darks) == DARKS

    @property
    def stale(self) -> bool:
        """Whether dark frames are missing, or have another exposure or voltage than now."""
        now = (self._at("exposure"), self._volts())
        return not self.has_darks or any(dark != now for dark in self._darks)

    @property
    def status(self) -> int:
        """Value of the status register."""
        return self._told["status"]

    @property
    def mean(self) -> int:
        """Mean of the last live frame, DN."""
        return self._told["mean"]

    @property
    def dark_exposure(self) -> int:
        """Exposure of the dark frames, ns; 0 unless four of one exposure are stored."""
        return self._told["dark_exposure"]

    @property
    def upcoming(self) -> int:
        """Number of the frame of the next VSYNC."""
        return self._next

    def around(self, shot: Shot) -> tuple[int | None, int, int | None]:
        """Exposures (ns) of the frame that is being read, of the one before and of the next, whose
        period has begun; None if there is no such frame."""
        before = None if self.last is None else self.last.exposure
        return before, shot.exposure, self._waiting[0].exposure if self._waiting else None

    def subtracts(self) -> bool:
        """Whether dark frames are subtracted from a live frame that is read now."""
        return bool(self._at("subtract")) and self.has_darks

    def pedestal(self) -> int:
        """DN."""
        return self._at("pedestal")

    def next_event(self) -> int:
        """Clock of the next event."""
        vsync = self.timing.vsync(self._next)
        if self._waiting:
            vsync = min(vsync, self.timing.ready(self._waiting[0].number))
        return self._origin + vsync

    def advance(self, clock: int) -> None:
        """Runs all events before `clock`."""
        while self.next_event() < clock:
            self.step()

    def step(self) -> Shot | None:
        """Runs the next event; returns the frame if one was read."""
        clock = self.next_event() - self._origin
        if self._waiting and self.timing.ready(self._waiting[0].number) == clock:
            shot = self._waiting.pop(0)
            self._judge(shot)
            self.last = shot
            return shot
        self._begin()
        return None

    def _at(self, name: str) -> int:
        return self.registers.active(f"ebaps_{name}")

    def _volts(self) -> int:
        return min(self._at("high_voltage"), HIGH_VOLTAGE)

    def _begin(self) -> None:
        """VSYNC falls: the period of the next frame begins."""
        if self._ahead:
            self.registers.set("ebaps_key", 1)
        self.registers.update("frame")
        key = bool(self._at("key"))
        shutter = self._at("shutter")
        closed = shutter == 1 or (shutter >= 2 and key)
        region = self._region if key else DARKS
        if key:
            self._region = (self._region + 1) % DARKS
        exposure = self.rule.clip(self._at("exposure"))
        shot = Shot(self._next, exposure, self._volts(), key, closed, region)
        if self._ahead:
            self._ahead -= 1
            if not self._ahead:
                self.registers.set("ebaps_key", 0)
        self._waiting.append(shot)
        self._next += 1

    def _judge(self, shot: Shot) -> None:
        """The last pixel has been read."""
        got = self.frames(shot)
        rule, loop = self.rule, self._at("loop")
        standing = rule.clip(self._at("exposure"))
        self._told["frames"] += 1
        if shot.key:
            self._darks = [*self._darks, (shot.exposure, shot.volts)][-DARKS:]
            alike = self.has_darks and len(set(self._darks)) == 1
            self.judged = None
            self._told["dark_exposure"] = shot.exposure if alike else 0
            self._tell(settled=False, side=0, standing=standing, rule=rule, key=True)
            return
        total = got.raw if loop & _RAW else got.total
        side = rule.side(total, got.pixels)
        self._told["mean"] = total // got.pixels
        settled = side == 0 and shot.exposure == standing
        # Frames in flight may be dark ones, which must all be of one exposure.
        free = not self._ahead and not any(other.key for other in self._waiting)
        acts = bool(loop & _ON) and free
        self.judged = Judged(rule, standing, shot.exposure, bool(loop & _RAW), acts)
        if acts:
            standing = self.judged.chosen(total, got.pixels)
            self.registers.set("ebaps_exposure", standing)
        resting = settled or standing == shot.exposure
        if self._at("refresh") and resting and self.stale and free:
            self._ahead = DARKS
        self._tell(settled=settled, side=side, standing=standing, rule=rule, key=False)

    def _tell(
        self, *, settled: bool, side: int, standing: int, rule: ExposureRule, key: bool
    ) -> None:
        self._told["status"] = (
            settled
            | (side < 0 and standing == rule.longest) << 1
            | (side > 0 and standing == rule.shortest) << 2
            | self.has_darks << 3
            | (self.has_darks and self.stale) << 4
            | key << 5
        )


def _steady(shot: Shot) -> Read:
    middle = sum(WINDOW) // 2
    total = 0 if shot.closed or not shot.volts else min(middle * shot.exposure // _WANTED, 65_535)
    return Read(total, total, 1)


def bus_target() -> Sequencer:
    """A `BusTarget`."""
    return Sequencer(_steady)
