"""An asynchronous camera that is called: light in, events out, in memory.

The camera is set up once. A call plans, from the light that it begins with, what may be left out,
follows the pixels, and sends what fires over the channel. It writes nothing. A run does the same
around it with a recorder, images and a page, so both give the same bits.

The draws of a call are a function of the seed and of the number of the call alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.compute.philox import seed_of
from cosim.errors import InputError
from cosim.light.light import Light, Plane
from cosim.light.source import Source
from cosim.light.steps import PushedLight, is_steady, light_steps
from cosim.plan.error import Bounds, Measured
from cosim.spikes.events import Events
from sensor.asynchronous.model import EventModel, Firings
from sensor.asynchronous.pixel.array import AsynchronousPixels
from sensor.asynchronous.plan.check import View, check_events
from sensor.asynchronous.plan.effects import summarise
from sensor.asynchronous.plan.plan import EventPlan, PlannedPixels, plan_events
from sensor.asynchronous.readout.channel import Channel, ChannelModel
from sensor.asynchronous.readout.recorder import Output, gather_events
from sensor.latched.setting import CameraSetting

MOST = 20_000_000
"""Events of a call beyond which it ends."""
_ENDLESS = 2**62
"""Events of a live camera, which gives them back after each frame."""

Relay = Callable[[Light], Light]


@dataclass(frozen=True, eq=False, repr=False)
class RecordedEvents(Events):
    """Events of a call, or of a run that a call has made.

    Attributes:
        error: Bounds of the error of the simulation; None for a run, whose `Run.error` is known.
        notes: What a user must know of the light, of the plan and of lost events.
        degraded: Notes that say what the light lacks, as at the end of a clip.
        white_rate: Spikes a cycle of sensor.clock of the scene's white; None if it is not known.
    """

    error: Bounds | None = None
    notes: tuple[str, ...] = ()
    degraded: tuple[str, ...] = ()
    white_rate: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class FilmedEvents(RecordedEvents):
    """Events of a call of a camera.

    Attributes:
        error: Bounds of what is left out; the arithmetic of these pixels has none.
    """

    error: Bounds = field(kw_only=True)


@dataclass(frozen=True)
class Sending:
    """The way out of the events.

    Attributes:
        channel: Output that all pixels share; None lets every event leave as its pixel fires.
        late: Whether an event is stamped as it leaves the channel.
        most: Events of a call beyond which it ends; about 110 bytes of memory each.
    """

    channel: ChannelModel | None = None
    late: bool = False
    most: int = MOST


class EventCamera:
    """An asynchronous camera, ready to be called from any thread.

    Args:
        setting: chip, light and device; its seed is that of call 0.
        model: rules of a pixel.
        sending: way out of the events.
        tolerance: allowed relative error of a rate; 0 keeps every effect.

    Attributes:
        setting, model, sending, tolerance: the arguments.
    """

    def __init__(
        self, setting: CameraSetting, model: EventModel, sending: Sending = Sending(), *,
        tolerance: float = 1e-3,
    ) -> None:  # fmt: skip
        self.setting, self.model, self.sending = setting, model, sending
        self.tolerance = tolerance

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the array."""
        return self.setting.chip.height, self.setting.chip.width

    def forget(self) -> None:
        """Nothing is kept for later calls but tables that all cameras share."""

    def numbered(self, number: int) -> EventCamera:
        """The camera with the draws of a call."""
        seed = seed_of(self.setting.seed, number)
        if seed == self.setting.seed:
            return self
        setting, model = replace(self.setting, seed=seed), replace(self.model, seed=seed)
        return EventCamera(setting, model, self.sending, tolerance=self.tolerance)

    def view(self, light: Light, until: int) -> View:
        """The array under the light that a run begins with. until: ps up to which it is known."""
        setting = self.setting
        return View(
            light, until, self.shape, setting.electrons_per_lux, setting.pattern, setting.seed
        )

    def plan(self, view: View, stop: int, tolerance: float | None = None) -> EventPlan:
        """The plan of a whole run, from the light that it begins with.

        Args:
            view: the array under that light.
            stop: end of the run, ps.
            tolerance: tolerance in place of that of the camera.
        """
        rate = view.light.pieces[0].first.ravel().astype(np.float64) * view.gain
        steady = is_steady(view.light, stop)
        scene = summarise(self.model, view.pattern, rate, self.shape, stop, steady)
        return plan_events(scene, view.pattern, self.tolerance if tolerance is None else tolerance)

    def pixels(self, plan: EventPlan) -> PlannedPixels:
        """The pixels run by a plan."""
        setting = self.setting
        return PlannedPixels(
            plan, setting.pattern, self.shape, setting.electrons_per_lux, most=self.sending.most
        )

    def output(self, stop: int) -> Output:
        """What takes the firings of a run that ends at `stop`, ps."""
        channel = self.sending.channel
        return Output(
            None if channel is None else Channel(channel, self.shape), stop,
            self.shape[0] * self.shape[1], self.sending.late,
        )  # fmt: skip

    def sent(self, output: Output) -> tuple[Events, Firings, npt.NDArray[np.int64]]:
        """The stream of a complete run, what it holds in the order in which that left, and when it
        left, ps."""
        firings, leaves = output.crossed()
        stamps = leaves if output.stamped_late else firings.instant
        return gather_events(firings, stamps, self.model, self.shape, output.stop), firings, leaves

    def film(
        self, source: Source, relay: Relay, stop: int, number: int = 0, *, check: bool = False
    ) -> FilmedEvents:
        """Films a source.

        Args:
            source: the scene, which is consumed.
            relay: map from the source's light to what each pixel receives.
            stop: length, ps, at least a tick.
            number: number of the call, below 2^64.
            check: whether the plan is checked on a few tiles, as a run does: an effect whose bound
                is exceeded is reinstated.

        Raises:
            InputError: the events are too many, or memory is short.
        """
        camera = self.numbered(number)
        steps = light_steps(source, relay, self.setting.clock, stop)
        light, _, until = next(steps)
        view = camera.view(light, until)
        plan, measured, found = camera.plan(view, stop), None, []
        if check:
            checked = check_events(plan, view, self.tolerance)
            plan, found, measured = checked.plan, checked.notes, checked.error
        pixels, output = camera.pixels(plan), camera.output(stop)
        for given, begin, end in chain([(light, 0, until)], steps):
            output.step(pixels.step(given, begin, end), begin, end)
        events, _, _ = camera.sent(output)
        notes = (*source.notes, *found, *source.degraded, *output.losses())
        error_bounds = self._bounds(plan, measured)
        return FilmedEvents(
            **vars(events), error=error_bounds, notes=notes, degraded=tuple(source.degraded)
        )

    def _bounds(self, plan: EventPlan, measured: Measured | None = None) -> Bounds:
        """The bounds of a plan, and what its check has measured."""
        return Bounds(
            bound=float(plan.plan.total.max()),
            kind=plan.plan.kind,
            left_out={row.effect: row.bound for row in plan.absent},
            kept=tuple(plan.acting(channel=self.sending.channel is not None)),
            tolerance=self.tolerance,
            measured=measured,
        )

    def open(self, most: float, frames: Clock, relay: Relay, number: int = 0) -> LiveEvents:
        """A camera whose light comes frame by frame. It leaves nothing out.

        Args:
            most: brightest light of the scene, lux.
            frames: clock of the frames.
            relay: map from the light of the scene to what each pixel receives.
            number: number of the call.

        Raises:
            InputError: the pixels share a channel, which sends later what fires now.
        """
        if self.sending.channel is not None:
            raise InputError("channel", "absent for a live camera", "given", "leave it out")
        camera = self.numbered(number)
        dark = np.zeros(self.shape)
        scene = summarise(self.model, self.setting.pattern, dark.ravel(), self.shape, PS, False)
        bounds = self._bounds(plan_events(scene, self.setting.pattern, 0.0))
        return LiveEvents(camera, bounds, PushedLight(most, frames, relay))


class LiveEvents:
    """An asynchronous camera whose light comes frame by frame; the light between two frames is
    linear in time.

    Attributes:
        error: Bounds of what is left out, which is nothing.
    """

    def __init__(self, camera: EventCamera, error: Bounds, light: PushedLight) -> None:
        self.error, self._light, self._at = error, light, 0
        self._model, self._shape = camera.model, camera.shape
        self._pixels = AsynchronousPixels(
            camera.model, camera.shape, camera.setting.electrons_per_lux, camera.setting.pattern,
            most=_ENDLESS,
        )  # fmt: skip

    def push(self, plane: Plane) -> FilmedEvents | None:
        """Takes the next frame.

        Args:
            plane: (H, W) float32, lux of the scene at the instant of the frame.

        Returns:
            The events of the ticks that are complete with it; their `start` is the number of the
            first tick. None if there is none.

        Raises:
            InputError: light outside 0 to the brightest of the scene, or memory is short.
        """
        end, tick = self._light.push(plane), self._model.tick
        stop = 0 if end is None else end // tick * tick
        if stop <= self._at:
            return None
        begin, self._at = self._at, stop
        fired = self._pixels.step(self._light.light(), begin, stop)
        self._light.forget(stop)
        events = gather_events(fired, fired.instant, self._model, self._shape, stop, begin)
        return FilmedEvents(**vars(events), error=self.error)
