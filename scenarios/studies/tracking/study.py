"""Flow and tracking against speed, for the spike camera and for cameras with frames: the rows,
their document and their figure.

The optical flow of a moving texture is that between the means of two adjacent windows, whose
middles are one window apart. The window is the shortest of a picture; it is doubled until the
median motion in it is NEAR pixels, or the time is over. The same rule holds for all cameras.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.report.figures import MARK, subplots
from cosim.run.progress import Progress
from scenarios.scenes.moving import ExposedScene, Texture
from scenarios.studies.tracking.conditions import (
    Conditions,
    Picture,
    frame_pictures,
    spike_pictures,
)
from scenarios.studies.tracking.pursuit import Pursuit, make_spot, pursue
from sensor.reconstruct.motion import flow_grey, optical_flow

NEAR: Final = 8.0
"""Median motion between the windows that is enough, pixels."""
LONGEST: Final = 0.15
"""Longest time of both windows, s."""
WARM: Final = 512
"""Cycles before the first picture, in which the pixels' phases spread; and the frame in which they
end is left out."""
SMOOTH: Final = 1.5
"""Standard deviation of the filter before the flow, pixels."""
MARGIN: Final = 16
"""Width of the border that is not compared, pixels: content enters and leaves there."""
HEADING: Final = 30.0
"""Direction of the motion from the columns, degrees: along no axis of the grid."""
SPIKES: Final = "spikes"
"""Name of the spike camera in a row."""
FLOW_BLOCK: Final = 4
"""Cycles of the shortest window of the flow by spikes."""
Film = Callable[[ExposedScene, int, bool], Iterator[Picture]]
"""Map from a scene, a seed, and whether it is for the flow, to pictures."""
PANELS: Final[tuple[tuple[str, bool, Callable[[TrackingRow], float | None]], ...]] = (
    ("endpoint error of the flow over the speed", True, lambda row: row.flow_error),
    ("share of time without a right position", False, lambda row: row.track_loss),
    ("appearance until detection, ms", True, lambda row: row.entry_ms),
    ("turn until the track has it, ms", True, lambda row: row.turn_ms),
)
"""Title, whether the axis is logarithmic, and value."""
FRAMES: Final = ("#1d2433", "#3b6fb5", "#2f9e6e", "#8a5fb5", "#8c8c3c")
"""Colours of cameras with frames."""


@dataclass(frozen=True)
class Flow:
    """The flow of one texture by one camera.

    Attributes:
        error: mean distance of the flow's velocity from the true one (endpoint error for a motion
            of 1 s), pixels/s.
        window_s: time between the middles of the two windows.
        latency_s: time from the beginning of the first window until the second has been read.
    """

    error: float
    window_s: float
    latency_s: float


def make_texture(conditions: Conditions, speed: float, trial: int) -> Texture:
    """A texture that moves at this speed, pixels/s."""
    random = np.random.Generator(np.random.Philox(key=[conditions.seed, trial]))
    turn = math.radians(HEADING)
    velocity = speed * math.cos(turn), speed * math.sin(turn)
    return Texture(conditions.shape, velocity, seed=int(random.integers(2**32)))


def measure_flow(texture: Texture, pictures: Iterator[Picture], warm: float) -> Flow:
    """The flow in the pictures that begin at `warm`, s, or later."""
    taken: list[Picture] = []
    window = 1
    while True:
        for picture in pictures:
            if picture.start >= warm:
                taken.append(picture)
            if len(taken) == 2 * window:
                break
        first, second = taken[:window], taken[window:]
        flow = optical_flow(_mean(first), _mean(second))
        seconds = second[0].start - first[0].start
        inner = flow[MARGIN:-MARGIN, MARGIN:-MARGIN]
        lengths = np.hypot(inner[..., 0], inner[..., 1])
        if np.median(lengths) >= NEAR or 4 * seconds > LONGEST:
            break
        window *= 2
    wrong = inner / seconds - np.array(texture.velocity)
    error = float(np.mean(np.hypot(wrong[..., 0], wrong[..., 1])))
    return Flow(error, seconds, second[-1].ready - first[0].start)


def _mean(pictures: list[Picture]) -> npt.NDArray[np.uint8]:
    mean = np.mean([p.values for p in pictures], axis=0, dtype=np.float64)
    return flow_grey(np.asarray(mean, np.float32), 1.0, SMOOTH)


@dataclass(frozen=True)
class TrackingRow:
    """One camera at one speed. Times are medians over the trials, in which what never came counts
    as later than all others; None if that is the median.

    Attributes:
        speed_px_ms: speed of the object and of the texture, pixels/ms.
        camera: "spikes", or frames/s such as "60 Hz".
        pictures_hz: pictures a second of the tracker.
        track_loss: share of the time in the image in which the track, predicted to the present,
            is absent or more than 4 pixels from the object; mean over the trials.
        position_px: distance of a detection from the object at the middle of the exposure, median;
            None without detections.
        entry_ms: time from the object's appearance until a right position.
        entry_missed: share of the trials without one.
        turn_ms: time from the object's turn until the track has it.
        turn_missed: share of the trials in which it never has.
        flow_error_px_ms: endpoint error of the flow, as a velocity, mean over pixels and trials.
        flow_error: the same over the speed.
        flow_window_ms: time between the two images of the flow, median.
        flow_latency_ms: time from the beginning of the first image until the second has been read.
    """

    speed_px_ms: float
    camera: str
    pictures_hz: float
    track_loss: float
    position_px: float | None
    entry_ms: float | None
    entry_missed: float
    turn_ms: float | None
    turn_missed: float
    flow_error_px_ms: float
    flow_error: float
    flow_window_ms: float
    flow_latency_ms: float


def _cameras(conditions: Conditions) -> dict[str, tuple[float, Film]]:
    """Pictures a second, and the pictures of a scene, of each camera."""

    def spikes(scene: ExposedScene, seed: int, flow: bool) -> Iterator[Picture]:
        return spike_pictures(scene, conditions, seed, FLOW_BLOCK if flow else None)

    def frames(rate: float) -> Film:
        return lambda scene, seed, flow: frame_pictures(scene, conditions, seed, rate)

    made: dict[str, tuple[float, Film]] = {SPIKES: (conditions.clock.hz / conditions.block, spikes)}
    return made | {f"{rate:g} Hz": (rate, frames(rate)) for rate in conditions.frame_rates}


def run_tracking(conditions: Conditions, progress: Progress) -> list[TrackingRow]:
    """Films the same objects and textures with every camera, at every speed.

    Returns:
        The rows, by speed and then by camera.
    """
    cameras = _cameras(conditions)
    progress.start("tracking and flow", len(conditions.speeds) * conditions.trials * len(cameras))
    rows, done = [], 0
    for speed in conditions.speeds:
        pursuits: dict[str, list[Pursuit]] = {name: [] for name in cameras}
        flows: dict[str, list[Flow]] = {name: [] for name in cameras}
        for trial in range(conditions.trials):
            spot = make_spot(conditions, speed, trial)
            texture = make_texture(conditions, speed, trial)
            for number, (name, (_, film)) in enumerate(cameras.items()):
                seed = _seed(conditions.seed, trial, number)
                pursuits[name].append(pursue(spot, film(spot, seed, False)))
                warm = WARM / conditions.clock.hz
                flows[name].append(measure_flow(texture, film(texture, seed, True), warm))
                done += 1
                progress.advance(done)
        rows += [
            _row(speed, name, hz, pursuits[name], flows[name]) for name, (hz, _) in cameras.items()
        ]
    return rows


def _seed(*key: int) -> int:
    """The seed of a camera's noise in one trial."""
    return int(np.random.SeedSequence(key).generate_state(1)[0])


def _middle(values: Sequence[float | None]) -> float | None:
    """Median, ms of s, where None is later than everything."""
    ordered = sorted(float("inf") if value is None else value for value in values)
    found = median(ordered)
    return None if found == float("inf") else 1e3 * found


def _row(
    speed: float, name: str, hz: float, pursuits: Sequence[Pursuit], flows: Sequence[Flow]
) -> TrackingRow:
    entries, turns = [p.entry_s for p in pursuits], [p.turn_s for p in pursuits]
    places = [p.position_px for p in pursuits if p.position_px is not None]
    error = float(np.mean([flow.error for flow in flows]))
    return TrackingRow(
        speed / 1e3, name, hz,
        float(np.mean([p.lost for p in pursuits])),
        float(np.median(places)) if places else None,
        _middle(entries), entries.count(None) / len(entries),
        _middle(turns), turns.count(None) / len(turns),
        error / 1e3, error / speed,
        1e3 * median(flow.window_s for flow in flows),
        1e3 * median(flow.latency_s for flow in flows),
    )  # fmt: skip


def tracking_table(rows: Sequence[TrackingRow]) -> str:
    """The rows as text."""
    cells = [[
        "px/ms", "camera", "track loss", "position px", "entry ms", "turn ms", "flow error",
        "flow px/ms", "flow ms",
    ]]  # fmt: skip
    for row in rows:
        cells.append([
            f"{row.speed_px_ms:g}", row.camera, f"{row.track_loss:.1%}", _number(row.position_px),
            _number(row.entry_ms), _number(row.turn_ms), f"{row.flow_error:.1%}",
            _number(row.flow_error_px_ms), _number(row.flow_latency_ms),
        ])  # fmt: skip
    widths = [max(len(line[n]) for line in cells) for n in range(len(cells[0]))]
    return "\n".join(
        "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))
        for line in cells
    )


def _number(value: float | None) -> str:
    return "never" if value is None else f"{value:.3g}"


def tracking_document(conditions: Conditions, rows: Sequence[TrackingRow]) -> dict[str, Any]:
    """The document of the command."""
    return {
        "seed": conditions.seed, "trials": conditions.trials, "clock_hz": conditions.clock.hz,
        "white_rate": conditions.white, "threshold_e": conditions.threshold,
        "white_e_s": conditions.electrons, "height": conditions.shape[0],
        "width": conditions.shape[1], "rows": [asdict(row) for row in rows],
    }  # fmt: skip


def tracking_figure(path: Path, rows: Sequence[TrackingRow]) -> None:
    """Draws a line for each camera. A latency is not drawn where most trials have none."""
    figure, axes = subplots(2, 2, figsize=(10, 7), layout="constrained", sharex=True)
    names = list(dict.fromkeys(row.camera for row in rows))
    for axis, (title, log, value) in zip(axes.flat, PANELS, strict=True):
        for number, name in enumerate(names):
            own = [row for row in rows if row.camera == name]
            given = [(row.speed_px_ms, v) for row in own if (v := value(row)) is not None]
            axis.plot(
                [speed for speed, _ in given], [v for _, v in given], "o-", markersize=4,
                color=MARK if name == SPIKES else FRAMES[(number - 1) % len(FRAMES)], label=name,
            )  # fmt: skip
        axis.set_title(title, loc="left", fontsize=10)
        axis.set_xscale("log")
        if log:
            axis.set_yscale("log")
        else:
            axis.set_ylim(-0.03, 1.03)
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("speed, pixels/ms")
    axes[0, 0].legend(frameon=False, fontsize=9)
    figure.savefig(path, dpi=110, facecolor="white", format="png")
