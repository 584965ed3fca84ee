"""How an imager is added: everything that a global-shutter CMOS imager owns stands in this file.

In the packages it would be a folder `imagers/global_shutter/` and one line in
`imagers/catalogue.py`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
import pytest
import zarr
from pydantic import Field

from cosim import PS, seconds_to_ps
from cosim.compute.streams import Stream
from cosim.config.quantity import Quantity
from cosim.frames import Frame
from cosim.light.charts import draw
from cosim.plan.effects import Bound, Summary
from cosim.report.parts import table
from cosim.run.result import Latency, Metric
from imagers.catalogue import IMAGERS
from imagers.common.frame_pixel import (
    Conversion,
    digitised,
    noise_change,
    steady_effects,
    summary_of,
)
from imagers.common.kind import Comparison, ImagerKind, ImagerSection, Setting
from imagers.common.model import ExposureRange, FrameFigures, ImagerModel, View
from imagers.common.scenery import Scenery
from imagers.report.page import ImagerRun
from scenarios.assemble.schema.loading import shipped
from scenarios.studies.compare import load_comparison
from scenarios.studies.compare.frames import one_frame
from scenarios.studies.compare.setting import SHAPE
from sensor.frame_pixels import Exposed, ImagerSummary

RESPONSIVITY = 20_000.0
"""Photoelectrons of one lux second."""
FULL_WELL = 10_000.0
STEP = 10.0
"""Electrons of one DN; 10 bits."""
READ_NOISE = 5.0
"""Electrons RMS."""
BLACK = 20.0
"""DN."""


class GlobalShutterSection(ImagerSection):
    """The [imager] section."""

    kind: Literal["global-shutter"]
    rows: Annotated[int, Field(ge=8, le=4096)] = 64
    columns: Annotated[int, Field(ge=8, le=4096)] = 64
    exposure: Annotated[float, Quantity("time", above=0, most=1.0)] = Field(
        default=5e-3, examples=["5 ms"]
    )
    frame_rate: Annotated[float, Quantity("frequency", above=0, most=1000)] = Field(
        default=100.0, examples=["100 Hz"]
    )


class GlobalShutterPixels:
    """See `PixelModel`: shot noise and read noise."""

    bits = 10

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        self.effects = steady_effects(
            {
                "shot noise": (Stream.IMAGER_SHOT, "closed form"),
                "read noise": (Stream.IMAGER_READ, "closed form"),
            },
            {"shot noise": 100.0, "read noise": 80.0},
            self._bound,
        )

    @staticmethod
    def _bound(name: str) -> Callable[[Summary], Bound]:
        """By the largest share that an effect has of the noise's variance."""

        def bound(scene: Summary) -> Bound:
            light = scene.brightest if name == "shot noise" else scene.darkest
            lost = light if name == "shot noise" else READ_NOISE**2
            return Bound(noise_change(lost, light + READ_NOISE**2), "proof")

        return bound

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        at = Conversion.of(rows, seed, kept)
        electrons = at.counts(rows.lux_seconds * RESPONSIVITY, "shot noise", Stream.IMAGER_SHOT)
        electrons = np.minimum(electrons, FULL_WELL)
        electrons = at.noisy(electrons, READ_NOISE, "read noise", Stream.IMAGER_READ)
        return digitised(electrons / STEP + BLACK, self.bits)

    def mean_variance(self, lux_seconds: float, seconds: float) -> tuple[float, float]:
        electrons = lux_seconds * RESPONSIVITY
        variance = (electrons + READ_NOISE**2) / STEP**2 + 1 / 12
        return electrons / STEP + BLACK, variance

    def summary(
        self, lux_seconds: tuple[float, float], seconds: tuple[float, float], frames: int
    ) -> ImagerSummary:
        low, high = (min(each * RESPONSIVITY, FULL_WELL) for each in lux_seconds)
        return summary_of((low, high), seconds, frames, FULL_WELL, step=STEP)


class GlobalShutter:
    """See `Imager`: all rows are exposed at once, at the end of a frame's time."""

    name = "global-shutter"

    def __init__(self, section: GlobalShutterSection) -> None:
        self.pixels = GlobalShutterPixels((section.rows, section.columns))
        self._exposure = seconds_to_ps(section.exposure)
        self._period = round(PS / section.frame_rate)

    def write(self, register: str, value: int, at: int | None = None) -> None:
        raise NotImplementedError("this imager has no registers")

    def read(self, register: str) -> int:
        raise NotImplementedError("this imager has no registers")

    def film(
        self, scene: Scenery, until: int, *, seed: int, kept: frozenset[str],
        trace: Path | None = None,
    ) -> Iterator[Frame]:  # fmt: skip
        rows = self.pixels.shape[0]
        for number in range(until // self._period):
            ready = (number + 1) * self._period
            end = np.full(rows, ready, np.int64)
            begin = end - self._exposure
            exposed = Exposed(
                scene.lux_seconds(0, begin, end), np.full(rows, self._exposure / PS),
                np.zeros(rows), 0, number,
            )  # fmt: skip
            values = self.pixels.convert(exposed, seed, kept)
            yield Frame(values, self.pixels.bits, number, begin, end, ready, {})


@dataclass(frozen=True)
class GlobalShutterModel(ImagerModel):
    """See `ImagerModel`."""

    section: GlobalShutterSection

    @property
    def shape(self) -> tuple[int, int]:
        return self.section.rows, self.section.columns

    def make(self) -> GlobalShutter:
        return GlobalShutter(self.section)

    def exposures(self, view: View, stop: int) -> ExposureRange:
        seconds = self.section.exposure
        light = float(view.least.min()) * seconds, float(view.most.max()) * seconds
        return ExposureRange(light, (seconds, seconds), int(stop * self.section.frame_rate / PS))

    def metrics(self, frames: Any, view: View, imager: Any) -> dict[str, Metric]:
        return {"mean": Metric(frames[-1].mean, "DN")}

    def latency(self, frames: Any, view: View, imager: Any) -> list[Latency]:
        microseconds = self.section.exposure * 1e6
        return [Latency("exposure", microseconds, microseconds, microseconds)]


class GlobalShutterComparison(Comparison):
    """See `Comparison`."""

    title = "global-shutter CMOS"

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        return Setting(pixels, 1e-5), Setting(pixels, 1.0)

    def sent(self, section: GlobalShutterSection) -> int:
        return section.rows * section.columns

    def setting(self, section: GlobalShutterSection, pixels: Any) -> str:
        return "fixed"


class GlobalShutterKind(ImagerKind):
    """See `ImagerKind`."""

    name = "global-shutter"
    title = "global-shutter CMOS imager"
    section = GlobalShutterSection

    def model(self, section: GlobalShutterSection, seconds: float) -> GlobalShutterModel:
        return GlobalShutterModel(section)

    def sections(self, model: GlobalShutterModel, run: ImagerRun) -> str:
        first: FrameFigures = run.frames[0]
        return "<h2>Global shutter</h2>" + table(
            ["what", "value"], [["mean of the first frame", f"{first.mean:.4g} DN"]]
        )

    def comparison(self) -> GlobalShutterComparison:
        return GlobalShutterComparison()


@pytest.fixture(autouse=True)
def catalogue_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(IMAGERS, "global-shutter", GlobalShutterKind())


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "dark-room.toml"
    path.write_text(
        """
        title = "A global shutter"
        duration = "120 ms"
        tolerance = 0.05
        [scene]
        kind = "target"
        chart = "steps"
        illuminance = "60 lux"
        [imager]
        kind = "global-shutter"
        exposure = "4 ms"
        """
    )
    return path


def test_it_runs_from_a_scenario(viform: Any, scenario: Path, tmp_path: Path) -> None:
    """Frames on disk have the light of the chart's white step; the report has its own section."""
    out = tmp_path / "run"
    answer = viform("run", scenario, "--out", out, "--json")
    document = json.loads(answer.out)
    assert (answer.code, document["outcome"]) == (0, "ok")
    assert document["metrics"]["frames"]["value"] == 12
    frames = zarr.open_group(out / "frames.zarr", mode="r")["values"]
    electrons = draw("steps", (64, 64)) * 60 * 4e-3 * RESPONSIVITY
    # Six standard deviations of the shot noise of white, mean of 12 frames.
    error = frames[:].mean(axis=0) - (electrons / STEP + BLACK)
    assert np.abs(error.mean()) < 0.1 and np.abs(error).max() < 6 * np.sqrt(4400 / 12) / STEP
    assert document["plan"] == {"kept": ["shot noise", "read noise"], "left_out": []}
    assert document["error"]["value"] == 0
    page = (out / "report.html").read_text()
    assert "global-shutter CMOS imager, 64 x 64 pixels" in page
    assert "mean of the first frame" in page and "read noise" in page


def test_its_plan_follows_the_tolerance(viform: Any, scenario: Path) -> None:
    def left_out(*words: str) -> list[str]:
        document = json.loads(viform("plan", scenario, *words, "--json").out)
        assert document["imager"] == "global-shutter" and document["expected"]["frames"] == 12
        return [row["effect"] for row in document["left_out"]]

    assert left_out("--tolerance", "0") == []
    flat = ("--set", "scene.contrast=0.1")
    assert left_out("--tolerance", "0.1", *flat) == ["read noise"]


def test_leaving_the_read_noise_out_is_measured(
    viform: Any, scenario: Path, tmp_path: Path
) -> None:
    """On a nearly flat grey the error is that of the noise alone: 1 - sqrt(N / (N + 25))."""
    words = ("--set", "scene.contrast=0.02", "--tolerance", "0.1", "--json")
    document = json.loads(viform("run", scenario, "--out", tmp_path / "run", *words).out)
    assert [row["effect"] for row in document["plan"]["left_out"]] == ["read noise"]
    electrons = 60 * 0.5 * 4e-3 * RESPONSIVITY
    size = 1 - np.sqrt(electrons / (electrons + READ_NOISE**2))
    low, high = document["error"]["ci"]
    assert low <= size <= high <= 0.1


def test_its_accuracy_is_measured(viform: Any, scenario: Path) -> None:
    words = ("--set", "scene.contrast=0.02", "--set", "duration=30 ms", "--json")
    document = json.loads(viform("accuracy", scenario, *words).out)
    rows = {row["tolerance"]: row for row in document["rows"] if row["tier"] == "exact"}
    assert rows[0.0]["left_out"] == [] and rows[0.1]["left_out"] == ["read noise"]
    assert document["reference"]["decisions"] == "none"


def test_wrong_keys_are_refused_in_one_line(viform: Any, scenario: Path) -> None:
    for assignment, says in (
        ("imager.exposre=1 ms", "did you mean imager.exposure?"),
        ("imager.frame_rate=1 s", "imager.frame_rate must be a frequency"),
        ("imager.kind=ccd", "'global-shutter'"),
    ):
        answer = viform("plan", scenario, "--set", assignment)
        assert answer.code == 2 and says in answer.err and answer.err.count("\n") == 1
    answer = viform("board", "virtual", "--imager", "global-shutter")
    assert answer.code == 2 and "an imager must be one with registers" in answer.err


def test_the_schema_names_it_and_the_others_stay(viform: Any) -> None:
    schema = json.loads(viform("list", "--schema", "--json").out)
    kinds = schema["$defs"]["ImagerScenario"]["properties"]["imager"]["discriminator"]["mapping"]
    assert {"adaptive-exposure", "ebaps", "emccd", "global-shutter"} <= set(kinds)
    assert "emccd-window" in shipped()


def test_it_is_compared_with_the_others() -> None:
    compared = load_comparison("step", ["global-shutter.exposure=2 ms"])
    section: Any = compared.imagers["global-shutter"].imager
    assert (section.exposure, section.rows, section.columns) == (2e-3, *SHAPE)
    # Signal to noise from the read noise up to full scale.
    ends = (1023 - BLACK) * STEP / np.hypot(READ_NOISE, STEP / np.sqrt(12))
    assert one_frame(GlobalShutterPixels((16, 16)), 1e-2) == pytest.approx(
        20 * np.log10(ends), abs=0.3
    )


@pytest.mark.slow
def test_the_comparison_films_it(viform: Any, tmp_path: Path) -> None:
    out = tmp_path / "made"
    answer = viform("compare", "step", "--out", out, "--json")
    rows = {row["imager"]: row for row in json.loads(answer.out)["rows"]}
    assert rows["global-shutter"]["title"] == "global-shutter CMOS"
    assert rows["global-shutter"]["skew"]["value"] == 0
