"""The machine of a latched spike camera."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cosim.compute.stopping import threads
from cosim.config.toml import to_toml
from cosim.files import Recorder, ZarrStream
from cosim.light.source import Source
from cosim.plan.error import Finding
from cosim.run.chain import STREAM, BlockChain
from cosim.run.inputs import digest
from cosim.run.machine import Options, Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Error, Latency, Metric, Throughput, viform_version
from cosim.run.workers import workers_for
from cosim.spikes.viform import Viform
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.latched.bands import BandChain, BandedCamera, Bands
from scenarios.assemble.source.latched.boards import NO_ERROR, BoardCamera, Boards, open_boards
from scenarios.assemble.source.latched.dim import dim_light, dim_metrics
from scenarios.assemble.source.latched.judged import LatchedRun
from scenarios.assemble.source.latched.memory import check_run_memory, memory_note
from scenarios.assemble.source.latched.pages.chip import plan_page
from scenarios.assemble.source.latched.pages.stream import stream_page
from scenarios.assemble.source.latched.plan import CameraCheck, RunPlan
from scenarios.assemble.source.latched.planned import PlannedCamera, planned_camera
from scenarios.assemble.source.latched.setup import CameraSetup, set_up_camera
from sensor.codec.size import Sizes, measure_sizes, sample_places, size_metrics
from sensor.latched.stages import readout_stages
from sensor.reconstruct.fidelity import judge
from sensor.reconstruct.shots import (
    LATCHED,
    Shot,
    colour_differences,
    interval_latency,
    take_shots,
    write_colour,
    write_images,
)


@dataclass(frozen=True, eq=False)
class _Images:
    """Images and figures that are computed from a complete stream.

    Attributes:
        stream: the recorded stream.
        shots: images at the instants; empty before a display, whose observers have the images.
        sizes: sizes of the stream in several codes, None before a display.
        metrics: measured figures by name.
        latency: latencies in the simulated machine.
        files: names of the written files.
    """

    stream: ZarrStream
    shots: list[Shot]
    sizes: Sizes | None
    metrics: dict[str, Metric]
    latency: list[Latency]
    files: list[str]


@dataclass(frozen=True, eq=False)
class LatchedMachine:
    """A latched spike camera that is planned and ready to run.

    Attributes:
        name: short name of the scenario.
        scenario: scenario of the user, with its boards.
        setup: the camera and its scene.
        source: the scene for the recording.
        plan: effects that are kept, tile by tile.
        camera: the simulated camera, or a board or bands that workers simulate in its place.
        plan_check: stage that checks the plan during the recording; None if a board generates the
            spikes.
        advice: notes for the user before the run, without those of the scene.
        boards: open board of the run.
        opened: stack that closes the board.
        bands: who simulates the chip in bands of rows; None for nobody.
    """

    name: str
    scenario: Scenario
    setup: CameraSetup
    source: Source
    plan: RunPlan
    camera: PlannedCamera
    plan_check: CameraCheck | None
    advice: list[str]
    boards: Boards
    opened: ExitStack
    bands: Bands | None = None

    @property
    def toml(self) -> str:
        return to_toml(self.scenario)

    @property
    def notes(self) -> list[str]:
        return [*self.advice, *self.source.notes]

    @property
    def device(self) -> str:
        return self.setup.device_name

    @property
    def shown(self) -> bool:
        """Whether a display that the plan simulates shows the stream."""
        return self.plan.display is not None

    @property
    def length(self) -> int:
        return self.setup.cycles

    @property
    def unit(self) -> str:
        return "cycles"

    @property
    def pixels(self) -> int:
        return self.camera.shape[0] * self.camera.shape[1]

    @property
    def bits(self) -> int:
        copies = 2 if isinstance(self.camera, BandedCamera) else 1
        return copies * self.setup.cycles * self.pixels

    def check(self, progress: Progress) -> list[Finding]:
        """No finding: the plan is checked during the recording."""
        return []

    def keep(self, effects: Sequence[str]) -> LatchedMachine:
        plan = self.setup.plan_keeping(self.scenario.tolerance, effects)
        camera, check = planned_camera(plan, self.setup, self.boards, self.bands)
        return replace(self, plan=plan, camera=camera, plan_check=check, source=self.setup.source())

    def chain(self, folder: Path) -> BlockChain:
        setup, (height, width), cycles = self.setup, self.camera.shape, self.setup.cycles
        recorder = Recorder(
            folder / STREAM, self.camera.shape, cycles, setup.setting.clock, keep=not self.shown,
            watch=None if self.shown else sample_places(self.camera.shape, cycles),
        )  # fmt: skip
        stages: dict[str, Any] = {
            **setup.stages(self.source),
            **({} if self.plan_check is None else {"check": self.plan_check}),
            "sensor": self.camera,
            **readout_stages(self.scenario.sensor.duplicated_rows),
            "recorder": recorder,
        }
        kind, identity = BlockChain, self.identity()
        if isinstance(self.camera, BandedCamera):
            self.camera.place(folder, identity)
            kind, identity = BandChain, f"{identity} in bands"
        title = f"{self.name}: {cycles} cycles of {width} x {height}"
        return kind(title, stages, cycles, identity, folder)

    def identity(self) -> str:
        """A digest of the scenario, its plan, the version of the program, and the content of the
        clip."""
        text = to_toml(self.scenario.model_copy(update={"title": ""})) + viform_version()
        text += self.plan.tier
        for better in (self.plan.fine, self.plan.exact):
            text += hashlib.sha256(better.tobytes()).hexdigest()
        for name, tiles in self.plan.plan.kept.items():
            text += name + hashlib.sha256(tiles.tobytes()).hexdigest()
        path = getattr(self.scenario.scene, "path", None)
        text += (digest(path) or "") if path is not None else ""
        return hashlib.sha256(text.encode()).hexdigest()

    def shortfall(self, recording: Recording) -> list[Finding]:
        return [] if self.plan_check is None else self.plan_check.shortfall(self.plan.tier)

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        setup, seconds, check = self.setup, recording.seconds, self.plan_check
        images = self._images(recording)
        throughput = self.throughput(recording)
        beyond = [] if check is None else check.beyond()
        board = self.camera if isinstance(self.camera, BoardCamera) else None
        faults = [] if board is None else board.faults()
        outcome = "degraded" if self.source.degraded or beyond else "ok"
        full = None if check is None else check.full_physics_s(self.pixels, setup.cycles)
        return Outcome(
            outcome="failed" if faults else outcome,
            simulated_s=setup.cycles / setup.setting.clock.hz,
            error=Error(None, NO_ERROR, None) if check is None else check.result_error(),
            kept=[] if check is None else list(self.plan.plan.everywhere),
            left_out=[] if check is None else check.left_out(),
            metrics={
                **images.metrics,
                "white_rate": Metric(setup.white_rate, "spikes/cycle"),
                "f_number": Metric(setup.lens.f_number, "1"),
                "camera": Metric(
                    seconds["sensor"] if throughput else None,
                    "s",
                    "the run was resumed: only a part of it was timed",
                ),
                "full_physics": Metric(
                    full,
                    "s",
                    "full physics was not timed: a board makes the spikes, or every tile has it",
                ),
                **({} if images.sizes is None else size_metrics(images.sizes)),
                **({} if board is None else board.metrics()),
                **getattr(self.source, "metrics", {}),
            },
            latency=images.latency,
            throughput=throughput,
            files=[STREAM, *images.files],
            notes=[*self.source.degraded, *beyond, *faults],
            views=images,
        )

    def throughput(self, recording: Recording) -> list[Throughput]:
        """Speeds of the stages; unknown for a resumed run."""
        if recording.resumed:
            return []
        seconds, cycles = recording.seconds, self.setup.cycles
        bits = recording.chain.stages["recorder"].bytes_written * 8 / seconds["recorder"]
        return [
            Throughput("sensor", cycles * self.pixels / seconds["sensor"], "pixel-cycles/s"),
            Throughput("recorder", bits, "bit/s"),
        ]

    def _images(self, recording: Recording) -> _Images:
        """Images and size of the stream, unless a display shows it."""
        begin, setup, seconds = time.perf_counter(), self.setup, recording.seconds
        recorder = recording.chain.stages["recorder"]
        rate = Metric(recorder.spikes / (setup.cycles * self.pixels), "spikes/cycle")
        if self.shown:
            stream = ZarrStream(recording.folder / STREAM)
            return _Images(stream, [], None, {"spike_rate": rate}, [], [])
        stream = recorder.recorded()
        image = self.scenario.image
        threshold, noise = setup.setting.threshold, setup.setting.threshold_noise
        with threads(1) as beside:  # neither of the two loads two cores
            part = Viform(recorder.watched, stream.cycles, stream.clock)
            measured = beside.submit(measure_sizes, part, self.pixels, threshold, noise)
            dim, names = dim_light(
                self.scenario.sensor, setup.setting, self.camera, recording.folder
            )
            shots = take_shots(
                stream, self.source, setup.instants, image.window, setup.white_rate, dim,
                preceding=image.preceding, registers=setup.setting.registers,
            )  # fmt: skip
            files = names + write_images(recording.folder, shots, LATCHED)
            seen = [shot.read for shot in shots if shot.rows[0] < shot.rows[1]]
            metrics = judge(seen, LATCHED) | dim_metrics(self.scenario.sensor, setup.setting, shots)
            if setup.mosaic is not None:
                files += write_colour(recording.folder, shots, setup.mosaic)
                metrics |= colour_differences(shots, setup.mosaic)
            sizes = measured.result()
        metrics["spike_rate"] = rate
        seconds["images"] = time.perf_counter() - begin
        latency = interval_latency(stream.clock, shots)
        return _Images(stream, shots, sizes, metrics, latency, files)

    def judged(self, run: Run) -> LatchedRun:
        """The data of the run for its pages."""
        images, setup = run.outcome.views, self.setup
        return LatchedRun(
            run, self.scenario, setup.setting, setup.lens, setup.white_rate, setup.instants,
            self.source, self.plan, images.stream, images.shots, images.sizes, setup.mosaic,
            None if self.plan_check is None else self.plan_check.bank(),
        )  # fmt: skip

    def page(self, run: Run) -> Page:
        judged = self.judged(run)
        return plan_page(judged) if self.shown else stream_page(judged)

    def close(self) -> None:
        self.opened.close()


def assemble_latched(name: str, scenario: Scenario, options: Options) -> LatchedMachine:
    """The machine of a scenario with a latched camera. Raises InputError."""
    bands = None
    if options.workers is not None or options.scheduler is not None:
        with workers_for(1, options.scheduler):
            pass  # a scheduler that does not answer is refused before anything is written
        bands = Bands(options.workers or 1, options.scheduler, options.device)
    with ExitStack() as stack:
        boards = stack.enter_context(open_boards(scenario, options.resume))
        setup = set_up_camera(boards.simulated, options.device, boards.size)
        check_run_memory(setup)  # before the survey, which needs a part of it
        source = setup.source()
        plan = setup.plan(scenario.tolerance)
        planes = plan.survey.light.planes
        check_run_memory(setup, planes)
        notes = [*setup.choice.notes, *plan.notes, memory_note(setup, planes)]
        camera, check = planned_camera(plan, setup, boards, bands)
        if isinstance(camera, BoardCamera):
            notes.append(camera.note)
        return LatchedMachine(
            name, scenario, setup, source, plan, camera, check, notes, boards, stack.pop_all(),
            bands,
        )  # fmt: skip
