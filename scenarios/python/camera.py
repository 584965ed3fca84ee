"""A spike camera that is set up once and called again and again, for Python."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, overload

import numpy as np
import numpy.typing as npt

from cosim import Clock, InputError
from cosim.config.amounts import at_least
from cosim.errors import quote
from cosim.light.lens import Lens
from cosim.light.source import Source
from cosim.plan.paired import Span, windows
from scenarios.assemble.called import in_memory
from scenarios.assemble.instants import choose_windows
from scenarios.assemble.lens import choose_lens, choose_mosaic
from scenarios.assemble.pixel_kinds import refuse_leftovers
from scenarios.assemble.schema.loading import assignments_of, load
from scenarios.assemble.schema.scenario import Scenario
from scenarios.python.calls import Called, in_order, keys_of
from scenarios.python.errors import in_python
from scenarios.python.frames import array_of, check_instants, check_white_rate, is_whole, rate_of
from scenarios.python.kinds import Frames, PixelKind, kind_of
from scenarios.python.live import LiveStream, S
from scenarios.scenes.clips.film import FilmSource
from scenarios.scenes.clips.fitted import Fit
from scenarios.scenes.clips.pictures import Pictures, array_clip
from scenarios.scenes.kinds.grid import SceneGrid
from sensor.latched.core import Filmed
from sensor.latched.tiers import Tier

if TYPE_CHECKING:
    from sensor.asynchronous.core import FilmedEvents
    from sensor.continuous.core import FilmedIntensities

Chosen = tuple[Lens, float, list[str]]
"""A lens, the rate of white behind it, and notes."""


class Camera(Called, Generic[S]):
    """A spike camera in memory: frames in, spikes out. Nothing is written.

    Its bits are those of `viform run film` with the same keys, frames and seed. It may be called
    from several threads at once, and is a context manager.

    | pixel | gives |
    |---|---|
    | "latched" | `Filmed`, a `Viform`: one bit a pixel and cycle of the clock |
    | "asynchronous" | `FilmedEvents`: row, column, time and width of every spike |
    | "continuous" | `FilmedIntensities`: absolute intensities when they have changed |

    Args:
        chip: Name of the chip, such as "spiketwo".
        pixel: "latched", "asynchronous" or "continuous"; that of the preset, else latched, if
            None.
        tolerance: Allowed relative error of the simulation; 0 keeps every effect.
        draws: "each" for noise whose every draw is that of full physics; "bank" for a bank of
            thresholds where the tolerance allows it, which is faster and has other noise of the
            same law (`error.of` is then "law"). Only latched pixels have a bank.
        seed: Seed of the temporal noise of call 0. Other calls have draws of their own, which
            depend on the seed and on their number alone.
        device: Number or part of the name of an OpenCL device, or "numba"; the default if None.
            Only latched pixels use one.
        tier: "fast", "exact" or "reference" for all latched pixels; None for the fastest that the
            tolerance allows, with a better one where it is needed.
        illuminance: Illuminance of the scene, with its unit; white reflects all of it.
        **keys: Keys of the section [sensor], such as threshold="1000 e", preset="silicon", or
            **{"lens.f_number": 2.8}.

    Raises:
        InputError: A key or value that the camera does not have.
    """

    @overload
    def __init__(
        self: Camera[Filmed], chip: str = ..., *, pixel: Literal["latched"] | None = ...,
        tolerance: float = ..., draws: str = ..., seed: int = ..., device: str | None = ...,
        tier: Tier | None = ..., illuminance: str = ..., **keys: Any,
    ) -> None: ...  # fmt: skip
    @overload
    def __init__(
        self: Camera[FilmedEvents], chip: str = ..., *, pixel: Literal["asynchronous"],
        tolerance: float = ..., seed: int = ..., device: str | None = ..., illuminance: str = ...,
        **keys: Any,
    ) -> None: ...  # fmt: skip
    @overload
    def __init__(
        self: Camera[FilmedIntensities], chip: str = ..., *, pixel: Literal["continuous"],
        tolerance: float = ..., seed: int = ..., device: str | None = ..., illuminance: str = ...,
        **keys: Any,
    ) -> None: ...  # fmt: skip
    @in_python(section="sensor")
    def __init__(
        self, chip: str = "spiketwo", *, pixel: str | None = None, tolerance: float = 1e-3,
        draws: str = "bank", seed: int = 1, device: str | None = None, tier: Tier | None = None,
        illuminance: str = "700 lux", **keys: Any,
    ) -> None:  # fmt: skip
        own = {"sensor.chip": chip, "scene.illuminance": illuminance}
        own |= {} if pixel is None else {"sensor.pixel": pixel}
        given = own | keys_of("sensor", keys)
        _, scenario = load(
            "film", assignments_of(given), tolerance=tolerance, draws=draws, seed=seed
        )
        called = in_memory(scenario)
        if called is None:
            raise InputError(
                "a Camera", "a simulated one without sub_threshold", "another one",
                "use viform.film, which makes a run",
            )  # fmt: skip
        self._set_up(called, device, tier)

    @classmethod
    def of(cls, scenario: Scenario, device: str | None, tier: Any = None) -> Camera[Any]:
        """The camera of a scenario of `in_memory`. Raises InputError."""
        camera: Camera[Any] = cls.__new__(cls)
        camera._set_up(scenario, device, tier)
        return camera

    def _set_up(self, scenario: Scenario, device: str | None, tier: Any) -> None:
        tiers = ("fast", "exact", "reference")
        if tier not in (None, *tiers):
            raise InputError("tier", f"one of {', '.join(tiers)}", quote(tier), "choose one")
        refuse_leftovers(scenario)
        self._scenario, self._made = scenario, (scenario, device, tier)
        self._kind: PixelKind = kind_of(scenario)
        self._setting, self._mosaic = self._kind.setting, choose_mosaic(scenario)
        self._lens(None)  # a lens that cannot be is refused at once
        Called.__init__(self)
        if device is not None or tier is not None:  # what cannot be is refused at once
            _ = self._core

    @cached_property
    def _core(self) -> Any:
        """The camera in memory. It is made at the first call: before that, nothing has used OpenCL,
        and the process may be forked."""
        _, device, tier = self._made
        return self._kind.make(device, tier)

    def __reduce__(self) -> tuple[Any, ...]:
        """In another process the camera is made anew; its calls are counted from 0."""
        self._check_open()
        return Camera.of, self._made

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the chip, pixels."""
        return self._setting.chip.height, self._setting.chip.width

    @property
    def pixel(self) -> str:
        """latched, asynchronous or continuous."""
        return str(self._scenario.sensor.pixel)

    @property
    def clock(self) -> Clock:
        """The clock of the latches, or of the reports; asynchronous pixels have one of their own,
        `sensor.asynchronous.timing`."""
        return self._setting.clock

    def __repr__(self) -> str:
        height, width = self.shape
        return (
            f"Camera: {self._scenario.sensor.chip}, {width} x {height} pixels at "
            f"{self.clock.hz / 1e3:g} kHz, {self.pixel}, "
            f"tolerance {self._scenario.tolerance:g}{self._state}"
        )

    def _lens(self, white_rate: float | None) -> Chosen:
        """The lens for a rate of white, that rate, and notes."""
        scenario = self._scenario
        if white_rate is not None:
            section = scenario.sensor.lens
            if section.f_number is not None:
                raise InputError(
                    "white_rate", "absent for a camera with lens.f_number", f"{white_rate}",
                    "leave one of the two out",
                )  # fmt: skip
            rate = check_white_rate(white_rate)
            lens = section.model_copy(update={"white_rate": rate})
            sensor = scenario.sensor.model_copy(update={"lens": lens})
            scenario = scenario.model_copy(update={"sensor": sensor})
        choice = choose_lens(scenario, self._setting)
        return choice.lens, choice.white_rate, self._kind.notes(choice)

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
        self, frames: npt.NDArray[Any], rate: float, length: int, chosen: Chosen, number: int, *,
        check: bool = False, instants: Sequence[int] | None = None,
        spans: Sequence[Span] | None = None,
    ) -> tuple[S, npt.NDArray[np.float32] | None]:  # fmt: skip
        """What a call gives of frames, see `_seen`, and the truth at cycles, if any are given."""
        clip, cycles = (
            array_clip(frames, self.shape, self._mosaic, rate),
            self._kind.cycles(length),
        )

        def source(gain: np.float32 | None = None) -> Source:
            return self._source(clip, rate, cycles, gain)

        seen = self._seen(source, length, chosen, number, check=check, spans=spans)
        if instants is None:
            return seen, None
        scene = source()
        return seen, np.stack([scene.truth(self.clock.middle(n)) for n in instants])

    def _seen(
        self, frames: Frames, length: int, chosen: Chosen, number: int, *, check: bool = False,
        spans: Sequence[Span] | None = None,
    ) -> S:  # fmt: skip
        """What a call gives of light. chosen: see `_lens`; length and spans: see `PixelKind`."""
        lens, white, notes = chosen
        seen: S = self._kind.film(self._core, frames, lens, length, number, check, spans)
        vars(seen).update(self._kind.stated(lens, white), notes=(*notes, *seen.notes))
        return seen

    def _length(self, count: int, rate: float) -> int:
        """Length for which frames last, see `PixelKind`. Raises InputError for none."""
        length = self._kind.length(count / rate)
        if length < 1:
            raise InputError(
                "frames", f"at least a cycle of {1e6 / self._kind.least.hz:g} us long",
                f"{count} at {rate:g} frames/s", "give more frames or lower frame_rate",
            )  # fmt: skip
        return length

    @in_python(section="sensor")
    def film(
        self, frames: npt.ArrayLike | Iterable[npt.ArrayLike], frame_rate: float, *,
        white_rate: float | None = None, call: int | None = None, check: bool | int = False,
    ) -> S:  # fmt: skip
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
            check: Whether the bounds are checked on patches, as a run does: an effect whose bound
                is exceeded is reinstated, and `error.measured` is the error that was found. A whole
                number n checks the calls whose number is a multiple of it. A continuous camera
                leaves nothing out, and has no check.

        Returns:
            The spikes, with `error`, the bounds of what was left out for this light, and `notes`.

        Raises:
            InputError: Frames of another shape or type, light below 0 or no number, a rate that is
                none, or a closed camera.
        """
        rate, every = rate_of(frame_rate), _every(check)
        given = array_of(frames)
        length = self._length(len(given), rate)
        chosen = self._lens(white_rate)  # what is refused has no number
        number = self._number(call)
        return self._film(given, rate, length, chosen, number, check=every(number))[0]

    def film_scenario(self, frames: npt.NDArray[Any], rate: float) -> S:
        """Films frames for as long as the scenario says, whose image window must fit."""
        length, image, spans = self._own_length(), self._scenario.image, None
        if self.pixel == "latched":
            at = choose_windows(self._scenario, length)
            spans = windows(at, image.window, length, preceding=image.preceding)
        return self._film(frames, rate, length, self._lens(None), 0, spans=spans)[0]

    def film_scene(self) -> S:
        """Films the scene of the scenario for as long as it says. The camera has no latches."""
        length = self._own_length()
        grid = SceneGrid(self.shape, self.clock, self._kind.cycles(length), aligned=False)
        source = self._scenario.scene.source(grid)
        return self._seen(lambda gain: source, length, self._lens(None), 0)

    def _own_length(self) -> int:
        """Length of the scenario, see `PixelKind`. Raises InputError for none."""
        seconds = self._scenario.duration
        length = self._kind.length(seconds)
        if length < 1 and self.pixel != "latched":
            least = at_least(1 / self._kind.least.hz)
            raise InputError("duration", f"at least {least} s", f"{seconds:g} s", "lengthen it")
        return length

    @in_python(section="sensor")
    def film_many(
        self, clips: Iterable[npt.ArrayLike], frame_rate: float, *,
        white_rate: float | None = None, instants: Sequence[int] | None = None, first: int = 0,
        check: bool | int = False,
    ) -> Iterator[tuple[S, npt.NDArray[np.float32]]]:  # fmt: skip
        """Films clips, with a thread for each core, in their order.

        Args:
            clips: frames of each, see `film`; a generator is asked a few clips ahead.
            frame_rate, white_rate, check: see `film`.
            instants: cycles of `clock` of the truth; the middle one if None.
            first: number of the first call; clip n has the draws of call first + n. Give another
                one for another epoch.

        Yields:
            The spikes of a clip, and its true light at the instants: (n, H, W) float32, white = 1.
        """
        rate, begin, every = rate_of(frame_rate), self._number(first, "first"), _every(check)
        self._lens(white_rate)
        if not isinstance(clips, Iterable):
            raise InputError("clips", "frames of several clips", quote(clips), "give a list")
        check_instants(instants)

        @in_python(section="sensor")
        def film(number: int, frames: npt.NDArray[Any]) -> Any:
            return self._with_truth(frames, rate, white_rate, instants, number, every)[:2]

        def own(clip: Any) -> npt.NDArray[Any]:
            """The frames of a clip, which its giver may overwrite before a thread reads them."""
            frames = array_of(clip)
            return frames.copy() if frames is clip else frames

        return in_order(film, map(own, clips), begin)

    @in_python(section="sensor")
    def film_with_truth(
        self, frames: npt.ArrayLike | Iterable[npt.ArrayLike], frame_rate: float, *,
        white_rate: float | None = None, instants: Sequence[int] | None = None,
        call: int | None = None, check: bool | int = False,
    ) -> tuple[S, npt.NDArray[np.float32], tuple[int, ...]]:  # fmt: skip
        """Films frames, see `film`, and gives the true light at instants, see `film_many`: the
        spikes, (n, H, W) float32 with white = 1, and the cycles."""
        check_instants(instants)
        given, rate = array_of(frames), rate_of(frame_rate)
        return self._with_truth(given, rate, white_rate, instants, call, _every(check))

    def _with_truth(
        self, frames: npt.NDArray[Any], rate: float, white_rate: float | None,
        instants: Sequence[int] | None, call: int | None, every: Callable[[int], bool],
    ) -> tuple[S, npt.NDArray[np.float32], tuple[int, ...]]:  # fmt: skip
        length = self._length(len(frames), rate)
        cycles = self._kind.cycles(length)
        at = (cycles // 2,) if instants is None else tuple(map(int, instants))
        if any(not 0 <= n < cycles for n in at):
            raise InputError(
                "instants", f"cycles from 0 to {cycles - 1}", quote(list(at)), "change them"
            )
        chosen = self._lens(white_rate)
        number = self._number(call)
        seen, truth = self._film(
            frames, rate, length, chosen, number, check=every(number), instants=at
        )
        assert truth is not None
        return seen, truth, at

    @in_python(section="sensor")
    def open(
        self, frame_rate: float, *, white_rate: float | None = None, call: int | None = None
    ) -> LiveStream[S]:
        """A live camera: `stream.push(frame)` gives the spikes of the cycles that are complete.

        The plan holds for any light up to white; its bounds, over a second, are `stream.error`. All
        latched pixels have one tier, so the bound may exceed the tolerance, as with the dead time
        of the preset silicon. Asynchronous pixels that share a channel cannot be live.

        Args:
            frame_rate, white_rate, call: see `film`.
        """
        rate = rate_of(frame_rate)
        lens, white, notes = self._lens(white_rate)
        number = self._number(call)
        most = self._scenario.scene.illuminance * (self._mosaic.white if self._mosaic else 1.0)
        live = self._kind.open(self._core, most, Clock.from_hz(rate), lens, number)
        fit = Fit(Path("frames"), self.shape, self._mosaic, True, notes)
        stated = self._kind.stated(lens, white)
        return LiveStream(live, fit, np.float32(most), stated, notes, self._check_open)


def _every(check: Any) -> Callable[[int], bool]:
    """Whether call n is checked. Raises InputError for a `check` that cannot be."""
    if not isinstance(check, bool | np.bool_) and not (is_whole(check) and check > 0):
        raise InputError(
            "check", "True, False or a whole number of calls", quote(check), "change it"
        )
    return lambda number: bool(check) and number % int(check) == 0
