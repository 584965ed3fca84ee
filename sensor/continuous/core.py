"""A continuous camera that is called: light in, absolute intensities out, in memory.

The camera is set up once. It has one tier and leaves nothing out, so a call plans nothing. It
writes nothing. A run does the same around it with a recorder, images and a page, so both give the
same bits.

The draws of a call are a function of the seed and of the number of the call alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from cosim.clock import PS, Clock
from cosim.compute.philox import seed_of
from cosim.errors import InputError
from cosim.light.light import Light, Plane
from cosim.light.source import Source
from cosim.light.steps import PushedLight, light_steps
from cosim.plan.error import Bounds
from cosim.spikes.intensities import Intensities, join_intensities
from cosim.stage import BLOCK
from sensor.continuous.camera import ContinuousCamera
from sensor.continuous.setting import ContinuousSetting

MOST = 20_000_000
"""Reports of a call beyond which it ends."""

Relay = Callable[[Light], Light]


@dataclass(frozen=True, eq=False, repr=False)
class RecordedIntensities(Intensities):
    """Reports of a call, or of a run that a call has made.

    Attributes:
        error: Bounds of the error of the simulation; None for a run, whose `Run.error` is known.
        notes: What a user must know of the light and of the pixels.
        degraded: Notes that say what the light lacks, as at the end of a clip.
        white_rate: Spikes a cycle of the scene's white in a latched camera before the same lens;
            None if it is not known.
        white: Photocurrent of the scene's white, electrons a second; None if it is not known.
    """

    error: Bounds | None = None
    notes: tuple[str, ...] = ()
    degraded: tuple[str, ...] = ()
    white_rate: float | None = None
    white: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class FilmedIntensities(RecordedIntensities):
    """Reports of a call of a camera.

    Attributes:
        error: Bounds of what is left out, which is nothing; the pixels have one tier, and its
            arithmetic has no bound.
    """

    error: Bounds = field(kw_only=True)


@dataclass
class Collected:
    """Takes reports step by step; beyond `most` of them it raises InputError."""

    most: int
    parts: list[Intensities] = field(default_factory=list)
    count: int = 0

    def step(self, reports: Intensities, start: int, stop: int) -> None:
        """What was reported from `start` to `stop`, ps."""
        self.parts.append(reports)
        self.count += len(reports)
        if self.count > self.most:
            raise InputError(
                "the reports", f"at most {self.most:,}", "more",
                "shorten duration, simulate fewer pixels, or raise sensor.continuous.contrast, "
                "floor or most_reports",
            )  # fmt: skip


class IntensityCamera:
    """A continuous camera, ready to be called from any thread.

    Args:
        setting: everything that decides the reports but the light; its seed is that of call 0.
        kept: effects that act, by name.
        tolerance: allowed relative error, which decides nothing here.
        most: reports of a call beyond which it ends; some 100 bytes of memory each.

    Attributes:
        setting, most: the arguments.
        error: bounds of what is left out, which is nothing.

    Raises:
        InputError: a clock that has no room in the exact arithmetic of the ticks.
    """

    def __init__(
        self, setting: ContinuousSetting, kept: tuple[str, ...], *, tolerance: float = 1e-3,
        most: int = MOST,
    ) -> None:  # fmt: skip
        self.setting, self.most = setting, most
        self.error = Bounds(bound=0.0, kind="proof", left_out={}, kept=kept, tolerance=tolerance)
        self._longest = BLOCK if setting.noise else _room(setting.clock)

    def forget(self) -> None:
        """Nothing is kept for later calls but tables that all cameras share."""

    def pixels(self, number: int = 0) -> ContinuousCamera:
        """The pixels with the draws of a call."""
        seed = seed_of(self.setting.seed, number)
        return ContinuousCamera(replace(self.setting, seed=seed))

    def steps(self, source: Source, relay: Relay, cycles: int) -> Iterator[tuple[Light, int, int]]:
        """(light on the pixels, start, stop) of consecutive steps, ps: blocks with noise, whose
        reports may be many, else as long as the exact arithmetic of the ticks has room."""
        clock = self.setting.clock
        most = min(cycles, self._longest)
        return light_steps(source, relay, clock, clock.edge(cycles), most)

    def film(
        self, source: Source, relay: Relay, cycles: int, number: int = 0, *, check: bool = False
    ) -> FilmedIntensities:
        """Films a source.

        Args:
            source: the scene, which is consumed.
            relay: map from the source's light to what each pixel receives.
            cycles: length, ticks of the clock, at least one.
            number: number of the call, below 2^64.
            check: check of the simulation; must be False: nothing is left out that could be
                checked.

        Raises:
            InputError: the reports are too many, or a check.
        """
        if check:
            raise InputError(
                "check", "False with pixel = continuous, which leaves nothing out", "True",
                "leave it out",
            )  # fmt: skip
        pixels, collected = self.pixels(number), Collected(self.most)
        for light, start, stop in self.steps(source, relay, cycles):
            collected.step(pixels.step(light, start, stop), start, stop)
        reports = join_intensities(collected.parts)
        notes = (*source.notes, *source.degraded)
        return FilmedIntensities(
            **vars(reports), error=self.error, notes=notes, degraded=tuple(source.degraded)
        )

    def open(self, most: float, frames: Clock, relay: Relay, number: int = 0) -> LiveIntensities:
        """A camera whose light comes frame by frame.

        Args:
            most: brightest light of the scene, lux.
            frames: clock of the frames.
            relay: map from the light of the scene to what each pixel receives.
            number: number of the call.
        """
        light = PushedLight(most, frames, relay)
        return LiveIntensities(self.pixels(number), self.error, light, self._longest)


def _room(clock: Clock) -> int:
    """Ticks for which the exact arithmetic of a clock has room. Raises InputError."""
    room = 2**60 // (PS * clock.den)
    if not room:
        raise InputError(
            "sensor.clock", "a frequency of fewer digits without shot noise",
            f"{clock.num}/{clock.den} Hz", "round it",
        )  # fmt: skip
    return room


class LiveIntensities:
    """A continuous camera whose light comes frame by frame; the light between two frames is linear
    in time.

    Attributes:
        error: Bounds of what is left out, which is nothing.
    """

    def __init__(
        self, pixels: ContinuousCamera, error: Bounds, light: PushedLight, longest: int
    ) -> None:
        self.error, self._pixels, self._light, self._longest = error, pixels, light, longest
        self._tick = 0

    def push(self, plane: Plane) -> FilmedIntensities | None:
        """Takes the next frame.

        Args:
            plane: (H, W) float32, lux of the scene at the instant of the frame.

        Returns:
            The reports of the ticks that are complete with it; their `start` is the number of the
            first tick. None if there is none.

        Raises:
            InputError: light outside 0 to the brightest of the scene.
        """
        end, clock = self._light.push(plane), self._pixels.setting.clock
        first, stop = self._tick, 0 if end is None else clock.cycle_at(end)
        if stop <= first:
            return None
        light, parts = self._light.light(), []
        for tick in range(first, stop, self._longest):
            until = min(tick + self._longest, stop)
            parts.append(self._pixels.step(light, clock.edge(tick), clock.edge(until)))
        self._tick = stop
        self._light.forget(clock.edge(stop))
        return FilmedIntensities(**vars(join_intensities(parts)), error=self.error)
