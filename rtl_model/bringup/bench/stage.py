"""What a stage of the bring-up finds, and how it says what is wrong."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from cosim import ViformError

__all__ = ["STAGES", "Figures", "Outcome", "Report", "Stage", "StageFault"]

STAGES = (
    "port", "bytes", "identity", "counters", "registers", "prbs", "patterns", "threshold", "timing",
)  # fmt: skip
"""In the order in which they run: each needs those before it."""

Outcome: TypeAlias = Literal["ok", "failed", "left out"]
Figures: TypeAlias = dict[str, Any]
"""Name to number, text or a list of those: what JSON can say."""


class StageFault(ViformError):
    """A stage's check failed.

    kind: a short name of the cause for programs; text: what was seen, where; mend: what to do
    about it; figures: those found until then.
    """

    def __init__(self, kind: str, text: str, mend: str, figures: Figures | None = None) -> None:
        self.kind, self.text, self.mend = kind, text, mend
        self.figures: Figures = figures or {}
        super().__init__(kind, text, mend, figures)

    def __str__(self) -> str:
        return f"{self.text}; {self.mend}"


@dataclass(frozen=True)
class Stage:
    """One stage: `cause` is a sentence with its mend, `kind` its short name; both None where the
    outcome is ok. `seconds` by the port's clock."""

    name: str
    outcome: Outcome
    cause: str | None
    figures: Figures
    seconds: float
    kind: str | None = None

    def document(self) -> dict[str, Any]:
        """The stage as JSON says it."""
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
    """All stages of one bring-up, in order; those after a failed one may be left out. `board`: what
    it said of itself; `bursts`: captured planes beside the expected, in order of capture."""

    port: str
    baud: int
    simulated: bool
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
        return all(stage.outcome == "ok" for stage in self.stages) and len(self.stages) == len(
            STAGES
        )

    @property
    def failed_stage(self) -> str | None:
        """Its name."""
        return None if self.failed is None else self.failed.name

    @property
    def cause(self) -> str | None:
        """Its cause, a sentence."""
        return None if self.failed is None else self.failed.cause

    def figure(self, stage: str, name: str) -> Any:
        """One figure of a stage, None where it is not known."""
        return next((s.figures.get(name) for s in self.stages if s.name == stage), None)

    def document(self) -> dict[str, Any]:
        """The report as JSON says it."""
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
