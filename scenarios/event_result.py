"""What a run with event readout makes of its events: images, figures of merit, delays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim import Clock, Events, Plane
from scenarios.fidelity import Estimate, psnr, ssim, to_white
from scenarios.png import write_linear_png
from scenarios.result import Latency, Metric
from scenarios.scenes import Source
from sensor import CameraSetting
from sensor.asynchronous import EventModel, Firings, latched
from sensor.asynchronous.image import rate_image

__all__ = [
    "EventShot", "effect_names", "first_instants", "judge_shots", "spread", "take_event_shots",
    "write_shots",
]  # fmt: skip

Instants = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class EventShot:
    """One instant: cycle of sensor.clock, truth, and TFI from events, white = 1, (H, W)."""

    cycle: int
    truth: Plane
    tfi: Estimate


def take_event_shots(
    events: Events, source: Source, clock: Clock, instants: list[int], model: EventModel,
    white: float,
) -> list[EventShot]:  # fmt: skip
    """TFI of each instant beside the truth. white: electrons a second of white."""
    shots = []
    for cycle in instants:
        middle = clock.middle(cycle)
        tick = int(latched(np.array([middle]), model.tick)[0])
        rate = rate_image(events, tick, model.threshold, model.delay / 1e12)
        shots.append(EventShot(cycle, source.truth(middle), to_white(rate, white)))
    return shots


def judge_shots(shots: list[EventShot]) -> dict[str, Metric]:
    """PSNR and SSIM, mean over the instants."""
    return {
        "tfi_psnr": Metric(float(np.mean([psnr(s.tfi, s.truth) for s in shots])), "dB"),
        "tfi_ssim": Metric(float(np.mean([ssim(s.tfi, s.truth) for s in shots])), "1"),
    }


def effect_names(model: EventModel, setting: CameraSetting, channel: bool) -> list[str]:
    """Effects that act, by name."""
    pattern = [e.name for e in setting.kept if e not in setting.effects]
    made = ["shot noise", "shortest width", "timing clock"]
    made += ["longest width"] * bool(model.longest)
    made += ["first-spike rule"] * bool(model.change)
    return [*made, *pattern, *(["shared channel"] if channel else [])]


def first_instants(sent: Firings) -> Instants:
    """Instants at which pixels first fired, ps."""
    _, first = np.unique(sent.pixel, return_index=True)
    return sent.instant[first]


def spread(stage: str, ps: Instants) -> list[Latency]:
    """Least, median and most of times in picoseconds; nothing of nothing."""
    if not ps.size:
        return []
    least, middle, most = (float(x) / 1e6 for x in (ps.min(), np.median(ps), ps.max()))
    return [Latency(stage, least, middle, most)]


def write_shots(folder: Path, shots: list[EventShot]) -> list[str]:
    """Linear pictures of the instants, 8-bit grey; their names in the folder."""
    names = []
    if shots:
        (folder / "images").mkdir(exist_ok=True)
    for shot in shots:
        for method in ("truth", "tfi"):
            names.append(f"images/{method}-{shot.cycle:05d}.png")
            write_linear_png(folder / names[-1], getattr(shot, method))
    return names
