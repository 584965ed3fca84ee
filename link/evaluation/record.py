"""The evaluation of a run, as metrics and report read it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.run.result import Latency
from link.evaluation.errors import Errors
from link.evaluation.eye import Eye
from link.layout import Layout
from link.mode import Mode
from link.plan.check import LinkCheck, left_out_documents
from link.plan.planned import PlannedLink
from link.prediction.error_bound import CellScene
from link.prediction.rates import Rates
from link.receiving import Received
from link.section import LinkScenario
from link.setting import LinkSetting
from link.setup.distances import RateAt
from link.setup.setup import FileLinkSetup
from link.theory.soft_information import SoftInformation, soft_information
from link.verdict import Verdict


@dataclass(frozen=True, eq=False)
class SoftValues:
    """A sample of soft values with what was sent.

    Attributes:
        soft: (n,) ln P(spikes | on) - ln P(spikes | off).
        on: (n,) bits that were sent.
    """

    soft: npt.NDArray[np.float32]
    on: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Theory:
    """Predictions of the raw bit error rate, and the interval of the measured one.

    Attributes:
        soft: error rate according to the soft values, the mean of 1/(1 + e^|L|) over all of them.
        closed: estimate from geometry, light and threshold; None if no closed form models the cause
            of failure, or if it underflows.
        interval: interval of the measured rate, 99.9 %.
        closed_interval: 99.9 % limits of the draws of `cell_errors` or `chain_errors`; None for the
            coarse estimate of `predict_errors`, which is used without a hard reset, or if nothing
            was received.
    """

    soft: float | None
    closed: float | None
    interval: tuple[float, float] | None
    closed_interval: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class LinkEvaluation:
    """A run that was received and compared with what was sent.

    Attributes:
        setup: the link and its file.
        link: its plan.
        check: check of the plan, in units of the run's own bits.
        verdict: cause of failure.
        delivered: whether the bytes received are those that were sent.
        received: result of the receiver.
        errors, theory, rates: errors, theory and rates of the transmission.
        eye, soft: eye diagram and soft values; None if the receiver has read no symbol in the sent
            mode.
        image: (H, W) float32, spikes a cycle of every camera pixel, mean over the time of the
            light.
        outline: (4, 2) camera (x, y) of the panel's corners as the receiver estimated them, or
            None.
        truth: (4, 2) their true positions.
        delays: (groups,) int64 ps, from the light of a verified group to its verification.
        latency: latency of the stages.
        scene: light of the cells.
        capacity: bit/s, None if the panel is not wholly in view.
        over_distance: predicted rates at this and other distances, empty if the mode was given.
    """

    setup: FileLinkSetup
    link: PlannedLink
    check: LinkCheck
    verdict: Verdict
    delivered: bool
    received: Received
    errors: Errors
    theory: Theory
    rates: Rates
    eye: Eye | None
    soft: SoftValues | None
    image: npt.NDArray[np.float32]
    outline: npt.NDArray[np.float64] | None
    truth: npt.NDArray[np.float64]
    delays: npt.NDArray[np.int64]
    latency: list[Latency]
    scene: CellScene
    capacity: float | None
    over_distance: list[RateAt] = field(default_factory=list)

    @cached_property
    def information(self) -> SoftInformation | None:
        """Information of a bit with its soft value; None if no symbol was read."""
        return None if self.soft is None else soft_information(self.soft.soft, self.soft.on)

    @property
    def information_bps(self) -> tuple[float | None, float | None, float | None]:
        """Information of all data cells, bit/s, and the ends of its interval."""
        found, raw = self.information, self.rates.raw
        if found is None:
            return None, None, None
        return raw * found.bits, raw * found.low, raw * found.high

    @property
    def scenario(self) -> LinkScenario:
        return self.setup.scenario

    @property
    def setting(self) -> LinkSetting:
        return self.setup.setting

    @property
    def mode(self) -> Mode:
        """The mode of the transmission."""
        return self.setup.mode

    @property
    def layout(self) -> Layout:
        return self.setup.sent.layout

    @property
    def left_out(self) -> list[dict[str, Any]]:
        """Rows of `result.json` for the effects that were left out."""
        return left_out_documents(self.link.plan, self.check)

    @property
    def verdict_line(self) -> str:
        return f"{self.verdict.cause.value}: {self.verdict.text}"

    def verdict_document(self) -> dict[str, Any]:
        """Content of verdict.json."""
        return {
            "cause": self.verdict.cause.name.lower(), "said": self.verdict.cause.value,
            "told": self.verdict.text, "delivered": self.delivered,
            "file": self.setup.payload.name, "bytes": len(self.setup.payload.data),
            "mode": self.setup.mode_document(),
        }  # fmt: skip
