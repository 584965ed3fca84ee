"""The command line in this process, clips made on the spot, and small runs that tests share."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import av
import numpy as np
import numpy.typing as npt
import pytest

from cosim.run.machine import Options
from cosim.run.result import Result
from cosim.run.shown import SilentProgress
from scenarios.assemble.schema.loading import load
from scenarios.cli.entry import _main
from scenarios.report import write_report
from scenarios.run import run_scenario

SMALL = ("sensor.chip=spikeone", "duration=2.5 ms", "image.at=[50]")
"""100 cycles of 400 x 250 pixels, one image."""


class Answer(NamedTuple):
    """What a command said."""

    code: int
    out: str
    err: str


@pytest.fixture
def viform(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Answer]:
    """Runs a command in this process, which says the same however long it takes."""
    monkeypatch.setattr("cosim.run.shown.EVERY_S", math.inf)

    def call(*arguments: object) -> Answer:
        capsys.readouterr()
        code = _main([str(argument) for argument in arguments])
        return Answer(code, *capsys.readouterr())

    return call


@pytest.fixture
def refused(viform: Callable[..., Answer]) -> Callable[..., str]:
    """Runs a command that must refuse its input; the one line that it says."""

    def call(*arguments: object) -> str:
        code, out, err = viform(*arguments)
        assert (code, out) == (2, "")
        assert err.startswith("viform: ") and err.endswith("\n") and err.count("\n") == 1, err
        return err.removeprefix("viform: ").rstrip("\n")

    return call


@pytest.fixture(scope="session")
def make_clip() -> Callable[..., Path]:
    """Writes frames, (n, H, W) or (n, H, W, 3) uint8, as a clip without loss."""

    def make(
        path: Path,
        frames: npt.NDArray[np.uint8],
        rate: Fraction | int = 25,
        codec: str = "ffv1",
        aspect: Fraction | None = None,
        pts: Sequence[int] | None = None,
    ) -> Path:
        grey = frames.ndim == 3
        with av.open(str(path), "w") as container:
            stream: Any = container.add_stream(codec, rate=rate)
            stream.height, stream.width = frames.shape[1:3]
            stream.pix_fmt = "gray" if grey else "bgr0"
            if aspect is not None:
                stream.codec_context.sample_aspect_ratio = aspect
            for n, pixels in enumerate(frames):
                frame = av.VideoFrame.from_ndarray(pixels, format="gray" if grey else "rgb24")
                frame.pts = pts[n] if pts is not None else n
                frame.time_base = 1 / Fraction(rate)
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
        return path

    return make


@pytest.fixture(scope="session")
def film() -> Callable[..., tuple[Result, Path]]:
    """Runs a scenario of a latched camera, small by default."""

    def call(
        name: str,
        out: Path,
        *assignments: str,
        small: bool = True,
        resume: bool = False,
        device: str | None = None,
        store: str = "fast",
        report: Callable[..., list[str]] = lambda machine, run: [],
        progress: Any = None,
    ) -> tuple[Result, Path]:
        short, scenario = load(name, [*(SMALL if small else ()), *assignments])
        done = run_scenario(
            short, scenario, out, options=Options(device, resume, store=store),
            began=time.perf_counter(),
            progress=progress or SilentProgress(),
            report=report,
        )  # fmt: skip
        return done.result, done.folder

    return call


class StepRun(NamedTuple):
    """A whole run of the step scenario, with its report."""

    result: Result
    folder: Path


@pytest.fixture(scope="session")
def step_run(
    film: Callable[..., tuple[Result, Path]], tmp_path_factory: pytest.TempPathFactory
) -> StepRun:
    """100 cycles, five images; the light jumps 0.4 of the way into cycle 50."""
    folder = tmp_path_factory.mktemp("runs") / "step"
    sets = ("scene.at=1.26 ms", "image.at=[]", "title=A step <script>alert(1)</script> & more")
    return StepRun(*film("step", folder, *sets, report=write_report))
