"""The machine of a latched spike camera, and of the display that its stream drives."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from cosim.compute.stopping import threads
from cosim.config.toml import to_toml
from cosim.files import Recorder, ZarrStream
from cosim.light.source import Source
from cosim.run.chain import STREAM, BlockChain
from cosim.run.inputs import digest
from cosim.run.machine import Finding, Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Error, Latency, Metric, Throughput, viform_version
from cosim.spikes.viform import Viform
from display.chain.display import DisplayChain, make_display_chain
from display.chain.outcome import DisplayOutcome, chain_fidelity, write_observer_images
from display.probes.setup import ProbeCamera
from scenarios.assemble.camera.bands import BandChain, BandedCamera, Bands
from scenarios.assemble.camera.boards import NO_ERROR, Boards, open_boards
from scenarios.assemble.camera.dim import dim_light, dim_metrics
from scenarios.assemble.camera.judged import LatchedRun
from scenarios.assemble.camera.memory import check_run_memory, memory_note
from scenarios.assemble.camera.pages.display import display_page
from scenarios.assemble.camera.pages.stream import stream_page
from scenarios.assemble.camera.planned import PlannedCamera, planned_camera
from scenarios.assemble.camera.planning import RunPlan
from scenarios.assemble.camera.probe_camera import SpikeProbeCamera
from scenarios.assemble.camera.setup import CameraSetup, set_up_camera
from scenarios.assemble.camera.verifier import Verifier
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.show.filmer import Filmer
from scenarios.assemble.show.filming import make_camera
from scenarios.assemble.show.tables import display_lines
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
        shots: images at the instants; empty with a display.
        sizes: sizes of the stream in several codes, None with a display.
        display: outcome of the display, None without one.
        metrics: measured figures by name.
        latency: latencies in the simulated machine.
        files: names of the written files.
    """

    stream: ZarrStream
    shots: list[Shot]
    sizes: Sizes | None
    display: DisplayOutcome | None
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
        verifier: stage that checks the plan during the recording; None if a board generates the
            spikes.
        display: the display, None without one.
        filmer: the camera that films the display, None without one.
        advice: notes for the user before the run, without those of the scene.
        boards: open boards of the run.
        opened: stack that closes the boards and the display.
        bands: who simulates the chip in bands of rows; None for nobody.
    """

    name: str
    scenario: Scenario
    setup: CameraSetup
    source: Source
    plan: RunPlan
    camera: PlannedCamera
    verifier: Verifier | None
    display: DisplayChain | None
    filmer: Filmer | None
    advice: list[str]
    boards: Boards
    opened: ExitStack
    bands: Bands | None = field(default=None, kw_only=True)

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

    def trial(self, progress: Progress) -> list[Finding]:
        """No finding: the plan is checked during the recording."""
        return []

    def keep(self, effects: Sequence[str]) -> LatchedMachine:
        setup = self.setup
        plan = setup.plan_keeping(self.scenario.tolerance, effects)
        camera, verifier = planned_camera(plan, setup, self.boards, self.bands)
        display, filmer = self.display, None
        if display is not None and plan.display is not None:
            display.close()
            display = make_display_chain(
                display.section, setup.shape, setup.scenario.scene.illuminance, setup.cycles,
                setup.instants, plan.display, display.pursuit, display.points,
            )  # fmt: skip
            filmer = make_camera(self.scenario.camera, display, setup.shape, setup.cycles,
                                 self.scenario.seed, setup.device)  # fmt: skip
        return replace(
            self,
            plan=plan,
            camera=camera,
            verifier=verifier,
            source=setup.source(),
            display=display,
            filmer=filmer,
        )

    def stages(self, folder: Path) -> dict[str, Any]:
        """The stages by name; the display and what films it are the last ones."""
        setup = self.setup
        recorder = Recorder(
            folder / STREAM, self.camera.shape, setup.cycles, setup.setting.clock,
            keep=self.display is None,
            watch=None if self.display else sample_places(self.camera.shape, setup.cycles),
        )  # fmt: skip
        stages: dict[str, Any] = {
            **setup.stages(self.source),
            **({} if self.verifier is None else {"check": self.verifier}),
            "sensor": self.camera,
            **readout_stages(self.scenario.sensor.duplicated_rows),
            "recorder": recorder,
            **({} if self.boards.panel is None else {"sink": self.boards.panel}),
        }
        if self.display is not None:
            stages = self.display.stages(stages)
        if self.filmer is not None:
            stages |= self.filmer.stages(folder)
        return stages

    def chain(self, folder: Path) -> BlockChain:
        (height, width), cycles = self.camera.shape, self.setup.cycles
        linked = "" if self.length == cycles else f", {self.length} with those of the link"
        kind, identity = BlockChain, self.identity()
        if isinstance(self.camera, BandedCamera):
            self.camera.place(folder, identity)
            kind, identity = BandChain, f"{identity} in bands"
        return kind(
            f"{self.name}: {cycles} cycles of {width} x {height}{linked}", self.stages(folder),
            self.length, identity, folder,
            every_s=30.0 if self.display is None else 60.0,  # a display's state is half a gigabyte
        )  # fmt: skip

    def identity(self) -> str:
        """A digest of the scenario, its plan, the version of the program, the renderer, and the
        content of the clip."""
        text = to_toml(self.scenario.model_copy(update={"title": ""})) + viform_version()
        text += self.plan.tier + ("" if self.display is None else self.display.identity())
        for better in (self.plan.fine, self.plan.exact):
            text += hashlib.sha256(better.tobytes()).hexdigest()
        for name, tiles in self.plan.plan.kept.items():
            text += name + hashlib.sha256(tiles.tobytes()).hexdigest()
        path = getattr(self.scenario.scene, "path", None)
        text += (digest(path) or "") if path is not None else ""
        return hashlib.sha256(text.encode()).hexdigest()

    def shortfall(self, recording: Recording) -> list[Finding]:
        return [] if self.verifier is None else self.verifier.shortfall(self.plan.tier)

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        setup, seconds, verifier = self.setup, recording.seconds, self.verifier
        shown = self.display is not None
        images = self._views(recording, progress) if shown else self._images(recording)
        throughput = self.throughput(recording)
        beyond = [] if verifier is None else verifier.beyond()
        faults = self.boards.faults(self.camera)
        outcome = "degraded" if self.source.degraded or beyond else "ok"
        full = None if verifier is None else verifier.full_physics_s(self.pixels, setup.cycles)
        return Outcome(
            outcome="failed" if faults else outcome,
            simulated_s=setup.cycles / setup.setting.clock.hz,
            renderer=None if self.display is None else self.display.panel_stage.renderer.name,
            error=Error(None, NO_ERROR, None) if verifier is None else verifier.result_error(),
            kept=[] if verifier is None else list(self.plan.plan.everywhere),
            left_out=[] if verifier is None else verifier.left_out(),
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
                **self.boards.metrics(self.camera),
                **getattr(self.source, "metrics", {}),
            },
            latency=images.latency,
            throughput=throughput,
            files=[STREAM, *images.files],
            notes=[*self.source.degraded, *beyond, *faults],
            table=[] if images.display is None else display_lines(images.display),
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
            *(
                [] if self.display is None
                else [Throughput("display", cycles / seconds["display"], "planes/s")]
            ),
        ]  # fmt: skip

    def recorder(self, recording: Recording) -> Any:
        """The stage that has recorded the chip's stream."""
        return recording.chain.stages["recorder"]

    def _images(self, recording: Recording) -> _Images:
        """Images and size of the stream, for a run without a display."""
        begin, setup, seconds = time.perf_counter(), self.setup, recording.seconds
        recorder = self.recorder(recording)
        stream, spikes = recorder.recorded(), recorder.spikes
        image = self.scenario.image
        threshold, noise = setup.setting.threshold, setup.setting.threshold_noise
        with threads(1) as beside:  # neither of the two loads two cores
            part = Viform(recorder.watched, stream.cycles, stream.clock)
            measured = beside.submit(measure_sizes, part, self.pixels, threshold, noise)
            dim, names = dim_light(setup, self.camera, recording.folder)
            shots = take_shots(
                stream, self.source, setup.instants, image.window, setup.white_rate, dim,
                preceding=image.preceding, registers=setup.setting.registers,
            )  # fmt: skip
            files = names + write_images(recording.folder, shots, LATCHED)
            seen = [shot.read for shot in shots if shot.rows[0] < shot.rows[1]]
            metrics = judge(seen, LATCHED) | dim_metrics(setup, shots)
            if setup.mosaic is not None:
                files += write_colour(recording.folder, shots, setup.mosaic)
                metrics |= colour_differences(shots, setup.mosaic)
            sizes = measured.result()
        metrics["spike_rate"] = Metric(spikes / (setup.cycles * self.pixels), "spikes/cycle")
        seconds["images"] = time.perf_counter() - begin
        latency = interval_latency(stream.clock, shots)
        return _Images(stream, shots, sizes, None, metrics, latency, files)

    def _views(self, recording: Recording, progress: Progress) -> _Images:
        """Images of the display's observers and measurements of its probes."""
        display, seconds = self.display, recording.seconds
        assert display is not None
        begin = time.perf_counter()
        with threads(1) as pool:  # neither of the two loads two cores
            probing = pool.submit(display.probes, self.probe_camera(), progress)
            fidelity = chain_fidelity(display)
            seconds["images"] = time.perf_counter() - begin
            outcome = DisplayOutcome.of(display, fidelity, probing.result())
        seconds["probes"] = time.perf_counter() - begin - seconds["images"]
        begin = time.perf_counter()
        section = self.scenario.display
        assert section is not None
        panel = None if section.colour is None else self.setup.mosaic
        files = write_observer_images(recording.folder, outcome, panel)
        filmed = {}
        if self.filmer is not None:
            at = [self.setup.setting.clock.middle(n) for n in self.setup.instants]
            files += self.filmer.write(recording.folder, at)
            filmed = self.filmer.metrics()
        rate = display.panel_stage.fired / (self.setup.cycles * self.pixels)
        metrics = outcome.metrics() | {"spike_rate": Metric(rate, "spikes/cycle")} | filmed
        seconds["images"] += time.perf_counter() - begin
        stream = ZarrStream(recording.folder / STREAM)
        return _Images(stream, [], None, outcome, metrics, outcome.latency(), files)

    def probe_camera(self) -> ProbeCamera:
        """The camera whose stream the display shows in its probes."""
        return SpikeProbeCamera(self.setup.setting, self.setup.device)

    def judged(self, run: Run) -> LatchedRun:
        """The data of the run for its pages."""
        images, setup = run.outcome.views, self.setup
        return LatchedRun(
            run, self.scenario, setup.setting, setup.lens, setup.white_rate, setup.instants,
            self.source, self.plan, images.stream, images.shots, images.sizes, images.display,
            setup.mosaic, self.filmer,
            None if self.verifier is None else self.verifier.bank(),
        )  # fmt: skip

    def page(self, run: Run) -> Page:
        judged = self.judged(run)
        return stream_page(judged) if judged.display is None else display_page(judged)

    def close(self) -> None:
        if self.display is not None:
            self.display.close()
        self.opened.close()


def assemble_latched(
    name: str, scenario: Scenario, device: str | None, resume: bool, bands: Bands | None = None
) -> LatchedMachine:
    """The machine of a scenario with a latched camera. Raises InputError."""
    with ExitStack() as stack:
        boards = stack.enter_context(open_boards(scenario, resume))
        setup = set_up_camera(boards.simulated, device, boards.size)
        check_run_memory(setup)  # before the survey, which needs a part of it
        source = setup.source()
        plan = setup.plan(scenario.tolerance)
        planes = plan.survey.light.planes
        check_run_memory(setup, planes)
        notes = [*setup.choice.notes, *plan.notes, memory_note(setup, planes)]
        display = filmer = None
        if plan.display is not None and setup.scenario.display is not None:
            display = make_display_chain(
                setup.scenario.display, setup.shape, setup.scenario.scene.illuminance, setup.cycles,
                setup.instants, plan.display, setup.pursuit, source.points(), setup.device,
            )  # fmt: skip
            stack.callback(display.close)
            notes += display.notes
            filmer = make_camera(
                scenario.camera, display, setup.shape, setup.cycles, scenario.seed, setup.device
            )
        camera, verifier = planned_camera(plan, setup, boards, bands)
        notes += boards.notes(camera)
        return LatchedMachine(
            name, scenario, setup, source, plan, camera, verifier, display, filmer, notes, boards,
            stack.pop_all(), bands=bands,
        )  # fmt: skip
