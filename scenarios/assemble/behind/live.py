"""The machine of a live stream: recorded, sent and shown as it arrives, while the run goes on.

The link and the display are laid out for a number of cycles. So they work while the stream arrives
if its length is asked for (`duration`) and, for a rendered display, its white is given. Otherwise,
and if the stream ends before its time, they are laid out for what arrived and play it afterwards.
Either way the result is that of the same stream as a whole file.
"""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from cosim import PS, Block, seconds_to_ps
from cosim.config.amounts import amount, count, number
from cosim.config.quantity import DAY
from cosim.config.toml import to_toml
from cosim.files import Recorder
from cosim.plan.error import Finding
from cosim.report.parts import table
from cosim.run.chain import STREAM
from cosim.run.machine import Chain, Machine, Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Metric, viform_version
from scenarios.assemble.behind.machine import ChainMachine, of_source, with_behind
from scenarios.assemble.instants import check_window, choose_windows
from scenarios.assemble.schema.scenario import RecordingScenario
from scenarios.assemble.source.recording.live import LiveChain
from scenarios.assemble.source.recording.machine import RecordedFeed, RecordingMachine
from scenarios.assemble.source.recording.opening import LiveInput, open_live, white_of
from scenarios.assemble.source.recording.opening import Recording as Stream


class LiveMachine:
    """A live stream, and the link and the display behind it; see `Machine`.

    Args:
        name: short name of the scenario.
        scenario: the scenario.
        given: the stream.
        live: the link and the display, laid out for the cycles asked for; None if they play the
            stream after its end, or if there are none.
        waits: why they do so, in words; "" if they do not.
        device: device for the link and the display.
    """

    unit = "planes"

    def __init__(
        self, name: str, scenario: RecordingScenario, given: LiveInput, live: ChainMachine | None,
        waits: str, device: str | None,
    ) -> None:  # fmt: skip
        self.name, self.scenario, self.input, self.live = name, scenario, given, live
        self._waits, self._device = waits, device
        self._done: Machine | None = None  # what has judged the stream

    @property
    def toml(self) -> str:
        return to_toml(self.scenario)

    @property
    def notes(self) -> list[str]:
        told = [self.input.note] if self.input.note else []
        told += [self._waits] if self._waits else []
        if self.live is None:
            return told
        return [*told, *self.live.notes]

    @property
    def device(self) -> str:
        machine = self._done or self.live
        return RecordingMachine.device if machine is None else machine.device

    @property
    def length(self) -> int:
        planes = self.input.planes
        return planes.came if planes.end else planes.cycles or 0

    @property
    def bits(self) -> int:
        """Upper limit of the recording; 0 for a stream of unknown length."""
        if self.live is not None:
            return self.live.bits
        height, width = self.input.planes.shape
        return (self.input.planes.cycles or 0) * height * width

    def check(self, progress: Progress) -> list[Finding]:
        return [] if self.live is None else self.live.check(progress)

    def keep(self, effects: Sequence[str]) -> LiveMachine:
        if self.live is not None:
            self.live = self.live.keep(effects)
        return self

    def chain(self, folder: Path) -> Chain:
        planes, live = self.input.planes, self.live
        cycles = planes.cycles or planes.clock.cycles_in(seconds_to_ps(DAY))
        # Nothing of it stays in memory: a stream may come for days. Its chunks are read again.
        recorder = Recorder(folder / STREAM, planes.shape, cycles, planes.clock)
        stages: dict[str, Any] = {"file": planes, "recorder": recorder}
        length, lead, plan = cycles, 0, ""
        if live is not None:
            behind = live.behind
            stages, length = behind.join(stages, folder), behind.length
            lead, plan = behind.lead, behind.identity()

        def gate(block: Block, stopping: Any) -> bool:
            stop = min(block.stop - lead, cycles)
            return stop <= 0 or planes.wait(stop, stopping)

        given = to_toml(self.scenario.model_copy(update={"title": ""})) + plan + viform_version()
        return LiveChain(
            self.name, stages, length, hashlib.sha256(given.encode()).hexdigest(), folder,
            gate=gate, planes=planes, recorder=recorder, again=self.input.again,
        )  # fmt: skip

    def shortfall(self, recording: Recording) -> list[Finding]:
        """None: no error is measured."""
        return []

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        planes, recorder = self.input.planes, recording.chain.recorder
        whole = Stream(
            self.input.path, planes.shape, planes.clock, planes.came, 1.0, [], recorder.recorded(),
            self.input.sized_by,
        )  # fmt: skip
        assert whole.stream is not None
        white, told = white_of(self.scenario.sensor, self.input.path, whole.stream, whole.cycles)
        inner = RecordingMachine(
            self.name, self.scenario, replace(whole, white_rate=white, notes=[told]),
            choose_windows(self.scenario, whole.cycles),
        )  # fmt: skip
        if self.live is not None and planes.came == planes.cycles:
            behind = replace(self.live.behind, feed=RecordedFeed(inner, live=True))
            self._done = replace(self.live, inner=inner, behind=behind)
            outcome, notes = self._done.judge(recording, progress), [told]
        else:
            outcome, notes = self._play_after(inner, of_source(recording), progress)
        return replace(
            outcome,
            metrics=outcome.metrics | self._metrics(recording.resumed),
            notes=[*notes, *self._told(), *outcome.notes],
        )

    def _play_after(
        self, inner: RecordingMachine, source: Recording, progress: Progress
    ) -> tuple[Outcome, list[str]]:
        """The outcome of a stream that is sent and shown after its end, and the notes of that."""
        if self.live is not None:  # laid out for more than came
            self.live.close()
        machine = _chained(self.scenario, inner, False, self._device, progress)
        self._done = machine
        notes = list(machine.notes)
        while found := machine.check(progress):
            notes += [finding.message for finding in found]
            machine = self._done = machine.keep([finding.effect for finding in found])
        return machine.judge(source, progress), notes

    def _metrics(self, resumed: bool) -> dict[str, Metric]:
        planes = self.input.planes
        late, worst = planes.lateness.late, planes.lateness.worst
        return {
            "planes_received": Metric(float(planes.came), "planes"),
            "planes_rate": Metric(
                None if resumed else planes.rate,
                "planes/s",
                "the run was resumed: only a part of it was timed",
            ),
            "planes_late": Metric(float(late), "planes"),
            "planes_delay_s": Metric(None if worst is None else worst / PS, "s", "no plane came"),
            "bytes_incomplete": Metric(float(planes.incomplete), "bytes"),
        }

    def _told(self) -> list[str]:
        """What the user must know of the stream after its end."""
        planes = self.input.planes
        ended = f"{count(planes.came)} planes came from {self.input.path}: {planes.end}"
        if planes.cycles is not None and planes.came < planes.cycles:
            ended += f", before the {count(planes.cycles)} that duration asks for"
        notes = [ended, *self.input.doubts()]
        if planes.lateness.late:
            bound = amount(self.scenario.sensor.source_latency, "s")
            notes.append(
                f"{count(planes.lateness.late)} planes were late, their processing began more than "
                f"{bound} after their time: the stream or the run is slower than sensor.clock"
            )
        return notes

    def page(self, run: Run) -> Page:
        assert self._done is not None
        page = self._done.page(replace(run, recording=of_source(run.recording)))
        store = shlex.quote(str(run.folder / STREAM))
        metrics = {name: run.result.metrics[name] for name in self._metrics(False)}

        def text(name: str) -> str:
            metric = metrics[name]
            return amount(metric.value, metric.unit)

        bound = amount(self.scenario.sensor.source_latency, "s")
        rows = [
            ["planes received", count(metrics["planes_received"].value), self.input.planes.end],
            ["mean rate", text("planes_rate"), "from the first plane to the last"],
            ["clock", f"{number(self.input.planes.clock.hz)} Hz",
             "gives plane n the time n cycles after the first plane"],
            ["late planes", count(metrics["planes_late"].value),
             f"processing began later than {bound} after the plane's time (sensor.source_latency)"],
            ["largest delay", text("planes_delay_s"), "from a plane's time to its processing"],
            ["bytes of an incomplete last plane", count(metrics["bytes_incomplete"].value),
             "left out"],
        ]  # fmt: skip
        live = self.live is not None and self.input.planes.came == self.input.planes.cycles
        way = "<p>The link and the display worked while it came.</p>" if live else ""
        section = f"<h2>The stream as it came</h2>{way}" + table(["what", "value", "meaning"], rows)
        return replace(
            page,
            sections=[*page.sections, section],
            commands=[*page.commands, f"viform run playback --set sensor.source=file:{store}"],
        )

    def close(self) -> None:
        for machine in (self._done, self.live):
            if machine is not None:
                machine.close()
        self.input.planes.close()


def assemble_live(
    name: str, scenario: RecordingScenario, device: str | None, progress: Progress
) -> LiveMachine:
    """The machine of a scenario whose stream is live. Raises InputError."""
    check_window(scenario.image)
    given = open_live(scenario)
    missing, live = _missing(scenario), None
    with ExitStack() as stack:
        stack.callback(given.planes.close)
        if given.planes.cycles is not None:
            choose_windows(scenario, given.planes.cycles)  # raises an InputError before the stream
        if not missing:
            laid_out = _chained(scenario, _laid_out(name, scenario, given), True, device, progress)
            stack.callback(laid_out.close)
            live = laid_out if isinstance(laid_out, ChainMachine) else None
        told = f"the first plane of {given.path} is waited for"
        given.planes.first(lambda: progress.note(told))
        stack.pop_all()
    waits = "" if not missing else (
        f"{_behind(scenario)} after the stream has ended, because without {missing} it cannot be "
        "laid out before"
    )  # fmt: skip
    return LiveMachine(name, scenario, given, live, waits, device)


def _chained(
    scenario: RecordingScenario, inner: RecordingMachine, live: bool, device: str | None,
    progress: Progress,
) -> Machine:  # fmt: skip
    """The stream with what stands behind it; alone without anything."""
    if scenario.link is None and scenario.display is None:
        return inner
    return with_behind(scenario, inner, RecordedFeed(inner, live), device, progress)


def _behind(scenario: RecordingScenario) -> str:
    return "the link begins" if scenario.link is not None else "the display begins"


def _missing(scenario: RecordingScenario) -> str:
    """Keys without which the link and the display are not known before the stream has ended; ""
    for none."""
    if scenario.link is None and scenario.display is None:
        return ""
    keys = [] if scenario.duration is not None else ["duration"]
    rendered = scenario.display is not None and scenario.display.sink is None
    if rendered and scenario.sensor.white_rate is None:
        keys.append("sensor.white_rate")
    return " and ".join(keys)


def _laid_out(name: str, scenario: RecordingScenario, given: LiveInput) -> RecordingMachine:
    """The source as the link and the display know it before it has come."""
    planes = given.planes
    stream = Stream(
        given.path, planes.shape, planes.clock, planes.cycles or 0,
        scenario.sensor.white_rate or 1.0, [], None, given.sized_by,
    )  # fmt: skip
    return RecordingMachine(name, scenario, stream, [])
