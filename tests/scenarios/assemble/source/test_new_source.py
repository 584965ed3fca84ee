"""How a source is added: random spikes of one rate, with its section, machine and feed.

In the packages it would be a file in `scenarios/assemble/source/`, its scenario in
`scenarios/assemble/schema/scenario.py` with a line in `KINDS`, and its branch in `_source` of
`scenarios/assemble/machine.py`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
from pydantic import Field

from cosim import Block, Clock, Viform, seconds_to_ps
from cosim.config.quantity import Duration, Frequency, Section
from cosim.config.toml import to_toml
from cosim.files import Recorder, ZarrStream
from cosim.plan.error import Finding
from cosim.run.chain import STREAM, BlockChain
from cosim.run.machine import Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Error, Metric
from cosim.spikes.staged import StreamStage
from cosim.spikes.viform import words_for
from cosim.stage import State
from display.section import DisplaySection
from link.section import LinkSection
from scenarios.assemble import machine as assembling
from scenarios.assemble.schema.export import export
from scenarios.assemble.schema.keys import keys
from scenarios.assemble.schema.scenario import KINDS, CameraSection, ImageSection, ScenarioKind
from scenarios.assemble.source.feeds import Feed, Planes
from sensor.codec.packets.section import CodeSection


class PatternSection(Section):
    """Random spikes."""

    rate: Annotated[float, Field(gt=0, le=1)] = 0.3
    width: Annotated[int, Field(ge=8, le=1000)] = 16
    height: Annotated[int, Field(ge=8, le=1000)] = 16
    clock: Frequency = 40e3


class PatternScenario(Section):
    """A pattern in the place of a chip."""

    title: str = Field(examples=["Random spikes"])
    duration: Duration
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    pattern: PatternSection = PatternSection()
    display: DisplaySection | None = None
    camera: CameraSection | None = None
    image: ImageSection = ImageSection()
    code: CodeSection | None = None
    link: LinkSection | None = None


class PatternStage:
    """See `Stage`."""

    def __init__(self, section: PatternSection, seed: int) -> None:
        self.section, self.seed = section, seed

    def step(self, data: Any, block: Block) -> Viform:
        own, random = self.section, np.random.default_rng((self.seed, block.start))
        words = np.zeros((words_for(block.cycles), own.height, own.width), np.uint32)
        for cycle in range(block.cycles):
            fired = random.random(words.shape[1:]) < own.rate
            words[cycle // 32] |= fired.astype(np.uint32) << np.uint32(cycle % 32)
        return Viform(words, block.cycles, Clock.from_hz(own.clock), block.start)

    def state(self) -> State:
        return {}

    def restore(self, state: State) -> None:
        """Nothing is carried from block to block."""


@dataclass(frozen=True, eq=False)
class PatternMachine:
    """See `Machine`."""

    name: str
    scenario: PatternScenario

    device = "none: nothing is simulated"
    unit = "cycles"
    notes = ()

    @property
    def toml(self) -> str:
        return to_toml(self.scenario)

    @property
    def clock(self) -> Clock:
        return Clock.from_hz(self.scenario.pattern.clock)

    @property
    def length(self) -> int:
        return self.clock.cycles_in(seconds_to_ps(self.scenario.duration))

    @property
    def bits(self) -> int:
        return self.length * self.scenario.pattern.width * self.scenario.pattern.height

    def check(self, progress: Progress) -> list[Finding]:
        return []

    def keep(self, effects: Sequence[str]) -> PatternMachine:
        return self

    def chain(self, folder: Path) -> BlockChain:
        s = self.scenario.pattern
        stages = {
            "pattern": PatternStage(s, self.scenario.seed),
            "recorder": Recorder(
                folder / STREAM, (s.height, s.width), self.length, self.clock, keep=True
            ),
        }
        return BlockChain("pattern", stages, self.length, self.toml, folder)

    def shortfall(self, recording: Recording) -> list[Finding]:
        return []

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        return Outcome(
            "ok", self.length / self.clock.hz, Error(None, "a pattern is not simulated", None),
            metrics={"rate": Metric(self._rate(recording), "spikes/cycle")}, files=[STREAM],
        )  # fmt: skip

    def _rate(self, recording: Recording) -> float:
        words, planes = StreamStage(ZarrStream(recording.folder / STREAM)), self.length
        found = words.step(None, Block(0, planes)).words
        return float(np.bitwise_count(found).sum() / (planes * found[0].size))

    def page(self, run: Run) -> Page:
        return Page(self.scenario.title, "a pattern", "Random spikes.", [], [])

    def close(self) -> None:
        """Nothing is open."""


class PatternFeed(Feed):
    """See `Feed`."""

    def __init__(self, machine: PatternMachine) -> None:
        s = machine.scenario.pattern
        super().__init__((s.height, s.width), machine.clock, machine.length, 1.0, "")

    def planes(self, recording: Recording, outcome: Outcome) -> Planes:
        return Planes(StreamStage(ZarrStream(recording.folder / STREAM)), stored=True)


@pytest.fixture(autouse=True)
def pattern(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The two places where a source is named."""
    others = assembling._source

    def source(name: str, scenario: Any, options: Any) -> Any:
        if isinstance(scenario, PatternScenario):
            return PatternMachine(name, scenario), PatternFeed
        return others(name, scenario, options)

    monkeypatch.setattr(assembling, "_source", source)
    KINDS.append(
        ScenarioKind("pattern", "a pattern", PatternScenario, lambda data: "pattern" in data)  # type: ignore[arg-type]
    )
    keys.cache_clear()
    yield
    KINDS.pop()
    keys.cache_clear()


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "noise.toml"
    path.write_text('title = "Noise"\nduration = "3.2 ms"\n[pattern]\nrate = 0.2\n')
    return path


def test_it_runs_from_a_scenario(viform: Any, scenario: Path, tmp_path: Path) -> None:
    answer = viform("run", scenario, "--out", tmp_path / "run", "--json")
    document = json.loads(answer.out)
    assert (answer.code, document["outcome"]) == (0, "ok")
    spread = np.sqrt(0.2 * 0.8 / (128 * 16 * 16))
    assert document["metrics"]["rate"]["value"] == pytest.approx(0.2, abs=5 * spread)
    page = (tmp_path / "run" / "report.html").read_text()
    assert "a pattern, seed 1" in page


def test_the_schema_names_it_and_wrong_keys_are_refused(refused: Any, scenario: Path) -> None:
    assert "PatternScenario" in export()["$defs"]
    (key,) = (key for key in keys() if key.name == "pattern.rate")
    assert key.default == "0.3"
    line = refused("run", scenario, "--set", "pattern.rat=0.3")
    assert "did you mean pattern.rate?" in line
    line = refused("plan", scenario)
    assert "the scenario must be one with a [scene]" in line and "one of a pattern" in line


@pytest.mark.slow
def test_a_display_shows_it(viform: Any, scenario: Path, tmp_path: Path) -> None:
    display = ("--set", "display.drive=impulse", "--set", "image.at=[60]")
    answer = viform("run", scenario, "--out", tmp_path / "run", *display, "--json")
    assert answer.code == 0, answer.err
    assert json.loads(answer.out)["metrics"]["total_light"]["value"] == pytest.approx(1, abs=0.02)
