"""The machine of a recorded stream: copied into the run's folder, and imaged without truth."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from cosim import Clock
from cosim.config.amounts import amount, count, number
from cosim.config.toml import to_toml
from cosim.files import Recorder, ZarrStream, ending_of
from cosim.plan.error import Finding
from cosim.report.explorer import explorer_part
from cosim.report.parts import figure, table
from cosim.report.png import for_display, pictures_wanted, write_linear_png
from cosim.run.chain import STREAM, BlockChain
from cosim.run.inputs import add_digests
from cosim.run.machine import Outcome, Page, Run
from cosim.run.machine import Recording as Recorded
from cosim.run.progress import Progress
from cosim.run.result import Error, Metric, Throughput, viform_version
from cosim.spikes.clocked import (
    ClockedEvents,
)
from cosim.spikes.staged import StreamStage, Telling
from cosim.spikes.viform import Words
from cosim.stage import Block
from scenarios.assemble.instants import choose_windows
from scenarios.assemble.schema.scenario import RecordingScenario
from scenarios.assemble.source.feeds import Feed, Planes
from scenarios.assemble.source.latched.dim import said_by_run
from scenarios.assemble.source.recording.opening import Recording, open_recording
from sensor.latched.ancillary import AncillaryStage
from sensor.reconstruct.fidelity import Estimate, to_white
from sensor.reconstruct.intervals import tfi
from sensor.reconstruct.playback import tfp
from sensor.reconstruct.shots import spike_rate

NO_ERROR: Final = "a recorded stream is not simulated"
NO_TRUTH: Final = (
    "a recorded stream has no scene: PSNR and SSIM, which need its true light, are null"
)


@dataclass(frozen=True, eq=False)
class RecordingMachine:
    """A recorded stream that is ready to run; see `Machine`.

    Attributes:
        name: short name of the scenario.
        scenario: the scenario.
        recording: the stream.
        instants: cycles of the images.
    """

    name: str
    scenario: RecordingScenario
    recording: Recording
    instants: list[int]

    device = "none: nothing is simulated"
    unit = "cycles"

    @property
    def toml(self) -> str:
        return to_toml(self.scenario)

    @property
    def notes(self) -> list[str]:
        return [*self.recording.notes, NO_TRUTH]

    @property
    def length(self) -> int:
        return self.recording.cycles

    @property
    def pixels(self) -> int:
        return self.recording.shape[0] * self.recording.shape[1]

    @property
    def bits(self) -> int:
        return self.recording.cycles * self.pixels

    def check(self, progress: Progress) -> list[Finding]:
        """None: nothing is left out."""
        return []

    def keep(self, effects: Sequence[str]) -> RecordingMachine:
        return self

    def chain(self, folder: Path) -> BlockChain:
        found = self.recording
        height, width = found.shape
        stages = {
            "file": found.stage(),
            "recorder": Recorder(
                folder / STREAM, found.shape, found.cycles, found.clock, keep=True
            ),
        }
        inputs = to_toml(self.scenario.model_copy(update={"title": ""}))
        identity = hashlib.sha256((add_digests(inputs) + viform_version()).encode()).hexdigest()
        return BlockChain(
            f"{self.name}: {found.cycles} cycles of {width} x {height}", stages, found.cycles,
            identity, folder,
        )  # fmt: skip

    def shortfall(self, recording: Recorded) -> list[Finding]:
        """None: no error is measured."""
        return []

    def judge(self, recording: Recorded, progress: Progress) -> Outcome:
        found, seconds, begin = self.recording, recording.seconds, time.perf_counter()
        stream = recording.chain.stages["recorder"].recorded()
        shots = self._images(stream)
        files = [STREAM, *_write(recording.folder, shots)]
        seconds["images"] = time.perf_counter() - begin
        source = recording.chain.stages["file"]
        lost, notes = {}, []
        if isinstance(source, ClockedEvents):
            lost = {
                "events_lost": Metric(float(source.lost), "1"),
                "events_late": Metric(float(source.late), "1"),
            }
            if source.lost:
                notes.append(
                    f"{source.lost} events came in a cycle in which their pixel had fired already "
                    "and are not in the planes: raise sensor.clock"
                )
        rate = found.cycles * self.pixels / max(seconds["file"], 1e-9)
        return Outcome(
            outcome="ok",
            simulated_s=found.cycles / found.clock.hz,
            error=Error(None, NO_ERROR, None),
            metrics={
                **{
                    f"{kind}_psnr": Metric(None, "dB", "a recording has no true light")
                    for kind in ("tfp", "tfi")
                },
                "spike_rate": Metric(spike_rate(stream), "spikes/cycle"),
                "white_rate": Metric(found.white_rate, "spikes/cycle"),
                **lost,
            },
            throughput=[Throughput("file", rate, "pixel-cycles/s")],
            files=files,
            notes=notes,
            views=shots,
        )

    def _images(self, stream: ZarrStream) -> dict[int, tuple[Estimate, Estimate]]:
        """TFP and TFI of every instant, white = 1."""
        image, white = self.scenario.image, self.recording.white_rate
        return {
            cycle: (
                to_white(tfp(stream, cycle, image.window, preceding=image.preceding), white),
                to_white(tfi(stream, cycle), white),
            )
            for cycle in self.instants
        }

    def page(self, run: Run) -> Page:
        found = self.recording
        rows = [
            ["file", str(found.path), "scenario"],
            ["pixels", f"{found.shape[1]} x {found.shape[0]}",
             found.sized_by or f"the {ending_of(found.path)}"],
            ["clock", f"{number(found.clock.hz / 1e3)} kHz",
             "scenario" if self.scenario.sensor.clock else "the format"],
            ["cycles", count(found.cycles), "duration" if self.scenario.duration else "the stream"],
            ["white", f"{number(found.white_rate)} spikes a cycle", "see the notes"],
        ]  # fmt: skip
        stream = run.recording.chain.stages["recorder"].recorded()
        at = self.instants[len(self.instants) // 2]
        part = explorer_part(stream, at, found.white_rate, self.scenario.image.window, None)
        return recording_page(self.scenario.title, found.clock, run, rows, part)

    def close(self) -> None:
        """Nothing is open."""


def _write(folder: Path, shots: dict[int, tuple[Estimate, Estimate]]) -> list[str]:
    """Writes the images, linear, 8-bit grey; their names in the folder."""
    names: list[str] = []
    if not pictures_wanted():
        return names
    (folder / "images").mkdir(exist_ok=True)
    for cycle, images in shots.items():
        for method, image in zip(("tfp", "tfi"), images, strict=True):
            names.append(f"images/{method}-{cycle:05d}.png")
            write_linear_png(folder / names[-1], np.asarray(image))
    return names


def assemble_recording(name: str, scenario: RecordingScenario) -> RecordingMachine:
    """The machine of a scenario. Raises InputError."""
    recording = open_recording(scenario)
    return RecordingMachine(name, scenario, recording, choose_windows(scenario, recording.cycles))


class RecordedFeed(Feed):
    """A recorded stream."""

    def __init__(self, machine: RecordingMachine, live: bool = False) -> None:
        """live: whether the stream is read while the run goes on; its white is told at the end."""
        found = machine.recording
        said = None if live else said_by_run(found.path)
        self._said, self._telling = said, Telling(None if live else found.stream)
        super().__init__(
            found.shape, found.clock, found.cycles, found.white_rate,
            "" if live else f"{found.white_rate:.3g} spikes a cycle", live=live,
            registers=None if said is None else said.setting.registers,
            **({"residues": self._telling.charges} if said is None else said.panel),
        )  # fmt: skip
        self._stream = None if live else found.stream

    def sample(self, first: int, cycles: int) -> Words | None:
        """See `Feed`. Spikes that have not come yet, and events, are not known."""
        if self._stream is None:
            return None
        return StreamStage(self._stream).step(None, Block(first, cycles)).words

    def telling(self) -> AncillaryStage | Telling | None:
        if self._said is not None:
            return self._said.stage(self.shape)
        return self._telling or None

    def planes(self, recording: Recorded, outcome: Outcome) -> Planes:
        """See `Feed`."""
        return Planes(StreamStage(ZarrStream(recording.folder / STREAM)), stored=True)


def recording_page(
    title: str, clock: Clock, run: Run, facts: list[list[str]], explorer: str
) -> Page:
    """The page.

    Args:
        title: title of the scenario.
        clock: clock of the stream.
        run: the run; its views are the images (TFP, TFI) by cycle, white = 1.
        facts: rows of the table of the recording: what, value, from.
        explorer: explorer of the stream's spikes.
    """
    metrics, shots = run.result.metrics, run.outcome.views
    rate = number(metrics["spike_rate"].value)
    length = amount(run.result.simulated_s, "s", 4)
    parts = [
        "<h2>Images at chosen instants</h2><p>TFP and TFI of the recorded spikes, white of the "
        "notes = white, through the sRGB curve. A recording has no true light to compare with.</p>"
    ]
    for cycle, (mean, interval) in shots.items():
        pictures = figure(for_display(mean), "TFP") + figure(for_display(interval), "TFI")
        parts.append(
            f"<h3>{number(clock.middle(cycle) / 1e9, 4)} ms</h3>"
            f'<div class="grid by2">{pictures}</div>'
        )
    return Page(
        title,
        "a recorded stream",
        f"No camera was simulated: these spikes were recorded, {length} of them. The images below "
        "are computed from them.",
        [("first", rate, "spikes per pixel and cycle, mean")],
        [
            f"<h2>Explore the stream</h2>{explorer}",
            "".join(parts),
            "<h2>The recording</h2>" + table(["what", "value", "from"], facts),
        ],
        good="What the recording holds",
        quality="No image can be rated: a recording has no true light to compare with.",
        unmeasured="Nothing to be wrong: the spikes are those of the recording, bit by bit.",
    )
