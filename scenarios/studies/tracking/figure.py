"""The figure of a comparison of motion: flow, track and latency against speed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from cosim.report.figures import MARK, subplots
from scenarios.studies.tracking.study import SPIKES, Row

PANELS: Final[tuple[tuple[str, bool, Callable[[Row], float | None]], ...]] = (
    ("endpoint error of the flow over the speed", True, lambda row: row.flow_error),
    ("share of time without a right position", False, lambda row: row.track_loss),
    ("appearance until detection, ms", True, lambda row: row.entry_ms),
    ("turn until the track has it, ms", True, lambda row: row.turn_ms),
)
"""Title, whether the axis is logarithmic, and value."""
FRAMES: Final = ("#1d2433", "#3b6fb5", "#2f9e6e", "#8a5fb5", "#8c8c3c")
"""Colours of cameras with frames."""


def tracking_figure(path: Path, rows: Sequence[Row]) -> None:
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
