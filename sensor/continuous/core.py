"""A continuous camera that is called: light in, absolute intensities out, in memory.

The camera is set up once. A call plans by the light that it begins with, and states the bound of
what it leaves out; its check films a few tiles with full physics beside it. It writes nothing. A
run does the same around it with a recorder, images and a page, so both give the same bits.

The draws of a call are a function of the seed and of the number of the call alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import chain

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
from sensor.continuous.plan import (
    SHOT,
    IntensityPlan,
    PatchCheck,
    any_light,
    plan_intensities,
    windows_at,
)
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
        error: Bounds of what is left out, and of the noise of the model in law.
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
        names: effects that act, by name.
        tolerance: allowed relative error; 0 keeps every effect.
        most: reports of a call beyond which it ends; some 100 bytes of memory each.
        floor: photocurrent to which errors of darker tiles are relative, electrons/s; that of one
            report threshold unless given.
        window: cycles around an instant over which a check compares reported values.

    Attributes:
        setting, names, tolerance, most, floor, window: the arguments.

    Raises:
        InputError: a clock that has no room in the exact arithmetic of the ticks.
    """

    def __init__(
        self, setting: ContinuousSetting, names: tuple[str, ...], *, tolerance: float = 1e-3,
        most: int = MOST, floor: float | None = None, window: int = 41,
    ) -> None:  # fmt: skip
        self.setting, self.names, self.tolerance, self.most = setting, names, tolerance, most
        self.floor, self.window = setting.floor if floor is None else floor, window
        self._longest = BLOCK if setting.noise else _room(setting.clock)

    def forget(self) -> None:
        """Nothing is kept for later calls but tables that all cameras share."""

    def numbered(self, number: int) -> ContinuousSetting:
        """The setting with the draws of a call."""
        return replace(self.setting, seed=seed_of(self.setting.seed, number))

    def plan(
        self, light: Light, stop: int, number: int = 0, tolerance: float | None = None
    ) -> IntensityPlan:
        """The plan of a call.

        Args:
            light: light on the pixels that it begins with.
            stop: its end, ps.
            number: number of the call.
            tolerance: tolerance in place of that of the camera.
        """
        allowed = self.tolerance if tolerance is None else tolerance
        setting = self.numbered(number)
        return plan_intensities(setting, self.names, self.floor, allowed, light, stop)

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
            check: whether full physics is filmed beside it on a few tiles, as in a run: shot noise
                whose absence changes more than its bound is reinstated.

        Raises:
            InputError: the reports are too many.
        """
        steps = self.steps(source, relay, cycles)
        first = next(steps)
        plan = self.plan(first[0], self.setting.clock.edge(cycles), number)
        reports, checked = self._film(plan, chain([first], steps), check)
        windows = windows_at(even_cycles(cycles), self.window, cycles)
        found = [] if checked is None else checked.measured(reports, windows)
        said: list[str] = []
        if checked is not None and (broken := checked.shortfall(found)):
            said, plan = [one.message for one in broken], plan.keeping([SHOT])
            reports, checked = self._film(plan, self.again(first[0], cycles), check)
            assert checked is not None
            found = checked.measured(reports, windows)
        error = plan.bounds(None if checked is None else checked.worst(found))
        notes = (*source.notes, *said, *source.degraded)
        return FilmedIntensities(
            **vars(reports), error=error, notes=notes, degraded=tuple(source.degraded)
        )

    def again(self, light: Light, cycles: int) -> Iterator[tuple[Light, int, int]]:
        """The steps of light that is known to the end of the run."""
        edge = self.setting.clock.edge
        for tick in range(0, cycles, self._longest):
            yield light, edge(tick), edge(min(tick + self._longest, cycles))

    def _film(
        self, plan: IntensityPlan, steps: Iterable[tuple[Light, int, int]], check: bool
    ) -> tuple[Intensities, PatchCheck | None]:
        """The reports of a plan, and the check that was filmed beside them."""
        pixels, collected = ContinuousCamera(plan.planned), Collected(self.most)
        checked = PatchCheck(plan, plan.tiles()) if check else None
        for light, start, stop in steps:
            if checked is not None:
                checked.step(light, start, stop)
            collected.step(pixels.step(light, start, stop), start, stop)
        return join_intensities(collected.parts), checked

    def open(self, most: float, frames: Clock, relay: Relay, number: int = 0) -> LiveIntensities:
        """A camera whose light comes frame by frame.

        Args:
            most: brightest light of the scene, lux.
            frames: clock of the frames.
            relay: map from the light of the scene to what each pixel receives.
            number: number of the call.
        """
        light = PushedLight(most, frames, relay)
        return LiveIntensities(self, number, light, self._longest)


def even_cycles(cycles: int) -> list[int]:
    """Five evenly spaced cycles of a run, fewer in a shorter one."""
    return sorted({cycles * (2 * i + 1) // 10 for i in range(5)})


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
        error: Bounds of the noise of the model in law, under any light; nothing is left out.
    """

    def __init__(
        self, camera: IntensityCamera, number: int, light: PushedLight, longest: int
    ) -> None:
        setting = camera.numbered(number)
        self.error = any_light(setting, camera.names, camera.floor, camera.tolerance).bounds()
        self._pixels = ContinuousCamera(setting)
        self._light, self._longest = light, longest
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
