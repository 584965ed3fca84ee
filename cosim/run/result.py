"""The result of a run: the document `result.json` for programs."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import number
from cosim.errors import InputError
from cosim.files.atomic import atomic_write
from cosim.plan.error import Law, Of

_ESCAPED: Final = re.compile(r"[\x7f-\x9f\ud800-\udfff]")
NO_REASON: Final = "this run gives no finite value of it"
"""The reason of a figure that states none."""


def viform_version() -> str:
    """The installed version."""
    return version("viform")


def _clean(value: Any) -> Any:
    """The value with NaN and infinite numbers replaced by None."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _clean(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_clean(inner) for inner in value]
    return value


def dumps(document: Any) -> str:
    """A JSON document with an indent of two spaces. What is not a character of UTF-8, as in the
    name of a file in another encoding, or commands a terminal becomes an escape."""
    text = json.dumps(_clean(document), indent=2, ensure_ascii=False, allow_nan=False)
    return _ESCAPED.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


@dataclass(frozen=True)
class Metric:
    """A figure with its unit ("1" for a plain number).

    Attributes:
        value: the figure, None if there is none.
        unit: its unit.
        reason: why there is none; it says nothing about a figure that is there.
    """

    value: float | None
    unit: str
    reason: str | None = field(default=None, compare=False)

    def document(self) -> dict[str, Any]:
        """The fields of the JSON document: a figure has no reason, and none has one."""
        given = {"value": _clean(self.value), "unit": self.unit}
        if given["value"] is None:
            given["reason"] = self.reason or NO_REASON
        return given


@dataclass(frozen=True)
class Error:
    """Error of the simulation against full physics.

    Attributes:
        value: relative error, None if unknown.
        kind: quantity, and the method by which it is known.
        ci: (low, high) limits at 99.9 %. `high` holds for all tiles together, where an error is one
            of tiles.
        tiles_checked: number of tiles in which pixels were measured, None if there are no tiles.
        tiles_over: number of them whose error is proven to be above the tolerance.
        of: "run" if both simulations have the same random words and were compared spike by spike,
            "law" if this one has other draws of the same noise.
        law: the distributions of an error in law; None for one of the run.
    """

    value: float | None
    kind: str | None
    ci: tuple[float, float] | None
    tiles_checked: int | None = None
    tiles_over: int | None = None
    of: Of = "run"
    law: Law | None = None


@dataclass(frozen=True)
class Latency:
    """Time in the simulated machine, microseconds."""

    stage: str
    min_us: float
    median_us: float
    max_us: float


def latency_rows(stage: str, times: npt.NDArray[np.int64]) -> list[Latency]:
    """A row with minimum, median and maximum of times (ps); [] if there are no times."""
    if not times.size:
        return []
    least, median, largest = (
        float(ps) / 1e6 for ps in (times.min(), np.median(times), times.max())
    )
    return [Latency(stage, least, median, largest)]


@dataclass(frozen=True)
class Throughput:
    """Speed of a stage of the simulation."""

    stage: str
    value: float
    unit: str


@dataclass
class Result:
    """The result of a run; see docs/result.md. `error` is null if unknown."""

    scenario: str
    outcome: str
    seed: int
    device: str
    simulated_s: float
    tolerance: float
    version: str = field(default_factory=viform_version)
    renderer: str | None = None
    run_time_s: float | None = None
    error: Error = Error(None, None, None)
    kept: list[str] = field(default_factory=list)
    left_out: list[dict[str, Any]] = field(default_factory=list)
    metrics: dict[str, Metric] = field(default_factory=dict)
    latency: list[Latency] = field(default_factory=list)
    throughput: list[Throughput] = field(default_factory=list)
    files: list[str] = field(default_factory=list)

    def _error(self) -> dict[str, Any]:
        """The error in its documented order, in which the tolerance precedes the tiles. An unknown
        error is of nothing."""
        error = self.error
        return {
            "value": error.value, "kind": error.kind, "ci": error.ci, "tolerance": self.tolerance,
            "tiles_checked": error.tiles_checked, "tiles_over": error.tiles_over,
            "of": None if error.value is None else error.of,
            "law": None if error.law is None else error.law.document(),
        }  # fmt: skip

    def document(self) -> dict[str, Any]:
        """The fields of the JSON document, in their documented order."""
        return {
            "scenario": self.scenario,
            "outcome": self.outcome,
            "seed": self.seed,
            "version": self.version,
            "device": self.device,
            "renderer": self.renderer,
            "simulated_s": self.simulated_s,
            "run_time_s": self.run_time_s,
            "error": self._error(),
            "plan": {"kept": self.kept, "left_out": self.left_out},
            "metrics": {name: metric.document() for name, metric in self.metrics.items()},
            "latency": [asdict(row) for row in self.latency],
            "throughput": [asdict(row) for row in self.throughput],
            "files": self.files,
        }


def measured_text(row: dict[str, Any]) -> str:
    """What was measured of an effect that was left out, for people: its error, with the limits
    where the row has them, and whether they can tell that it is within its bound."""
    if row["measured"] is None:
        return "not measured"
    text = "no change found" if row["measured"] == 0 else f"{number(row['measured'], 2)} measured"
    if row.get("ci") is None:
        return text
    low, high = row["ci"]
    text += f", {number(low, 2)} to {number(high, 2)} (99.9 %)"
    if low > row["bound"]:
        return f"{text}: above the bound"
    return f"{text}: too few trials to tell whether it holds" if high > row["bound"] else text


def write_result(folder: Path, result: Result) -> None:
    """Writes result.json. It is written last, so a folder with this file is complete."""
    with atomic_write(folder / "result.json") as part:
        part.write_text(dumps(result.document()) + "\n", encoding="utf-8")


def read_result(folder: Path) -> Result | None:
    """The result in a folder; None if there is none, or if it is damaged. Raises InputError for a
    result with other fields, such as another version may write."""
    try:
        document = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    try:
        error, plan = dict(document.pop("error")), document.pop("plan")
        tolerance, ci = (error.pop(key) for key in ("tolerance", "ci"))
        law = error.pop("law", None)  # results of earlier versions have no law
        of: Of = error.pop("of", None) or "run"
        metrics = {name: Metric(**metric) for name, metric in document.pop("metrics").items()}
        latency = [Latency(**row) for row in document.pop("latency")]
        throughput = [Throughput(**row) for row in document.pop("throughput")]
        return Result(
            **document, tolerance=tolerance,
            error=Error(
                **error, ci=None if ci is None else tuple(ci), of=of,
                law=None if law is None else Law.of(law),
            ),
            kept=plan["kept"], left_out=plan["left_out"], metrics=metrics, latency=latency,
            throughput=throughput,
        )  # fmt: skip
    except (ValueError, TypeError, KeyError, AttributeError) as exc:
        raise InputError(
            f"{folder / 'result.json'}", "one that this version writes", "one with other fields",
            "remove it to run again here, or give another --out",
        ) from exc  # fmt: skip
