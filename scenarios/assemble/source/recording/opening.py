"""Opens the stream of a scenario, recorded or live: size, clock, length, white."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim import Clock, InputError, SpikeStream, seconds_to_ps
from cosim.compute.memory import check_plane
from cosim.config.amounts import count
from cosim.files import ending_of, notes_of, open_stream
from cosim.files.config_yaml import CONFIG, adjacent_config
from cosim.files.dat import DAT_CLOCK, DAT_SIZE, check_dat_size, guess_size, pixels_of
from cosim.files.event_file import ENDING, EventFile, read_events
from cosim.files.plane_order import DAT_ORDER
from cosim.run.inputs import FILE, PIPE, named_path
from cosim.spikes.clocked import ClockedEvents
from cosim.spikes.staged import StreamStage
from cosim.spikes.viform import count_spikes
from scenarios.assemble.schema.scenario import AnyScenario, RecordingScenario
from scenarios.assemble.source.recording.live import LivePlanes
from scenarios.assemble.source.recording.origin import open_origin
from sensor.codec.files import open_any
from sensor.sections.recorded import RecordedSection

FASTEST: Final = 1e6
"""Fastest clock of planes, Hz; events of a faster one must be latched by another clock."""
BRIGHT: Final = 0.99
"""Share of the pixels that do not exceed the rate of white, where nothing says it."""
_WHITES: Final = {
    "stream.zarr": "white_rate", "received.zarr": "white_rate",
    "shown.zarr": "shown_white_rate", "camera.zarr": "camera_white_rate",
}  # fmt: skip
"""Metric with the spike rate of white, by the name of a stream in the folder of a run."""
_CLOCKLESS: Final = (".dat", ".raw")
"""Formats that do not keep the clock."""
_KEYS: Final = "sensor.width and sensor.height"


@dataclass(frozen=True, eq=False)
class Recording:
    """A recorded stream.

    Attributes:
        path: the file, or the folder of a run.
        shape: (height, width).
        clock: clock of the cycles.
        cycles: number of cycles that are used.
        white_rate: spikes a cycle of white.
        notes: what the user must know.
        stream: the stream; None for events that are latched.
        sized_by: what has told the size, in words; by default the format.
    """

    path: Path
    shape: tuple[int, int]
    clock: Clock
    cycles: int
    white_rate: float
    notes: list[str]
    stream: SpikeStream | None
    sized_by: str = ""

    def stage(self) -> StreamStage | ClockedEvents:
        """The stage that reads the stream from its beginning."""
        if self.stream is not None:
            return StreamStage(self.stream, self.clock)
        return ClockedEvents(read_events(self.path), self.clock, self.cycles)


def open_recording(scenario: RecordingScenario) -> Recording:
    """Opens the stream of a scenario. Raises InputError."""
    section = scenario.sensor
    path = Path(named_path("sensor", "source", section.source) or "")
    folder = path
    if (path / "stream.events.npz").exists() and not (path / "stream.zarr").exists():
        path = path / "stream.events.npz"
    if ending_of(path) == ENDING and path.exists() and not path.is_dir():
        return _events(scenario, path, folder)
    size = given_size(section)
    notes: list[str] = []
    if section.order == DAT_ORDER:
        stream, notes = open_any(path, size)
    else:
        stream = open_stream(path, size, section.order)
    clock = stream.clock if section.clock is None else Clock.from_hz(section.clock)
    if clock != stream.clock and ending_of(path) not in _CLOCKLESS:
        raise InputError(
            "sensor.clock", f"that of {path}, {stream.clock.hz:g} Hz", f"{clock.hz:g} Hz",
            "leave it out",
        )  # fmt: skip
    return recorded(scenario, stream, clock, path, folder, [*notes_of(stream), *notes])


def recorded(
    scenario: RecordingScenario, stream: SpikeStream, clock: Clock, path: Path,
    folder: Path | None, notes: Sequence[str] = (),
) -> Recording:  # fmt: skip
    """The recording that a stream is for a scenario. Raises InputError.

    Args:
        scenario: the scenario.
        stream: the stream.
        clock: clock of the stream's cycles.
        path: the file or the folder of a run.
        folder: what the user has named: `path`, or the folder of its run; None for spikes in
            memory.
        notes: what the user must know of the stream.
    """
    cycles = _cycles(scenario.duration, clock, stream.cycles)
    white, told = white_of(scenario.sensor, folder, stream, cycles)
    return Recording(path, stream.shape, clock, cycles, white, [*notes, told], stream)


def _events(scenario: RecordingScenario, path: Path, folder: Path) -> Recording:
    """An event file: planes as they are, or latched by another clock."""
    file, section = EventFile(path), scenario.sensor
    clock = file.clock if section.clock is None else Clock.from_hz(section.clock)
    if clock.hz > FASTEST:
        raise InputError(
            "sensor.clock", f"given, at most {FASTEST:g} Hz, for events timed at "
            f"{file.clock.hz:g} Hz", "absent" if section.clock is None else f"{clock.hz:g} Hz",
            "write --set sensor.clock='40 kHz', which latches them",
        )  # fmt: skip
    if given_size(section) not in (None, file.shape[::-1]):
        raise InputError(
            "sensor.width", f"{file.shape[1]} x {file.shape[0]}, the size of {path}",
            f"{section.width} x {section.height}", "leave both out",
        )  # fmt: skip
    end = file.clock.edge(file.ticks)
    whole = max(clock.cycle_at(end - 1) + 1, 1)
    cycles = _cycles(scenario.duration, clock, whole)

    def rate() -> Any:
        counts = np.zeros(file.shape, np.int64)
        for part in file.parts():
            np.add.at(counts, (part["row"], part["column"]), 1)
        return counts / whole

    white, told = _white(section.white_rate, folder, rate)
    latched = f"its events are latched by a clock of {clock.hz:g} Hz"
    return Recording(path, file.shape, clock, cycles, white, [latched, told], None)


def given_size(section: RecordedSection) -> tuple[int, int] | None:
    """The stored (width, height) that a section gives; None for none. Raises InputError for one of
    them alone."""
    width, height = section.width, section.height
    if (width is None) != (height is None):
        absent, given = ("width", "height") if width is None else ("height", "width")
        raise InputError(f"sensor.{absent}", f"given with sensor.{given}", "absent", "add it")
    return None if width is None or height is None else (width, height)


def _cycles(duration: float | None, clock: Clock, whole: int) -> int:
    """Number of cycles of a run. Raises InputError for a duration that the stream does not have."""
    if duration is None:
        return whole
    cycles = clock.cycles_in(seconds_to_ps(duration))
    if not 1 <= cycles <= whole:
        raise InputError(
            "duration", f"from one cycle to all {whole} cycles of the recording, "
            f"{whole / clock.hz * 1e3:.4g} ms", f"{duration * 1e3:.4g} ms",
            "leave it out for all of them, or write one of these",
        )  # fmt: skip
    return cycles


def white_of(
    section: RecordedSection, folder: Path | None, stream: SpikeStream, cycles: int
) -> tuple[float, str]:
    """The spike rate of white in the first `cycles` cycles of a stream, and a note on its origin.
    folder: the stream, or the folder of its run; None if it is in memory."""
    return _white(section.white_rate, folder, lambda: count_spikes(stream, 0, cycles) / cycles)


def _white(given: float | None, folder: Path | None, rate: Callable[[], Any]) -> tuple[float, str]:
    """The spike rate of white and a note on its origin. rate: counts the spikes a cycle of every
    pixel, (H, W)."""
    if given is not None:
        return given, f"white is {given:.3g} spikes a cycle"
    known = None if folder is None else known_white(folder)
    if known is not None:
        return known, f"white is {known:.3g} spikes a cycle, as in the run of {folder}"
    white = min(float(np.quantile(rate(), BRIGHT, method="higher")), 1.0)
    if white <= 0:
        return 1.0, "white is 1 spike a cycle: nearly every pixel of the recording is dark"
    return white, (
        f"white is {white:.3g} spikes a cycle, which {BRIGHT:.0%} of the pixels do not exceed: "
        "sensor.white_rate sets it"
    )


def known_white(path: Path) -> float | None:
    """Spike rate of white in the result of a run, whose folder or stream this is; None if there is
    none."""
    name = _WHITES.get(path.name)
    folder, metric = (path, "white_rate") if name is None else (path.parent, name)
    try:
        text = (folder / "result.json").read_text(encoding="utf-8")
        value = json.loads(text)["metrics"][metric]["value"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return float(value) if isinstance(value, int | float) and 0 < value <= 1 else None


@dataclass(frozen=True, eq=False)
class LiveInput:
    """A live stream.

    Attributes:
        planes: its planes.
        path: the file or pipe; a name for standard input.
        again: whether the source can be read again.
        sized_by: what has told the size of a plane, in words.
        note: note on the size; "" for none.
    """

    planes: LivePlanes
    path: Path
    again: bool
    sized_by: str
    note: str

    @property
    def assumed(self) -> bool:
        """Whether nothing has told the size."""
        return bool(self.note)

    def doubts(self) -> list[str]:
        """What the number of bytes says of the size of a plane, after the last one."""
        planes, notes = self.planes, []
        if planes.incomplete:
            notes.append(
                f"the last plane is left out, because only {planes.incomplete} of its "
                f"{planes.frame} bytes came: check {_KEYS} if its writer was not stopped within it"
            )
        if not self.assumed or planes.came == planes.cycles:  # then there may be more bytes
            return notes
        bytes_ = planes.came * planes.frame + planes.incomplete
        try:
            size, others = guess_size(self.path, bytes_)
        except InputError as exc:
            return [*notes, f"{exc.actual}: {_KEYS} say which"]
        if size != DAT_SIZE:
            other = f"{size[0]}x{size[1]}"
            notes.append(f"{bytes_} bytes are whole planes of {other}: {_KEYS} say so")
        return [*notes, *(note.replace("--size says", f"{_KEYS} say") for note in others)]


def is_live(section: RecordedSection) -> bool:
    """Whether a stream is live, read while the run goes on: a pipe, or a file that is followed."""
    return section.source.startswith(PIPE) or section.source_timeout is not None


def refuse_pipe(scenario: AnyScenario, command: str) -> None:
    """Raises InputError for a scenario whose stream is a pipe, for commands that read it more
    than once."""
    if isinstance(scenario, RecordingScenario) and scenario.sensor.source.startswith(PIPE):
        raise InputError(
            "sensor.source", f"a file for viform {command}", scenario.sensor.source,
            "write the pipe's bytes into a .dat and name that",
        )  # fmt: skip


def open_live(scenario: RecordingScenario) -> LiveInput:
    """Opens the stream of a scenario. Raises InputError for a source that is missing or of another
    kind, and for planes that are no whole bytes."""
    section = scenario.sensor
    piped = section.source.startswith(PIPE)
    path = Path(section.source.removeprefix(PIPE if piped else FILE))
    size, sized_by, note = _size(section, path, piped)
    order, frame = section.order, check_dat_size(*size)
    order.check(frame)
    check_plane(str(path), pixels_of(size)[::-1])
    clock = DAT_CLOCK if section.clock is None else Clock.from_hz(section.clock)
    cycles = None
    if scenario.duration is not None:
        cycles = clock.cycles_in(seconds_to_ps(scenario.duration))
        if cycles < 1:
            raise InputError(
                "duration", f"one cycle, {1e3 / clock.hz:.4g} ms, or more",
                f"{scenario.duration * 1e3:.4g} ms",
                "leave it out to read to the end, or write a longer one",
            )  # fmt: skip
    origin = open_origin(section.source, section.source_timeout)
    if not piped and ending_of(path) != ".dat":
        origin.close()
        raise InputError(
            "sensor.source_timeout", "given with a .dat, whose planes follow each other",
            f"given with {path}", "leave it out, or name a .dat",
        )  # fmt: skip
    bound = seconds_to_ps(section.source_latency)
    planes = LivePlanes(origin, size, order, clock, cycles, bound)
    return LiveInput(planes, Path(origin.name), not piped, sized_by, note)


def _size(
    section: RecordedSection, path: Path, piped: bool
) -> tuple[tuple[int, int], str, str]:  # fmt: skip
    """The stored size of a plane, what has told it, and a note if nothing has."""
    given = given_size(section)
    if given is not None:
        if given[0] * given[1] % 8:
            raise InputError(
                _KEYS, "a size as stored, with a product that is a multiple of 8",
                f"{given[0]} x {given[1]}", "give the columns with those that fill up a byte",
            )  # fmt: skip
        return given, "scenario", ""
    config = None if piped else adjacent_config(path)
    if config is not None:
        return config.size, f"the {CONFIG}", ""
    width, height = DAT_SIZE
    note = (
        f"planes of {width}x{height} are assumed, as of public recordings, "
        f"{count(check_dat_size(*DAT_SIZE))} bytes each: {_KEYS} say another size"
    )
    return DAT_SIZE, "assumed", note
