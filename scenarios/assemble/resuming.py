"""What --resume finds in a folder: the same run, complete or not, or another run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from cosim import InputError
from cosim.run.inputs import changed_files
from cosim.run.result import Result, read_result
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.scenario import AnyScenario, BoardScenario, Scenario

__all__ = ["done_before", "verdict_before"]

_TOLD = 3
"""Keys that differ which a refusal names."""


def done_before(name: str, scenario: AnyScenario, out: Path) -> Result | None:
    """The result that the folder holds of this very scenario; None where the run is still to be
    done or to be gone on with. A board's is always: it may have changed since.

    Nothing is written. The title decides nothing of a result and may differ. Raises InputError
    where the folder holds another scenario, the same one with other values, one that is done of a
    file whose content has changed since, or the result of another version that cannot be read.
    """
    held_in = out / "scenario.toml"
    try:
        if not held_in.is_file():
            return None
    except OSError:  # a name too long, which making the folder will say
        return None
    try:
        _, held = load(str(held_in))
    except InputError as exc:
        raise InputError(
            "--resume", "given with a run's folder", f"{out}, whose scenario cannot be read: {exc}",
            "give another --out",
        ) from exc  # fmt: skip
    result = read_result(out)
    differ = _differences(_values(held), _values(scenario))
    if differ:
        there, here = (_told(differ, n) if type(held) is type(scenario) else "" for n in (0, 1))
        held_name = repr(held.title) if result is None else result.scenario
        raise InputError(
            "--resume", f"given for the run that {out} holds ({held_name}{there})",
            f"for {name}{here}", "give another --out",
        )  # fmt: skip
    if result is None or isinstance(scenario, BoardScenario):
        return None
    for key, path in changed_files(held_in.read_text(encoding="utf-8")):
        raise InputError(
            "--resume", f"given for the {key} that {out} was made of",
            f"for {path}, which has changed since", "give another --out",
        )  # fmt: skip
    return result


def _told(differ: list[tuple[str, tuple[Any, Any]]], n: int) -> str:
    """The first keys that differ with one side's values."""
    values = ((key, pair[n]) for key, pair in differ[:_TOLD])
    return ": " + ", ".join(f"{k} {'absent' if v is None else repr(v)}" for k, v in values)


def verdict_before(folder: Path) -> list[str]:
    """The verdict of a link's completed run; nothing for another kind of run."""
    try:
        verdict = json.loads((folder / "verdict.json").read_text(encoding="utf-8"))
        return [f"{verdict['said']}: {verdict['told']}"]
    except (OSError, ValueError, TypeError, KeyError):
        return []


def _values(scenario: AnyScenario) -> dict[str, Any]:
    """Every key with its value; sections that a run writes out are there."""
    if isinstance(scenario, Scenario):
        from scenarios.assemble import asynchronous, continuous

        written = {"asynchronous": asynchronous.with_defaults,
                   "continuous": continuous.with_defaults}  # fmt: skip
        whole = written.get(scenario.sensor.readout)
        scenario = scenario if whole is None else whole(scenario)
    return _flat(scenario.model_dump(mode="json", exclude_none=True, exclude={"title"}), "")


def _flat(node: dict[str, Any], prefix: str) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in node.items():
        flat |= (
            _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key: value}
        )
    return flat


def _differences(there: dict[str, Any], here: dict[str, Any]) -> list[tuple[str, tuple[Any, Any]]]:
    """Keys whose values differ, with both (None where absent), the kind of scene first."""
    keys = sorted({*there, *here}, key=lambda key: (not key.endswith(".kind"), key))
    both = [(key, (there.get(key), here.get(key))) for key in keys]
    return [row for row in both if row[1][0] != row[1][1]]
