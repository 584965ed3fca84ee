"""Records of the bring-up: stages, their faults, and the report."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from cosim import ViformError

STAGES = (
    "port", "bytes", "identity", "counters", "registers", "prbs", "patterns", "threshold", "timing",
)  # fmt: skip
"""Stages over a serial line, in the order in which they run. Each depends on those before it."""

UDP_STAGES = (
    "port", "link", "identity", "loss", "mtu", "registers", "prbs", "patterns", "threshold",
    "timing", "rate",
)  # fmt: skip
"""Stages over UDP."""

Outcome: TypeAlias = Literal["ok", "failed", "left out"]
Figures: TypeAlias = dict[str, Any]
"""Figures of a stage by name: numbers, texts or lists of these, as JSON allows."""


class StageFault(ViformError):
    """A stage's check failed.

    Attributes:
        kind: short name of the cause, for programs.
        text: what was observed, and where.
        remedy: what to check or repair.
        figures: measured before the failure.
    """

    def __init__(self, kind: str, text: str, remedy: str, figures: Figures | None = None) -> None:
        self.kind, self.text, self.remedy = kind, text, remedy
        self.figures: Figures = figures or {}
        super().__init__(kind, text, remedy, figures)

    def __str__(self) -> str:
        return f"{self.text}; {self.remedy}"


@dataclass(frozen=True)
class Stage:
    """The result of one stage, whether it ran or was left out.

    Attributes:
        name: one of `STAGES` or `UDP_STAGES`.
        outcome: outcome of the stage's check.
        cause: sentence with what to repair; None if the outcome is ok.
        figures: measured by the stage.
        seconds: duration by the port's clock, s.
        kind: short name of the cause, for programs; None if the outcome is ok.
    """

    name: str
    outcome: Outcome
    cause: str | None
    figures: Figures
    seconds: float
    kind: str | None = None

    def document(self) -> dict[str, Any]:
        """The stage's part of the document."""
        return {
            "name": self.name,
            "outcome": self.outcome,
            "kind": self.kind,
            "cause": self.cause,
            "figures": self.figures,
            "seconds": self.seconds,
        }


@dataclass
class Report:
    """All stages of a bring-up.

    Attributes:
        port: name of the port.
        baud: baud of the line; None over UDP.
        simulated: whether there is no real clock behind the port.
        names: names of all stages, in order.
        stages: stages in order; those after a failed one may be left out.
        board: figures of the identity stage, None if it did not pass.
        bursts: captured and expected planes, in order of capture.
        wall_s: wall time of the bring-up, s.
    """

    port: str
    baud: int | None
    simulated: bool
    names: tuple[str, ...] = STAGES
    stages: list[Stage] = field(default_factory=list)
    board: dict[str, Any] | None = None
    bursts: list[Any] = field(default_factory=list)
    wall_s: float = 0.0

    @property
    def failed(self) -> Stage | None:
        """The first stage that failed."""
        return next((stage for stage in self.stages if stage.outcome == "failed"), None)

    @property
    def ok(self) -> bool:
        """Whether every stage ran and passed."""
        passed = [stage.name for stage in self.stages if stage.outcome == "ok"]
        return tuple(passed) == self.names == tuple(stage.name for stage in self.stages)

    @property
    def failed_stage(self) -> str | None:
        """Name of the first stage that failed."""
        return None if self.failed is None else self.failed.name

    @property
    def cause(self) -> str | None:
        """Cause of the first failure, one sentence."""
        return None if self.failed is None else self.failed.cause

    def figure(self, stage: str, name: str) -> Any:
        """One figure of a stage, None if the stage has not measured it."""
        return next((s.figures.get(name) for s in self.stages if s.name == stage), None)

    def document(self) -> dict[str, Any]:
        """The document of `viform board bringup --json`."""
        return {
            "ok": self.ok,
            "port": self.port,
            "baud": self.baud,
            "simulated": self.simulated,
            "board": self.board,
            "failed_stage": self.failed_stage,
            "cause": self.cause,
            "kind": None if self.failed is None else self.failed.kind,
            "stages": [stage.document() for stage in self.stages],
            "wall_s": self.wall_s,
        }
