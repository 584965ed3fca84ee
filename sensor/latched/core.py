"""A latched camera that is called: light in, words out, in memory.

The camera is set up once. A call surveys its light, plans which effects that light needs for the
tolerance, exposes the chip, and states the bound of the plan; where it is asked to, it checks the
plan on patches. It writes nothing. A run does the same around it with a recorder, and always with
the check, so both give the same bits.

The draws of a call are a function of the seed and of the number of the call alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from threading import Lock
from typing import Any, Final

import numpy as np

from cosim.clock import Clock
from cosim.compute.cores import beside
from cosim.compute.memory import LITTLE, check_memory, keep_freed
from cosim.compute.opencl import Device
from cosim.compute.outputs import Outputs
from cosim.compute.philox import seed_of
from cosim.errors import InputError
from cosim.light.light import Light, Piece, Plane
from cosim.light.source import Source
from cosim.light.steps import PushedLight
from cosim.light.survey import Framed, Survey
from cosim.plan.error import ARITHMETIC, BrokenPromise, Finding, required
from cosim.plan.paired import Span, windows
from cosim.plan.tiles import PatchPlane
from cosim.spikes.viform import WORD, Viform, Words, words_for
from cosim.stage import Block, blocks
from sensor.latched.ancillary import writes_of
from sensor.latched.bounds import LatchedBounds
from sensor.latched.camera import Gathering, SpikeCamera
from sensor.latched.check.plan_check import PlanCheck
from sensor.latched.check.samples import sample_tiles
from sensor.latched.effects.own_draws import Draws
from sensor.latched.planning import CameraPlan, plan_camera
from sensor.latched.setting import CameraSetting
from sensor.latched.stages import DuplicatedRows, SceneBlocks
from sensor.latched.survey import SceneSurvey, summarise, survey_scene
from sensor.latched.tiers import Tier, TierPixels

WINDOW: Final = 41
"""Cycles of the window of an image, by default."""
_TOGETHER: Final = 1024
"""Cycles that are exposed at once, whole words."""
_PLANS: Final = 8
"""Plans that are kept."""
_CHIPS: Final = 4
"""Cameras whose constants are kept, some 50 bytes a pixel each."""

Relay = Callable[[Light], Light]


@dataclass(frozen=True, eq=False, repr=False)
class Recorded(Viform):
    """Spikes of a call, or of a run that a call has made.

    Attributes:
        error: Bounds of the error of the simulation; None for a run, whose `Run.error` is known.
        notes: What a user must know of the light and of the plan.
        degraded: Notes that say what the light lacks, as at the end of a clip.
        white_rate: Spikes a cycle of the scene's white; None if it is not known.
    """

    error: LatchedBounds | None = None
    notes: tuple[str, ...] = ()
    degraded: tuple[str, ...] = ()
    white_rate: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Filmed(Recorded):
    """Spikes of a call of a camera.

    Attributes:
        error: Bounds of the error of the simulation.
    """

    error: LatchedBounds = field(kw_only=True)


class LatchedCamera:
    """A latched camera, ready to be called from any thread.

    Args:
        setting: the camera with every effect; its seed is that of call 0.
        device: OpenCL device, or None for the compiled form on the processor.
        tolerance: allowed relative error of a rate; 0 keeps every effect.
        window: cycles of the window over which rates are taken; a shorter call has its own length.
        floor: spikes a cycle; errors of lower rates are relative to it. None for one spike in the
            window.
        tier: arithmetic of all pixels; None for the fastest that the tolerance allows, with a
            better one in the tiles that need it.
        duplicated_rows: fault of the readout, pairs (source, target).
        draws: "each" for a draw for each spike, "bank" for thresholds from the bank of the fast
            tier where the tolerance allows.
    """

    def __init__(
        self, setting: CameraSetting, device: Device | None, *, tolerance: float = 1e-3,
        window: int = WINDOW, floor: float | None = None, tier: Tier | None = None,
        duplicated_rows: Sequence[tuple[int, int]] = (), draws: Draws = "bank",
    ) -> None:  # fmt: skip
        if tier == "fast" and device is None:
            raise InputError(
                "tier", "exact or reference without an OpenCL device", "fast", "choose one of them"
            )
        keep_freed()
        self.setting, self._device, self._tier = setting, device, tier
        self._tolerance, self._window, self._floor = tolerance, window, floor
        self._draws: Draws = draws
        self._duplicated = DuplicatedRows(duplicated_rows) if duplicated_rows else None
        self._plans: dict[bytes, CameraPlan] = {}
        self._chips: list[tuple[tuple[Any, ...], TierPixels]] = []
        self._outputs = Outputs(np.uint32)
        self._closed = False
        self._lock = Lock()

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the chip."""
        return self.setting.chip.height, self.setting.chip.width

    def forget(self) -> None:
        """Gives back what is kept for later calls, and keeps nothing from now on."""
        with self._lock:
            self._plans, self._chips, self._closed = {}, [], True
            self._outputs = Outputs(np.uint32)

    def _lengths(self, cycles: int) -> tuple[int, float]:
        """Window and floor of a call."""
        window = min(self._window, cycles)
        return window, 1 / window if self._floor is None else self._floor

    def survey(self, source: Source, relay: Relay, cycles: int) -> SceneSurvey:
        """Survey of a source, which it may consume; `relay` is the lens."""
        return survey_scene(self.setting, source, relay, cycles, *self._lengths(cycles))

    def plan(
        self, survey: SceneSurvey, spans: Sequence[Span] = (), reinstated: Sequence[str] = ()
    ) -> CameraPlan:
        """The plan for a survey; equal ones share it.

        Args:
            survey: survey of the scene.
            spans: windows of images, which bounds of a run with register writes depend on.
            reinstated: what a check has reinstated: effects that are kept, and ARITHMETIC for the
                exact tier.
        """
        scene, mixed = survey.scene, self._tier is None
        forced, needed = required(reinstated)
        tier: Tier | None = needed or self._tier
        digest = hashlib.blake2b(repr((spans, reinstated)).encode())
        for part in (*(getattr(scene, each.name) for each in fields(scene)), survey.certain):
            digest.update(np.ascontiguousarray(part).tobytes())
        key = digest.digest()
        with self._lock:
            known = self._plans.get(key)
        if known is None:
            known = plan_camera(
                survey, self.setting, self._tolerance, spans, self._device,
                forced=forced, tier=tier, mixed=mixed, draws=self._draws,
            )  # fmt: skip
            with self._lock:
                if self._closed:
                    return known
                self._plans = dict([*self._plans.items()][1 - _PLANS :]) | {key: known}
        return known

    def _check_room(self, cycles: int) -> None:
        """Raises InputError if memory is too short for the spikes of a call."""
        need = 4 * words_for(cycles) * self.shape[0] * self.shape[1]
        if need <= LITTLE:
            return
        check_memory(f"the spikes of {cycles:,} cycles", need, "film fewer frames at once")

    def _seeded(self, plan: CameraPlan, seed: int) -> CameraPlan:
        """The plan of a camera with the noise of a seed."""
        if seed == self.setting.seed:
            return plan
        return replace(
            plan, setting=replace(plan.setting, seed=seed), full=replace(plan.full, seed=seed)
        )

    def _exposed(self, plan: CameraPlan, gathering: Gathering | None = None) -> SpikeCamera:
        """The planned camera. gathering: see `SpikeCamera`."""
        # Cameras that differ in their seed alone share what does not depend on it.
        flags = b"" if plan.flags is None else plan.flags.tobytes()
        key = replace(plan.setting, seed=0), plan.tier, flags, plan.fine.all()
        with self._lock:
            like = next((chip for known, chip in self._chips if known == key), None)
        camera = plan.camera(self._device, like, gathering)
        made = camera.constants if like is None else None
        if made is not None:
            with self._lock:
                if not self._closed:
                    self._chips = [*self._chips[1 - _CHIPS :], (key, made)]
        return camera

    def film(
        self, source: Callable[[], Source], relay: Relay, cycles: int, number: int = 0,
        spans: Sequence[Span] | None = None, behind: Callable[[], Source] | None = None,
        *, check: bool = False,
    ) -> Filmed:  # fmt: skip
        """Films a source.

        Args:
            source: gives the source anew; it is asked for the survey, and for the light as often
                as that is filmed.
            relay: the lens.
            cycles: length, cycles of the latch clock.
            number: number of the call, below 2^64.
            spans: windows of images; None for those of five instants, evenly spaced.
            behind: gives the source as it is behind the lens, for the light; None for one whose
                light the lens maps.
            check: whether the plan is checked on patches, as a run does: an effect whose bound is
                exceeded is reinstated, and the light is filmed again.

        Returns:
            The spikes of all cycles.

        Raises:
            InputError: a register is written after the end, or memory is short.
        """
        self._check_room(cycles)
        late = [write.cycle for write in self.setting.writes if write.cycle >= cycles]
        if late:
            raise InputError(
                "writes", f"at cycles below {cycles}, the end of the light", f"at {late[0]}",
                "film longer or drop it",
            )  # fmt: skip

        def lit() -> SceneBlocks:
            given, lens = (source, relay) if behind is None else (behind, None)
            return SceneBlocks(given(), lens, self.setting.reach, list(blocks(cycles, _TOGETHER)))

        scene, surveyed = lit(), source()
        if isinstance(surveyed, Framed) and surveyed.frames(cycles) is not None:
            scene.begin()  # the survey takes frames, and no light
        survey = self.survey(surveyed, relay, cycles)
        if spans is None:
            at = sorted({cycles * (2 * n + 1) // 10 for n in range(5)})
            spans = windows(at, survey.scene.window, cycles)
        seed, found = seed_of(self.setting.seed, number), list[Finding]()
        while True:
            plan = self.plan(survey, tuple(spans), [finding.effect for finding in found])
            checking = self._check(self._seeded(plan, seed)) if check else None
            try:
                words = self._words(self._seeded(plan, seed), scene, checking)
                new = [] if checking is None else checking.shortfall(plan.tier)
            except BrokenPromise as exc:
                new = exc.findings
            if self._tier is not None:  # all pixels have the tier that was asked for
                new = [finding for finding in new if finding.effect != ARITHMETIC]
            if not new:
                break
            found += new
            scene = lit()
        if self._duplicated is not None:
            self._duplicated.duplicate(words)
        measured = None if checking is None else checking.error()
        law = None if checking is None else checking.law()
        beyond = () if checking is None else checking.beyond()
        put_back = [finding.message for finding in found]
        light = scene.source
        notes = (*plan.notes, *light.notes, *put_back, *light.degraded, *beyond)
        bounds = LatchedBounds.of_plan(plan, measured, law)
        setting = self.setting
        said = writes_of(setting.phases, setting.threshold, setting.chip.height)
        return Filmed(
            words, cycles, self.setting.clock, error=bounds, notes=notes,
            degraded=tuple(light.degraded), ancillary=said,
        )  # fmt: skip

    def _check(self, plan: CameraPlan) -> PlanCheck:
        """The stage that checks a plan, on the patches and samples of a run with its seed."""
        seed = plan.full.seed
        tiles = plan.patches(seed)
        samples = sample_tiles(plan, tiles, self._device, seed)
        patches = PatchPlane(plan.survey.grid, sorted(tiles))
        return PlanCheck(plan, plan.full, patches, self._device, samples)

    def _words(self, plan: CameraPlan, scene: SceneBlocks, checking: PlanCheck | None) -> Words:
        """The spikes of all cycles."""
        gathering = None if plan.fine.all() else Gathering(plan.setting, plan.tier)
        made = beside(lambda: self._exposed(plan, gathering))
        first = None
        try:
            given = scene(scene.parts[0])
            if gathering is not None:
                first = given, gathering(given, scene.parts[0])
        finally:
            camera = made()
        words = self._outputs.take((words_for(scene.parts[-1].stop), *self.shape))
        camera.into(words)
        seen = None if checking is None else checking.step
        filmed = camera.each(scene.parts, scene, seen, first)
        for block, part in zip(scene.parts, filmed, strict=True):
            here = words[block.start // WORD :][: len(part.words)]
            if not np.may_share_memory(part.words, here):
                here[:] = part.words
        return words

    def open(self, most: float, frames: Clock, relay: Relay, number: int = 0) -> LiveCamera:
        """A camera whose light comes frame by frame. All pixels have one tier: the bound of the
        plan may exceed the tolerance.

        Args:
            most: brightest light of the scene, lux; the plan holds from darkness up to it.
            frames: clock of the frames.
            relay: the lens.
            number: number of the call.

        Raises:
            InputError: registers are written, whose cycles belong to a light of known length.
        """
        if self.setting.writes:
            raise InputError("writes", "none for a live camera", "given", "leave them out")
        # How long it will be used is not known; over a second, phases have drifted as far as they
        # will in a rate of a window.
        clock = self.setting.clock
        cycles = max(round(clock.hz), self._window)
        dark, bright = (np.full(self.shape, lux, np.float32) for lux in (0.0, most))
        ends = relay(Light((Piece(0, 1, dark, bright),))).pieces[0]
        certain = np.ones(self.shape, bool)
        often = frames.hz / clock.hz
        slope = ends.last * np.float32(min(often, 1.0))  # from darkness to white in a frame
        seen = Survey(ends.first, ends.last, certain, often, slope, slope * np.float32(cycles))
        survey = summarise(self.setting, seen, cycles, *self._lengths(cycles))
        slow = self._device is None or self._tolerance == 0
        tier: Tier = self._tier or ("exact" if slow else "fast")
        plan = plan_camera(
            survey, self.setting, self._tolerance, (), self._device, tier=tier, mixed=False,
            draws=self._draws,
        )  # fmt: skip
        camera = self._exposed(self._seeded(plan, seed_of(self.setting.seed, number)))
        return LiveCamera(self.setting, camera, LatchedBounds.of_plan(plan), most, frames, relay,
                          self._duplicated, self._check_room)  # fmt: skip


class LiveCamera:
    """A camera whose light comes frame by frame; the light between two frames is linear in time.

    Attributes:
        error: Bounds of the error, over a second of any light up to the brightest.
    """

    def __init__(
        self, setting: CameraSetting, camera: SpikeCamera, error: LatchedBounds, most: float,
        frames: Clock, relay: Relay, readout: DuplicatedRows | None,
        check_room: Callable[[int], None],
    ) -> None:  # fmt: skip
        self.error, self._check_room = error, check_room
        self._setting, self._camera, self._readout = setting, camera, readout
        self._light, self._cycle = PushedLight(most, frames, relay), 0

    def push(self, plane: Plane) -> Filmed | None:
        """Takes the next frame.

        Args:
            plane: (H, W) float32, lux of the scene at the instant of the frame.

        Returns:
            The spikes of the cycles that are complete with it, in whole cycles; their `start` is
            the number of the first. None if there is none.

        Raises:
            InputError: light beyond the range that the plan holds for, or memory is short.
        """
        end = self._light.push(plane)
        clock, (back, ahead) = self._setting.clock, self._setting.reach
        stop = 0 if end is None else clock.cycle_at(end) - ahead
        if stop <= self._cycle:
            return None
        block = Block(self._cycle, stop - self._cycle)
        self._check_room(block.cycles)
        part = self._camera.step(self._light.light(), block)
        if self._readout is not None:
            part = self._readout.step(part, block)
        self._cycle = stop
        self._light.forget(clock.edge(max(stop - back, 0)))
        return Filmed(np.array(part.words), part.cycles, clock, part.start, error=self.error)
