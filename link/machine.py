"""The machine of a link: a file goes from a panel through the air to a camera and its receiver."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Event
from typing import Protocol

from cosim import Clock
from cosim.compute.stopping import threads
from cosim.config.toml import to_toml
from cosim.files import Recorder
from cosim.plan.error import Finding
from cosim.report.png import pictures_wanted
from cosim.run.chain import STREAM, BlockChain
from cosim.run.machine import Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Metric, Throughput, viform_version
from link.evaluation.judge import closed_form, evaluate_link
from link.evaluation.metrics import link_metrics, lock_metrics
from link.evaluation.reception import receive_stream, write_delivery
from link.plan.planned import PlannedLink, check_plan, plan_link
from link.report.page import link_page
from link.sending import Transmission
from link.setup.distances import RateAt, rates_over_distance
from link.setup.setup import FileLinkSetup
from sensor.latched.stages import readout_stages


class PanelLoop(Protocol):
    """A board that shows the panel's planes and sends them back."""

    def send(self, sent: Transmission, progress: Progress) -> None:
        """Sends all planes, in order."""
        ...

    def metrics(self) -> dict[str, Metric]: ...

    @property
    def fault(self) -> str | None:
        """Cause of a failed run; None if all bits came back as they were sent."""
        ...

    def close(self) -> None: ...


@dataclass
class LinkChain(BlockChain):
    """Air, sensor and recorder, after the planes have gone through the board.

    Attributes:
        before: wall time of the stages before the chain, s; its result begins with them.
        sent: what the panel shows.
        loop: board that the planes go through, None without one.
    """

    before: dict[str, float] = field(default_factory=dict)
    sent: Transmission | None = None
    loop: PanelLoop | None = None

    def run(self, progress: Progress) -> dict[str, float]:
        before = dict(self.before)
        if self.loop is not None and self.sent is not None:
            begin = time.perf_counter()
            self.loop.send(self.sent, progress)
            before["loop"] = time.perf_counter() - begin
        return before | super().run(progress)


class _Beside:
    """Progress of a check beside the recording, which has the user's progress.

    Attributes:
        ended: set to end the check.
    """

    def __init__(self) -> None:
        self.ended = Event()

    def start(self, what: str, total: int) -> None: ...

    def advance(self, done: int) -> None:
        if self.ended.is_set():
            raise CancelledError

    def tell(self, what: str) -> None: ...

    def note(self, text: str) -> None: ...


class LinkMachine:
    """The machine of a link; see `Machine`. The check of the plan, on patches, and the pilots at
    other distances run beside the recording and the receiver: each of them leaves cores idle.

    Args:
        name: short name of the scenario.
        setup: the link, checked.
        loop: board that the planes go through, None without one.
    """

    unit = "cycles"

    def __init__(self, name: str, setup: FileLinkSetup, loop: PanelLoop | None = None) -> None:
        self._name, self._setup, self._loop = name, setup, loop
        self._link: PlannedLink = plan_link(setup)
        self._pool, self._beside = ThreadPoolExecutor(1), _Beside()
        self._checked: Future[tuple[PlannedLink, list[Finding]]] | None = None
        self._distances: Future[list[RateAt]] | None = None

    @property
    def toml(self) -> str:
        return to_toml(self._setup.scenario)

    @property
    def notes(self) -> list[str]:
        return self._setup.notes()

    @property
    def device(self) -> str:
        return self._setup.device_name

    @property
    def length(self) -> int:
        return self._setup.cycles

    @property
    def bits(self) -> int:
        return self._setup.pixel_cycles

    def check(self, progress: Progress) -> list[Finding]:
        self._checked = self._pool.submit(check_plan, self._link, self._beside)
        if self._distances is None and pictures_wanted():  # the report alone shows them
            self._distances = self._pool.submit(rates_over_distance, self._setup, self._beside)
        return []

    def keep(self, effects: Sequence[str]) -> LinkMachine:
        self._link = self._link.keep(effects)
        return self

    def chain(self, folder: Path) -> LinkChain:
        setup, chip = self._setup, self._setup.setting.camera.chip
        air = self._link.make_air()
        sensor = self._link.make_camera(air.row_delay)
        clock = Clock.from_hz(setup.scenario.sensor.clock)  # nominal: no reader knows the loop
        recorder = Recorder(folder / STREAM, sensor.shape, setup.cycles, clock, keep=True)
        return LinkChain(
            f"{self._name}: {setup.cycles} cycles of {chip.width} x {chip.height}",
            {
                "air": air, "sensor": sensor,
                **readout_stages(setup.scenario.sensor.duplicated_rows), "recorder": recorder,
            },
            setup.cycles, self._identity(), folder, before=setup.times.wall, sent=setup.sent,
            loop=self._loop,
        )  # fmt: skip

    def _identity(self) -> str:
        """A text that depends on the scenario, the mode, the plan, the file and the version."""
        setup, plan = self._setup, self._link.plan
        text = to_toml(setup.scenario.model_copy(update={"title": ""})) + viform_version()
        text += f"{setup.mode} {plan.tier} {sorted(plan.left_out)}"
        moves = setup.setting.camera.clock_moves
        text += "" if moves is None else hashlib.sha256(moves.ps.tobytes()).hexdigest()
        text += hashlib.sha256(setup.payload.data).hexdigest()
        return hashlib.sha256(text.encode()).hexdigest()

    def shortfall(self, recording: Recording) -> list[Finding]:
        assert self._checked is not None
        self._link, findings = self._checked.result()
        spent = self._setup.times.wall.pop("plan and check")
        recording.seconds["plan and check, beside the recording"] = spent
        return findings

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        setup, plan, seconds = self._setup, self._link.plan, recording.seconds
        stream = recording.chain.stages["recorder"].recorded()
        begin = time.perf_counter()
        with threads(1) as beside:  # neither of the two loads two cores
            closed = beside.submit(closed_form, setup, self._link)
            received, _ = receive_stream(stream, setup.modem, setup.device, progress)
            seconds["receiver"] = time.perf_counter() - begin
        link = evaluate_link(setup, self._link, stream, received, closed.result)
        if self._distances is not None:
            if not self._distances.done():
                progress.start("pilots at other distances", 0)
            link = replace(link, over_distance=self._distances.result())
        outcome = "degraded" if self._link.beyond else "ok"
        fault = None if self._loop is None else self._loop.fault
        faults = [] if fault is None else [fault]
        files = write_delivery(
            recording.folder, setup.payload, link.delivered, link.verdict_document()
        )
        progress.start("report", 2)  # replaces the progress of the receiver
        return Outcome(
            outcome="failed" if faults or not link.delivered else outcome,
            simulated_s=setup.cycles / setup.setting.camera.clock.hz,
            error=link.check.error(plan.promised),
            kept=plan.simulated,
            left_out=link.left_out,
            metrics={
                **link_metrics(link, seconds["air"] + seconds["sensor"]),
                **lock_metrics(setup.lock),
                **({} if self._loop is None else self._loop.metrics()),
            },
            latency=link.latency,
            throughput=self._throughput(recording),
            files=[STREAM, *files],
            notes=[*self._link.beyond, link.verdict_line, *faults],
            verdict=[link.verdict_line, *(faults if link.delivered else [])],
            views=link,
        )

    def _throughput(self, recording: Recording) -> list[Throughput]:
        if recording.resumed:
            return []
        setup, seconds = self._setup, recording.seconds
        written = recording.chain.stages["recorder"].bytes_written * 8
        received = len(setup.payload.data) * 8 / max(seconds["receiver"], 1e-9)
        return [
            Throughput("air", setup.sent.planes / seconds["air"], "planes/s"),
            Throughput("sensor", setup.pixel_cycles / seconds["sensor"], "pixel-cycles/s"),
            Throughput("recorder", written / seconds["recorder"], "bit/s"),
            Throughput("receiver", received, "bit/s"),
        ]

    def page(self, run: Run) -> Page:
        return link_page(run.outcome.views, run)

    def close(self) -> None:
        self._beside.ended.set()
        self._pool.shutdown()
        if self._loop is not None:
            self._loop.close()
