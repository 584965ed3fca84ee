"""How the camera's clock was locked, for reports: a figure and its section."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.config.amounts import count, number
from cosim.report.drawn import Data, drawn
from cosim.report.parts import plot
from link.report.figures import BLUE, INK, MARK, figure_at
from link.setup.locking.loop import INTERVAL, ClockLock

_ASKED = 0.1
"""Phase within which symbols of one tick keep their information, ticks."""


def _figure(lock: ClockLock, path: Path) -> Data:
    """Draws the true phase over the run, and what the loop measured with its standard errors."""
    with figure_at(path, 8.2, 2.8) as (figure, ax):
        ax.plot(np.arange(lock.phase.size), lock.phase, color=INK, linewidth=1.2, label="true")
        at = INTERVAL * np.arange(lock.measured.size)
        ax.errorbar(
            at, lock.measured, lock.error, fmt="o", markersize=4, color=BLUE, capsize=3,
            label="measured by the loop",
        )  # fmt: skip
        for limit in (-_ASKED, _ASKED):
            ax.axhline(limit, color=MARK, linewidth=1, linestyle="--")
        ax.set_xlim(0, lock.phase.size)
        ax.set_xlabel("tick of the recording")
        ax.set_ylabel("planes after the ticks, ticks")
        ax.legend(fontsize=8.5, frameon=False, ncols=2)
    return drawn(figure)


def phase_section(lock: ClockLock | None, figures: Path) -> str:
    """Section on a locked clock; writes its figure. Empty without a lock."""
    if lock is None:
        return ""
    path = figures / "phase.png"
    data = _figure(lock, path)
    return (
        "<h2>Phase of the clocks</h2><p>The board that makes the camera's ticks lengthens and "
        "shortens them by counts of its master clock, so that the panel's planes begin with them. "
        f"The loop locked within {count(lock.acquired)} ticks before the recording, from the phase "
        "that chance or the scenario gave. Over the recording the true phase, which the loop does "
        f"not know, was {number(lock.rms, 2)} ticks rms and at most {number(lock.most, 2)}. The "
        "loop's spikes are those of a model of a strip of the "
        "panel.</p>"
        + plot(path, "phase of the panel's planes over the run: true and measured", data)
    )
