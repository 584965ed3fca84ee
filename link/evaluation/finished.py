"""What a run of a link leaves in memory for its report."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.run.result import Result
from link.evaluation.errors import Errors
from link.evaluation.eye import Eye
from link.evaluation.rates import Rates
from link.evaluation.reach import CellScene, Reach
from link.layout import Layout
from link.mode import Mode
from link.section import LinkScenario
from link.setting import LinkSetting, Payload
from link.trial.check import LinkCheck
from link.verdict import Verdict

__all__ = ["LinkRun", "SoftValues", "Theory"]


@dataclass(frozen=True, eq=False)
class SoftValues:
    """A sample of soft values, ln P(spikes | on) - ln P(spikes | off), with what was sent: both
    (n,)."""

    soft: npt.NDArray[np.float32]
    on: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Theory:
    """Raw bit error rates beside the measured one. soft: what the soft values themselves promise,
    the mean of 1/(1 + e^|L|) over all of them. closed: an estimate from geometry, light and
    threshold (`cell_errors`), closed_interval the 99.9 % limits of what it draws; without them it
    is the coarse one of `reach.predict_errors`: no hard reset, or nothing received. None where no
    closed form has what stood in the way, or where it underflows. interval: of the measured rate,
    99.9 %."""

    soft: float | None
    closed: float | None
    interval: tuple[float, float] | None
    closed_interval: tuple[float, float] | None = None


@dataclass
class LinkRun:
    """mode, layout: those sent with. received: of `link.receiving`. delivered: whether the bytes in
    received/ are those that were sent. image: spikes a cycle of every camera pixel over the light's
    time, (H, W). outline: camera (x, y) of the panel's corners as the receiver found them, (4, 2),
    None where it did not; truth: the same as they are. delays: ps of every verified group.
    capacity: bits a second, None where the panel is not wholly in view. choice: of the mode, None
    where it was given. check: of the plan, in the unit of the run's own bits."""

    result: Result
    scenario: LinkScenario
    folder: Path
    setting: LinkSetting
    payload: Payload
    mode: Mode
    layout: Layout
    verdict: Verdict
    delivered: bool
    received: Any
    errors: Errors
    theory: Theory
    rates: Rates
    eye: Eye | None
    soft: SoftValues | None
    image: npt.NDArray[np.float32]
    outline: npt.NDArray[np.float64] | None
    truth: npt.NDArray[np.float64]
    delays: npt.NDArray[np.int64]
    scene: CellScene
    reach: list[Reach]
    capacity: float | None
    seconds: dict[str, float]
    began: float
    check: LinkCheck
    choice: Any = None
    notes: list[str] = field(default_factory=list)

    def verdict_document(self) -> dict[str, Any]:
        """What verdict.json says."""
        return {
            "cause": self.verdict.cause.name.lower(), "said": self.verdict.cause.value,
            "told": self.verdict.told, "delivered": self.delivered, "file": self.payload.name,
            "bytes": len(self.payload.data), "mode": asdict(self.mode),
        }  # fmt: skip
