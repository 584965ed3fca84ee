"""A spike camera that is set up once and called again and again, for Python."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import islice
from numbers import Real
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from cosim import Clock, InputError, seconds_to_ps
from cosim.compute.cores import cores
from cosim.compute.opencl import shared_device
from cosim.compute.stopping import threads
from cosim.errors import quote
from cosim.light.lens import Lens
from cosim.light.source import Source
from cosim.plan.paired import Span, windows
from scenarios.assemble.called import called_camera, in_memory
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.instants import choose_windows
from scenarios.assemble.lens import choose_lens, choose_mosaic
from scenarios.assemble.readout import refuse_leftovers
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.schema.settings import assignments_of
from scenarios.python.calls import Called
from scenarios.python.frames import array_of, check_frame, check_instants, rate_of
from scenarios.python.words import in_python
from scenarios.scenes.clips.film import FilmSource
from scenarios.scenes.clips.fitted import Fit
from scenarios.scenes.clips.pictures import Pictures, array_clip, shown
from sensor.latched.core import Filmed, LatchedCamera, LiveCamera

__all__ = ["Camera", "LiveStream"]

_AHEAD: Final = 2
"""Clips that `film_many` has filmed, or is filming, before they are asked for, for each core."""


class Camera(Called):
    """A latched spike camera in memory: frames in, spikes out. Nothing is written.

    Its bits are those of `viform run film` with the same keys, frames and seed. It may be called
    from several threads at once, and is a context manager.

    Args:
        chip: Name of the chip, such as "spiketwo".
        tolerance: Allowed relative error of the simulation; 0 keeps every effect.
        seed: Seed of the temporal noise of call 0. Other calls have draws of their own, which
            depend on the seed and on their number alone.
        device: Number or part of the name of an OpenCL device, or "numba"; the default if None.
        tier: "fast", "exact" or "reference" for all pixels; None for the fastest that the tolerance
            allows, with a better one where it is needed.
        illuminance: Illuminance of the scene, with its unit; white reflects all of it.
        **keys: Keys of the section [sensor], such as threshold="1000 e", preset="silicon", or
            **{"lens.f_number": 2.8}.

    Raises:
        InputError: A key or value that the camera does not have.
    """

    @in_python
    def __init__(
        self, chip: str = "spiketwo", *, tolerance: float = 1e-3, seed: int = 1,
        device: str | None = None, tier: Literal["fast", "exact", "reference"] | None = None,
        illuminance: str = "700 lux", **keys: Any,
    ) -> None:  # fmt: skip
        own = {"sensor.chip": chip, "scene.illuminance": illuminance}
        given = own | {f"sensor.{key}": value for key, value in keys.items()}
        _, scenario = load("film", assignments_of(given), tolerance=tolerance, seed=seed)
        called = in_memory(scenario)
        if called is None:
            raise InputError(
                "a Camera", "a simulated one with readout = synchronous, without sub_threshold",
                "another one", "use viform.film, which makes a run",
            )  # fmt: skip
        self._set_up(called, device, tier)

    @classmethod
    def of(cls, scenario: Scenario, device: str | None, tier: Any = None) -> Camera:
        """The camera of a scenario of `in_memory`. Raises InputError."""
        camera = cls.__new__(cls)
        camera._set_up(scenario, device, tier)
        return camera

    def _set_up(self, scenario: Scenario, device: str | None, tier: Any) -> None:
        tiers = ("fast", "exact", "reference")
        if tier not in (None, *tiers):
            raise InputError("tier", f"one of {', '.join(tiers)}", quote(tier), "choose one")
        refuse_leftovers(scenario)
        self._scenario, self._made = scenario, (scenario, device, tier)
        self._setting = camera_setting(scenario)
        self._mosaic = choose_mosaic(scenario)
        self._lens(None)  # a lens that cannot be is refused at once
        Called.__init__(self)
        if device is not None or tier is not None:  # what cannot be is refused at once
            _ = self._core

    @cached_property
    def _core(self) -> LatchedCamera:
        """The camera in memory. It is made at the first call: before that, nothing has used OpenCL,
        and the process may be forked."""
        scenario, device, tier = self._made
        return called_camera(scenario, self._setting, shared_device(device), tier)

    def __reduce__(self) -> tuple[Any, ...]:
        """In another process the camera is made anew; its calls are counted from 0."""
        return Camera.of, self._made

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the chip, pixels."""
        return self._setting.chip.height, self._setting.chip.width

    @property
    def clock(self) -> Clock:
        """The clock of the latches."""
        return self._setting.clock

    def __repr__(self) -> str:
        height, width = self.shape
        return (
            f"Camera: {self._scenario.sensor.chip}, {width} x {height} pixels at "
            f"{self.clock.hz / 1e3:g} kHz, tolerance {self._scenario.tolerance:g}{self._state}"
        )

    def _lens(self, white_rate: float | None) -> tuple[Lens, float, list[str]]:
        """The lens for a rate of white, that rate, and notes."""
        scenario = self._scenario
        if white_rate is not None:
            section = scenario.sensor.lens
            if section.f_number is not None:
                raise InputError(
                    "white_rate", "absent for a camera with lens.f_number", f"{white_rate}",
                    "leave one of the two out",
                )  # fmt: skip
            given: Any = white_rate
            if not (isinstance(given, Real) and 0 < float(given) <= 1):
                raise InputError(
                    "white_rate", "above 0 and at most 1 spike a cycle", quote(white_rate),
                    "change it",
                )  # fmt: skip
            lens = section.model_copy(update={"white_rate": float(white_rate)})
            sensor = scenario.sensor.model_copy(update={"lens": lens})
            scenario = scenario.model_copy(update={"sensor": sensor})
        choice = choose_lens(scenario, self._setting)
        return choice.lens, choice.white_rate, choice.notes

    def check_white(self, white_rate: float | None) -> None:
        """Raises InputError for a rate of white that the camera cannot have."""
        self._lens(white_rate)

    def _source(
        self, clip: Pictures, rate: float, cycles: int, gain: np.float32 | None = None
    ) -> Source:
        """The frames as the light of a scene, or behind a lens of this gain."""
        return FilmSource(
            Path("frames"), self.shape, self._scenario.scene.illuminance, self.clock, cycles,
            rate=rate, mosaic=self._mosaic, clip=clip, gain=gain,
        )  # fmt: skip

    def _film(
        self, frames: npt.NDArray[Any], rate: float, cycles: int,
        chosen: tuple[Lens, float, list[str]], number: int,
        instants: Sequence[int] | None = None, spans: Sequence[Span] | None = None,
    ) -> tuple[Filmed, npt.NDArray[np.float32] | None]:  # fmt: skip
        """The spikes of a call, and the truth at cycles, if any are given. chosen: see `_lens`;
        spans: see `LatchedCamera.film`."""
        lens, white, notes = chosen
        clip = array_clip(frames, self.shape, self._mosaic, rate)
        relay = lens.relay(self._setting.chip.pitch)
        seen = self._core.film(
            lambda: self._source(clip, rate, cycles),
            relay,
            cycles,
            number,
            spans,
            None if relay.gain is None else lambda: self._source(clip, rate, cycles, relay.gain),
        )
        seen = replace(seen, notes=(*notes, *seen.notes), white_rate=white)
        if instants is None:
            return seen, None
        source = self._source(clip, rate, cycles)
        return seen, np.stack([source.truth(self.clock.middle(n)) for n in instants])

    def _cycles(self, count: int, rate: float) -> int:
        """Cycles for which frames last. Raises InputError for none."""
        cycles = self.clock.cycles_in(seconds_to_ps(count / rate))
        if cycles < 1:
            raise InputError(
                "frames", f"at least a cycle of {1e6 / self.clock.hz:g} us long",
                f"{count} at {rate:g} frames/s", "give more frames or lower frame_rate",
            )  # fmt: skip
        return cycles

    @in_python
    def film(
        self, frames: npt.ArrayLike | Iterable[npt.ArrayLike], frame_rate: float, *,
        white_rate: float | None = None, call: int | None = None,
    ) -> Filmed:  # fmt: skip
        """Films frames for as long as they last; the light between two frames is linear in time.

        Args:
            frames: (T, H, W) or (T, H, W, 3) uint8 in sRGB, or (T, H, W) float of linear light from
                0 to 1, a share of white; a list or a generator of such frames. They are scaled to
                cover the chip, and cropped at the centre.
            frame_rate: Frames/s.
            white_rate: Spikes a cycle of white, 0 to 1, by which the lens is chosen; that of the
                camera if None.
            call: Number of the call, from 0; the next one if None. Equal seeds, numbers and frames
                give equal bits.

        Returns:
            The spikes, with `error`, the bounds of what was left out for this light, and `notes`.

        Raises:
            InputError: Frames of another shape or type, light below 0 or no number, a rate that is
                none, or a closed camera.
        """
        rate = rate_of(frame_rate)
        given = array_of(frames)
        cycles = self._cycles(len(given), rate)
        chosen = self._lens(white_rate)  # what is refused has no number
        return self._film(given, rate, cycles, chosen, self._number(call))[0]

    def film_scenario(self, frames: npt.NDArray[Any], rate: float) -> Filmed:
        """Films frames for as long as the scenario says, whose image window must fit."""
        cycles = self.clock.cycles_in(seconds_to_ps(self._scenario.duration))
        image = self._scenario.image
        at = choose_windows(self._scenario, cycles)
        spans = windows(at, image.window, cycles, preceding=image.preceding)
        return self._film(frames, rate, cycles, self._lens(None), 0, spans=spans)[0]

    @in_python
    def film_many(
        self, clips: Iterable[npt.ArrayLike], frame_rate: float, *,
        white_rate: float | None = None, instants: Sequence[int] | None = None, first: int = 0,
    ) -> Iterator[tuple[Filmed, npt.NDArray[np.float32]]]:  # fmt: skip
        """Films clips, with a thread for each core, in their order.

        Args:
            clips: frames of each, see `film`; a generator is asked a few clips ahead.
            frame_rate, white_rate: see `film`.
            instants: cycles of the truth; the middle one if None.
            first: number of the first call; clip n has the draws of call first + n. Give another
                one for another epoch.

        Yields:
            The spikes of a clip, and its true light at the instants: (n, H, W) float32, white = 1.
        """
        rate, begin = rate_of(frame_rate), self._number(first)
        self._lens(white_rate)
        if not isinstance(clips, Iterable):
            raise InputError("clips", "frames of several clips", quote(clips), "give a list")
        check_instants(instants)

        @in_python
        def film(number: int, frames: npt.NDArray[Any]) -> Any:
            return self._with_truth(frames, rate, white_rate, instants, number)[:2]

        def own(clip: Any) -> npt.NDArray[Any]:
            """The frames of a clip, which its giver may overwrite before a thread reads them."""
            frames = array_of(clip)
            return frames.copy() if frames is clip else frames

        return _in_order(film, map(own, clips), begin)

    @in_python
    def film_with_truth(
        self, frames: npt.ArrayLike | Iterable[npt.ArrayLike], frame_rate: float, *,
        white_rate: float | None = None, instants: Sequence[int] | None = None,
        call: int | None = None,
    ) -> tuple[Filmed, npt.NDArray[np.float32], tuple[int, ...]]:  # fmt: skip
        """Films frames, see `film`, and gives the true light at instants, see `film_many`: the
        spikes, (n, H, W) float32 with white = 1, and the cycles."""
        check_instants(instants)
        return self._with_truth(array_of(frames), rate_of(frame_rate), white_rate, instants, call)

    def _with_truth(
        self, frames: npt.NDArray[Any], rate: float, white_rate: float | None,
        instants: Sequence[int] | None, call: int | None,
    ) -> tuple[Filmed, npt.NDArray[np.float32], tuple[int, ...]]:  # fmt: skip
        cycles = self._cycles(len(frames), rate)
        at = (cycles // 2,) if instants is None else tuple(map(int, instants))
        if any(not 0 <= n < cycles for n in at):
            raise InputError(
                "instants", f"cycles from 0 to {cycles - 1}", quote(list(at)), "change them"
            )
        chosen = self._lens(white_rate)
        seen, truth = self._film(frames, rate, cycles, chosen, self._number(call), at)
        assert truth is not None
        return seen, truth, at

    @in_python
    def open(
        self, frame_rate: float, *, white_rate: float | None = None, call: int | None = None
    ) -> LiveStream:
        """A live camera: `stream.push(frame)` gives the spikes of the cycles that are complete.

        The plan holds for any light up to white; its bounds, over a second, are `stream.error`. All
        pixels have one tier, so the bound may exceed the tolerance, as with the dead time of the
        preset silicon.

        Args:
            frame_rate, white_rate, call: see `film`.
        """
        rate = rate_of(frame_rate)
        lens, white, notes = self._lens(white_rate)
        number = self._number(call)
        most = self._scenario.scene.illuminance * (self._mosaic.white if self._mosaic else 1.0)
        relay = lens.relay(self._setting.chip.pitch)
        live = self._core.open(most, Clock.from_hz(rate), relay, number)
        fit = Fit(Path("frames"), self.shape, self._mosaic, True, notes)
        return LiveStream(live, fit, np.float32(most), white, notes, self._check_open)


class LiveStream:
    """A live camera of `Camera.open`. Frames are pushed by one thread.

    Attributes:
        error: Bounds of the error of the simulation, over a second of any light up to white.
        notes: What a user must know of the light so far.
    """

    def __init__(
        self, live: LiveCamera, fit: Fit, white: np.float32, white_rate: float, notes: list[str],
        check_open: Callable[[], object],
    ) -> None:  # fmt: skip
        self.error, self.notes, self._check_open = live.error, notes, check_open
        self._live, self._fit, self._white, self._white_rate = live, fit, white, white_rate
        self._like: tuple[Any, ...] | None = None

    @in_python
    def push(self, frame: npt.ArrayLike) -> Filmed | None:
        """Takes the next frame, see `Camera.film`.

        Returns:
            The spikes of the cycles that are complete with it; None after the first frame.

        Raises:
            InputError: A frame of another shape or type than the first, or one that is none, or the
                camera is closed.
        """
        self._check_open()
        values = check_frame(frame)
        like = values.shape, values.dtype
        if self._like not in (None, like):
            raise InputError(
                "a frame", "as the first, {} {}".format(*self._like or ()),
                f"{values.shape} {values.dtype}", "make all frames alike",
            )  # fmt: skip
        self._like = like
        part = self._live.push(shown(values, self._fit) * self._white)
        return None if part is None else replace(part, white_rate=self._white_rate)


def _in_order(film: Any, clips: Iterable[Any], begin: int) -> Iterator[Any]:
    """The results of `film(number, clip)` in the order of the clips, a few of them ahead."""
    count = cores()
    with threads(count) as pool:
        rest = enumerate(clips, begin)
        ahead = islice(rest, _AHEAD * count)
        waiting = [pool.submit(film, number, clip) for number, clip in ahead]
        try:
            while waiting:
                done = waiting.pop(0).result()
                waiting += [pool.submit(film, number, clip) for number, clip in islice(rest, 1)]
                yield done
        finally:
            for each in waiting:
                each.cancel()
