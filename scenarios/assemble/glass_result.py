"""What a run's display leaves: what was seen, how good it is, and the documents' part of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.report.png import write_linear_png
from cosim.run.result import Latency, Metric
from display.observe.beside import TRUTH
from display.observe.showing import key_of
from display.quality.fidelity import Judged, Seen, judge_glass
from scenarios.assemble.glass import SPIKE, Glass
from scenarios.assemble.probes import Probes, display_metrics
from scenarios.assemble.probes.latency import PARTS
from scenarios.assemble.probes.metrics import GREY

__all__ = ["SPIKE", "TRUTH", "Shown", "finish_glass", "judge_seen", "title_of", "write_eye_images"]


@dataclass(frozen=True, eq=False)
class Shown:
    """A run's display when it is over.

    seen: by display ("truth", "spike", "60 Hz", ...) and observer. frames: the slow motion by
    display, (frames, h, w) uint8 through the sRGB curve.
    """

    glass: Glass
    seen: Seen
    judged: list[Judged]
    frames: dict[str, npt.NDArray[np.uint8]]
    total_light: float | None
    probes: Probes

    @property
    def displays(self) -> list[str]:
        """All but the truth, the spike display first."""
        return [name for name in self.seen if name != TRUTH]

    def judged_as(self, display: str, observer: str) -> Judged:
        return next(j for j in self.judged if (j.display, j.observer) == (display, observer))

    def metrics(self) -> dict[str, Metric]:
        """For result.json."""
        out: dict[str, Metric] = {}
        for judged in self.judged:
            out |= judged.metrics()
        total = Metric(self.total_light, "emitted/expected")
        return display_metrics(self.probes) | out | {"total_light": total}

    def latency(self) -> list[Latency]:
        """From photon to photon, stage by stage: mid grey out of the dark, with the panel's own
        drive; from 5 to 95 % of pixels."""
        return [
            Latency(stage, part.low, part.median, part.high)
            for told in self.probes.latency
            if (told.display, told.drive) == ("spike", self.probes.drive)
            and (told.rate, told.way) == (GREY, "rise")
            for stage, part in zip(PARTS, told.parts, strict=True)
            if np.isfinite(part.median)
        ]


def title_of(shown: Shown, display: str) -> str:
    """What a reader is told that a display is."""
    if display == TRUTH:
        return "clear glass"
    return f"spikes, {shown.glass.panel.drive}" if display == SPIKE else display


def judge_seen(glass: Glass) -> list[Judged]:
    """Fidelity of every display to every observer; after the last block."""
    return judge_glass(glass.seen(), list(glass.observers))


def finish_glass(glass: Glass, judged: list[Judged], probes: Probes) -> Shown:
    """Everything together. judged: as `judge_seen` tells it. probes: of its panels."""
    emitted, spikes = glass.shown.emitted, glass.shown.spikes
    total = emitted / spikes if emitted is not None and spikes else None
    return Shown(glass, glass.seen(), judged, glass.frames(), total, probes)


def write_eye_images(folder: Path, shown: Shown) -> list[str]:
    """What the eyes see at the middle instant: images/eye-60hz.png, images/pursuit-truth.png, ...;
    linear, white = 255. Their names."""
    (folder / "images").mkdir(exist_ok=True)
    names = []
    for display, views in shown.seen.items():
        for observer, images in views.items():
            names.append(f"images/{observer}-{key_of(display)}.png")
            write_linear_png(folder / names[-1], images[len(images) // 2])
    return names
