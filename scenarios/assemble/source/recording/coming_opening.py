"""Opens a stream that comes while the run goes on: its source, size, order and length."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from cosim import Clock, InputError, seconds_to_ps
from cosim.compute.memory import check_plane
from cosim.config.amounts import count
from cosim.files import ending_of
from cosim.files.config_yaml import CONFIG, adjacent_config
from cosim.files.dat import DAT_CLOCK, DAT_SIZE, check_dat_size, pixels_of
from cosim.files.dat_size import guess_size
from cosim.run.inputs import FILE, PIPE
from scenarios.assemble.schema.scenario import AnyScenario, RecordingScenario
from scenarios.assemble.source.recording.coming import ComingPlanes
from scenarios.assemble.source.recording.opening import given_size
from scenarios.assemble.source.recording.origin import open_origin
from sensor.sections.recorded import RecordedSection

_KEYS: Final = "sensor.width and sensor.height"


@dataclass(frozen=True, eq=False)
class Coming:
    """A stream that comes.

    Attributes:
        planes: its planes.
        path: the file or pipe; a name for standard input.
        again: whether the source can be read again.
        sized_by: what has told the size of a plane, in words.
        note: note on the size; "" for none.
    """

    planes: ComingPlanes
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


def comes(section: RecordedSection) -> bool:
    """Whether a stream comes while the run goes on: by a pipe, or as a file that is followed."""
    return section.source.startswith(PIPE) or section.source_timeout is not None


def refuse_pipe(scenario: AnyScenario, command: str) -> None:
    """Raises InputError for a scenario whose stream comes by a pipe, for commands that read it more
    than once."""
    if isinstance(scenario, RecordingScenario) and scenario.sensor.source.startswith(PIPE):
        raise InputError(
            "sensor.source", f"a file for viform {command}", scenario.sensor.source,
            "write the pipe's bytes into a .dat and name that",
        )  # fmt: skip


def open_coming(scenario: RecordingScenario) -> Coming:
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
    planes = ComingPlanes(origin, size, order, clock, cycles, bound)
    return Coming(planes, Path(origin.name), not piped, sized_by, note)


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
