"""Decides for --resume whether a folder holds the same run, complete or not, or another run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from cosim import InputError
from cosim.config.toml import read_text
from cosim.run.inputs import changed_files
from cosim.run.result import Result, read_result
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.scenario import AnyScenario, BoardScenario, Scenario

_LISTED = 3
"""Maximum number of differing keys in an error message."""


def done_before(name: str, scenario: AnyScenario, out: Path) -> Result | None:
    """The result of this scenario in the folder `out`; None if the run has not ended.

    A run with a board is always repeated, because the board may have changed. Nothing is written.
    The title does not affect a result and may differ.

    Args:
        name: short name of the scenario, for messages.
        scenario: the scenario that shall be run.
        out: folder of the run.

    Raises:
        InputError: the folder holds another scenario, the same scenario with other values, a
            completed run of an input file that has changed since, or a result of another version
            that cannot be read.
    """
    stored_in = out / "scenario.toml"
    try:
        if not stored_in.is_file():
            return None
    except OSError:  # the name is too long: creating the folder raises the error for the user
        return None
    try:
        _, stored = load(str(stored_in))
    except InputError as exc:
        raise InputError(
            "--resume", "given with a run's folder", f"{out}, whose scenario cannot be read: {exc}",
            "give another --out",
        ) from exc  # fmt: skip
    result = read_result(out)
    differ = _differences(_values(stored), _values(scenario))
    if differ:
        there, here = (
            _listing(differ, n) if type(stored) is type(scenario) else "" for n in (0, 1)
        )
        stored_name = repr(stored.title) if result is None else result.scenario
        raise InputError(
            "--resume", f"given for the run that {out} holds ({stored_name}{there})",
            f"for {name}{here}", "give another --out",
        )  # fmt: skip
    if result is None or isinstance(scenario, BoardScenario):
        return None
    for key, path in changed_files(read_text(stored_in)):
        raise InputError(
            "--resume", f"given for the {key} that {out} was computed from",
            f"for {path}, which has changed since", "give another --out",
        )  # fmt: skip
    return result


def _listing(differ: list[tuple[str, tuple[Any, Any]]], n: int) -> str:
    """The first differing keys with the values of side `n`, as text."""
    values = ((key, pair[n]) for key, pair in differ[:_LISTED])
    return ": " + ", ".join(f"{k} {'absent' if v is None else repr(v)}" for k, v in values)


def verdict_before(folder: Path) -> list[str]:
    """The verdict of the completed run of a link; [] for another kind of run."""
    try:
        verdict = json.loads((folder / "verdict.json").read_text(encoding="utf-8"))
        return [f"{verdict['said']}: {verdict['told']}"]
    except (OSError, ValueError, TypeError, KeyError):
        return []


def _values(scenario: AnyScenario) -> dict[str, Any]:
    """Every key with its value, with the sections that a run writes out."""
    if isinstance(scenario, Scenario):
        from scenarios.assemble.source import asynchronous, continuous

        written = {"asynchronous": asynchronous.with_defaults,
                   "continuous": continuous.with_defaults}  # fmt: skip
        whole = written.get(scenario.sensor.pixel)
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
    """Keys whose values differ, with both values (None if absent); the kind of scene is first."""
    keys = sorted({*there, *here}, key=lambda key: (not key.endswith(".kind"), key))
    both = [(key, (there.get(key), here.get(key))) for key in keys]
    return [row for row in both if row[1][0] != row[1][1]]
