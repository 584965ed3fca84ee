"""A display that is set up once and shows streams again and again, for Python."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.compute.opencl import Device, shared_device
from cosim.errors import quote
from cosim.report.png import encode, for_display
from cosim.run.inputs import FILE
from cosim.spikes.viform import SpikeStream
from cosim.stage import Stage
from display.chain.pursuit import pursuit_without_scene
from display.core import ARITHMETIC, Bounds, CalledDisplay, short_notes
from display.render.kinds import RendererKind
from display.section import OBSERVERS
from scenarios.assemble.called import shown_in_memory
from scenarios.assemble.instants import even_instants
from scenarios.assemble.schema.loading import assignments_of, load
from scenarios.assemble.schema.scenario import RecordingScenario
from scenarios.assemble.source.recording.opening import Recording, open_recording, recorded
from scenarios.python.calls import Called, keys_of
from scenarios.python.errors import in_python
from scenarios.python.frames import check_white_rate, is_whole
from scenarios.python.streams import as_stream
from sensor.latched.core import Recorded
from sensor.sections.recorded import RecordedSection

Eye = Literal["still", "pursuing", "camera"]
EYES: Final[dict[Eye, str]] = dict(zip(("still", "pursuing", "camera"), OBSERVERS, strict=True))
"""Observers by their names in Python; the names of display.observer."""


@dataclass(frozen=True, eq=False, repr=False)
class Seen:
    """What observers see of a stream on a display.

    Attributes:
        images: Images by observer, (n, H, W) float32 of linear light, white = 1: one for each
            instant, in pixels of the panel.
        instants: Cycles of the images, from 0.
        luminance: Luminance of white, cd/m2.
        white_rate: Rate of spikes that is shown as white, spikes a cycle.
        error: Bounds of the error of the simulation.
        notes: What a user must know of the stream and of the images.
    """

    images: dict[str, npt.NDArray[np.float32]]
    instants: tuple[int, ...]
    luminance: float
    white_rate: float
    error: Bounds
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        first = next(iter(self.images.values()))
        return (
            f"Seen: {', '.join(self.images)}, {len(first)} images of {first.shape[2]} x "
            f"{first.shape[1]} pixels, white {self.luminance:g} cd/m2"
        )

    def _repr_png_(self) -> bytes:
        """The image of the first observer at the instant in the middle."""
        first = next(iter(self.images.values()))
        return encode(for_display(first[len(first) // 2]))


class Display(Called):
    """A spike-continuous display in memory: spikes in, images of its observers out. Nothing is
    written.

    Its images have the bits of those that `viform run playback` draws with the same keys. It keeps
    every effect. It may be called from several threads at once, and is a context manager.

    Args:
        drive: Rule by which a pixel converts its spikes to light: "impulse", "hold" or "causal".
        device: Number or part of the name of an OpenCL device; the default if None.
        **keys: Keys of the section [display], such as luminance="500 cd/m²", fit="nearest" or
            observer="camera", and for files those of the section [sensor], such as
            **{"sensor.clock": "40 kHz"}, which latches events.

    Raises:
        InputError: A key or value that the display does not have.
    """

    @in_python(section="display")
    def __init__(self, drive: str = "causal", *, device: str | None = None, **keys: Any) -> None:
        given = {"display.drive": drive} | keys_of("display", keys, "sensor")
        _, scenario = load("playback", assignments_of(given))
        shown = shown_in_memory(scenario)
        if shown is None:
            raise InputError(
                "a Display", "a simulated one, without sink", "a board", "use viform.run"
            )
        self._set_up(shown, device)

    @classmethod
    def of(cls, scenario: RecordingScenario, device: str | None) -> Display:
        """The display of a scenario of `shown_in_memory`. Raises InputError."""
        display = cls.__new__(cls)
        display._set_up(scenario, device)
        return display

    def _set_up(self, scenario: RecordingScenario, device: str | None) -> None:
        assert scenario.display is not None
        self._made = scenario, device
        self._scenario, self._section = scenario, scenario.display
        self._core = CalledDisplay(self._section.renderer, _opened(device, self._section.renderer))
        Called.__init__(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """In another process the display is made anew."""
        self._check_open()
        return Display.of, self._made

    @property
    def drive(self) -> str:
        """Rule by which a pixel converts its spikes to light."""
        return self._section.drive

    @property
    def eyes_of_a_run(self) -> tuple[Eye, ...]:
        """The observers whose images a run draws: both eyes, and that of the key `observer`."""
        names = "eye", "pursuit", self._section.observer
        return tuple(eye for eye, name in EYES.items() if name in names)

    def __repr__(self) -> str:
        return f"Display: {self.drive}, white {self._section.luminance:g} cd/m2{self._state}"

    @in_python(section="display")
    def show(
        self, spikes: SpikeStream | str | os.PathLike[str],
        eye: Eye | Sequence[Eye] | None = None, *, at: Sequence[int] | None = None,
        white_rate: float | None = None,
    ) -> Seen:  # fmt: skip
        """Shows a stream from its first cycle on, before which the panel is dark.

        Args:
            spikes: Spikes in memory, an open stream, or a file of any format.
            eye: "still", "pursuing" (it moves along the rows at the speed of the key `pursuit`),
                "camera" (which exposes for `exposure`), or several of them; that of the key
                `observer` if None.
            at: Cycles of the images, from 0; five, evenly spaced, if None.
            white_rate: Rate that is shown as white, above 0 to 1 spikes a cycle; if None, that of
                the film of a camera and of the run of a file, else the one that 99 % of the pixels
                do not exceed.

        Returns:
            The images of the observers, by name.

        Raises:
            InputError: No stream, one of another size than the panel, an observer or instant that
                does not exist, or a closed display.
        """
        return self.shown(spikes, _eyes(eye, self._section.observer), at, white_rate)

    def shown(
        self, spikes: SpikeStream | str | os.PathLike[str], eyes: Sequence[Eye],
        at: Sequence[int] | None = None, white_rate: float | None = None,
    ) -> Seen:  # fmt: skip
        """What `show` gives; the scenario says the instants and the rate of white if they are
        None."""
        self._check_open()
        found, section = self._recording(spikes, white_rate), self._section
        instants = _instants(at, found.cycles)
        if instants is None:
            instants = even_instants(self._scenario.image, found.cycles)
        panel = section.panel(found.shape, found.clock, 0.0, found.white_rate)
        pursuit = pursuit_without_scene(section.pursuit)
        velocity = section.on_panel(pursuit.velocity, found.shape, panel)
        observers = section.seen_by(
            map(EYES.__getitem__, eyes), found.clock, instants, found.cycles, velocity
        )
        stage: Stage = found.stage()
        if any(not each.lasting for each in getattr(found.stream, "ancillary", ())):
            panel = replace(panel, residues=True)
        if (found.path / "scenario.toml").exists():  # the folder of a run, whose chip may say more
            from scenarios.assemble.source.latched.dim import said_by_run

            said = said_by_run(found.path)
            if said is not None:
                panel = replace(panel, **said.panel)
                stage = said.after(stage, found.shape)
        setting = section.setting(panel, instants, found.cycles, velocity)
        images = self._core.show(
            stage, found.cycles, setting, observers, section.mapping(found.shape, panel)
        )
        notes = [
            *found.notes, *([pursuit.note] if "pursuing" in eyes else []),
            *short_notes(panel.luminance, found.cycles / found.clock.hz),
        ]  # fmt: skip
        return Seen(
            {eye: images[EYES[eye]] for eye in eyes}, tuple(instants), panel.luminance,
            panel.white_rate, Bounds(ARITHMETIC, "estimate"), tuple(notes),
        )  # fmt: skip

    def _recording(self, spikes: Any, white_rate: Any) -> Recording:
        """A stream, or a file, as that of the scenario."""
        scenario = self._scenario
        changes: dict[str, Any] = {}
        if white_rate is None and isinstance(spikes, Recorded) and spikes.white_rate:
            white_rate = min(spikes.white_rate, 1.0)
        if white_rate is not None:
            changes["white_rate"] = check_white_rate(white_rate)
        named = isinstance(spikes, (str, os.PathLike))
        if named:
            changes["source"] = f"{FILE}{os.fspath(spikes)}"
        sensor = scenario.sensor.model_copy(update=changes)
        scenario = scenario.model_copy(update={"sensor": sensor})
        if named:
            return open_recording(scenario)
        stream = as_stream(spikes)
        if min(stream.cycles, *stream.shape) < 1:
            raise InputError(
                "the stream", "a cycle of a pixel or more", f"{stream.cycles} cycles of "
                f"{stream.shape[1]} x {stream.shape[0]}", "give spikes",
            )  # fmt: skip
        known = {"source": sensor.source, "white_rate": sensor.white_rate}
        if sensor != RecordedSection.model_validate(known):
            raise InputError(
                "keys of [sensor]", "white_rate alone for a stream that is open", "others",
                "leave them out, or give the path of the file",
            )  # fmt: skip
        path = getattr(stream, "path", None)
        return recorded(scenario, stream, stream.clock, path or Path("memory"), path)


def _opened(device: str | None, renderer: RendererKind) -> Device | None:
    """The device of a display, which all of a process share; None if OpenCL is not needed."""
    if device is None and renderer in ("gl", "numpy"):
        return None
    try:
        return shared_device(device)
    except InputError:
        if device is not None or renderer == "opencl":
            raise
        return None  # GL may do without


def _eyes(given: Any, observer: str) -> tuple[Eye, ...]:
    """The observers of a call; that of the section if none is given. Raises InputError."""
    if given is None:
        return tuple(eye for eye, name in EYES.items() if name == observer)
    several = (given,) if isinstance(given, str) else given
    eyes = tuple(several) if isinstance(several, Iterable) else ()
    if not eyes or not all(isinstance(eye, str) and eye in EYES for eye in eyes):
        raise InputError(
            "eye", f"one or several of {', '.join(EYES)}", quote(given), "choose of these"
        )
    return eyes


def _instants(at: Any, cycles: int) -> list[int] | None:
    """The cycles of a call; None for none. Raises InputError."""
    if at is None:
        return None
    given = [*at] if isinstance(at, Iterable) else []
    whole = all(is_whole(n) and 0 <= n < cycles for n in given)
    if not given or not whole:
        raise InputError(
            "at", f"cycles from 0 to {cycles - 1}, one or more", quote(at), "change them"
        )
    return [int(n) for n in given]
