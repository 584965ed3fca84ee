"""Loads a scenario by its name or file, applies --set, and checks it."""

from __future__ import annotations

import copy
import json
import os
import re
import shlex
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from cosim import InputError
from cosim.config.toml import read_text
from cosim.errors import one_line, quote, shorten
from cosim.run.inputs import PATHS, named_path, with_path
from scenarios.assemble.schema.messages import validate
from scenarios.assemble.schema.scenario import (
    AnyScenario,
    ImagerScenario,
    LinkScenario,
    Scenario,
    kind_of,
)
from scenarios.scenes.catalogue import scene_keys

FRONT = "glass"
"""The scenario that runs by default."""
_PARTS = 20
"""Maximum number of parts of a dotted key; the longest one of the schema has four."""
_DEEP = re.compile(rf"""(?:^|[\[{{,])\s*(?:[\w"'-]+\s*\.\s*){{{_PARTS}}}""", re.MULTILINE)
_PIXELS = {"synchronous": "latched"}
"""Kinds of pixel by their former names."""
_EITHER = (("imager.gain", "imager.gain_step"), ("imager.pulses", "imager.pulse_rate"))
"""Pairs of keys that exclude each other."""


def shipped() -> dict[str, str]:
    """The text of every scenario of the package, by name; the default scenario is first."""
    folder = files("scenarios") / "files"
    return {
        entry.name.removesuffix(".toml"): entry.read_text(encoding="utf-8")
        for entry in sorted(folder.iterdir(), key=lambda e: (e.name != f"{FRONT}.toml", e.name))
        if entry.name.endswith(".toml")
    }


def _read(name: str) -> tuple[str, dict[str, Any], Path | None]:
    """Short name, data, and the folder to which its paths are relative (None for the working
    directory)."""
    known = shipped()
    if name in known:
        return name, tomllib.loads(known[name]), None
    path = Path(name)
    try:
        if path.is_dir() and (path / "scenario.toml").is_file():
            path = path / "scenario.toml"
        exists = path.is_file()
    except OSError:  # the name is too long
        exists = False
    if not exists:
        raise InputError(
            "the scenario",
            f"one of {', '.join(known)} or a TOML file",
            quote(name),
            "see `viform list`",
        )
    try:
        text = read_text(path)
        if _DEEP.search(text):  # tomllib takes seconds for a key of thousands of parts
            raise ValueError(f"a key of more than {_PARTS} parts")
        data = tomllib.loads(text)
    except (OSError, ValueError, RecursionError) as exc:  # numbers too long are plain ValueErrors
        if isinstance(exc, UnicodeDecodeError) and path.suffix.lower() != ".toml":
            raise InputError(
                "the scenario", "a TOML file", f"{path}, which is not text",
                f"film a clip with `viform run film --set scene.path={shlex.quote(name)}`",
            ) from exc  # fmt: skip
        raise InputError(
            "the scenario", "a TOML file", f"{path} ({shorten(str(exc))})", "correct that place"
        ) from exc
    stem = path.parent.name if path.name == "scenario.toml" else path.stem
    return one_line(stem) or "scenario", data, path.parent  # it is printed, and names files


def _value(text: str) -> Any:
    """The value of --set: a list is read as JSON; other text is converted by the schema."""
    if text.startswith("["):
        try:
            return json.loads(text)
        except (ValueError, RecursionError):
            return text
    return text


def _in_current_names(data: dict[str, Any]) -> dict[str, Any]:
    """The data of a scenario with `pixel` in place of `readout`, its former name, in each [sensor]:
    files and commands of before are read as before."""
    sections = (data, data.get("link"), data.get("camera"))
    for section in sections:
        sensor = section.get("sensor") if isinstance(section, dict) else None
        if isinstance(sensor, dict) and "readout" in sensor and "pixel" not in sensor:
            kind = sensor.pop("readout")
            sensor["pixel"] = _PIXELS.get(kind, kind) if isinstance(kind, str) else kind
    return data


def assign(data: dict[str, Any], assignment: str) -> None:
    """Applies one assignment a.b=c to `data`; creates absent sections. Raises InputError for text
    of another form."""
    key, equals, text = assignment.partition("=")
    names = key.strip().split(".")
    if not equals or not all(names):
        raise InputError(
            "--set", "KEY=VALUE such as sensor.clock='20 kHz'", quote(assignment), "add it"
        )
    node = data
    for i, name in enumerate(names[:-1]):
        inner = node.setdefault(name, {})
        if not isinstance(inner, dict):
            where = ".".join(names[: i + 1])
            raise InputError(
                f"--set {key}",
                f"a key of a section, which {where} is",
                "below a value",
                f"set {where} itself",
            )
        node = inner
    if names[-2:] == ["sensor", "readout"]:
        names[-1], text = "pixel", _PIXELS.get(text, text)
    node[names[-1]] = _value(text)


def _remove_conflicts(data: dict[str, Any], assignments: list[str]) -> None:
    """Removes keys of the scenario's file that conflict with --set: the other key of an exclusive
    pair, and, if --set selects another kind of scene, the keys that this kind does not have."""
    values = {text.partition("=")[0].strip(): text.partition("=")[2] for text in assignments}
    for pair in _EITHER:
        for key, other in (pair, pair[::-1]):
            section, _, name = other.partition(".")
            inner = data.get(section)
            if key in values and other not in values and isinstance(inner, dict):
                inner.pop(name, None)
    scene, kind = data.get("scene"), values.get("scene.kind")
    keys = scene_keys(kind) if kind is not None else None
    if isinstance(scene, dict) and keys is not None and scene.get("kind") != kind:
        data["scene"] = {key: value for key, value in scene.items() if key in keys}


def _absolute(scenario: AnyScenario) -> AnyScenario:
    """The scenario with absolute paths of its input files."""
    for section, key in PATHS:
        inner = getattr(scenario, section, None)
        value = getattr(inner, key, None)
        path = None if value is None else named_path(section, key, value)
        if inner is None or value is None or path is None:
            continue
        if not path:
            raise InputError(
                f"{section}.{key}", "the name of a file", repr(value), "write the name"
            )
        try:
            place = str(Path(path).resolve())
            place.encode()  # it is written into the run's scenario.toml
        except (OSError, ValueError) as exc:  # a NUL, circular links, bytes other than UTF-8
            raise InputError(
                f"{section}.{key}", "the name of a file", f"{path!r} ({exc})", "check it"
            ) from exc
        named = inner.model_copy(update={key: with_path(section, key, value, place)})
        scenario = scenario.model_copy(update={section: named})
    return scenario


def load(
    name: str,
    assignments: list[str] | None = None,
    *,
    tolerance: float | None = None,
    seed: int | None = None,
    draws: str | None = None,
    sections: dict[str, Any] | None = None,
) -> tuple[str, AnyScenario]:
    """Loads and checks a scenario.

    Relative paths in `--set` are relative to the working directory; those of a TOML file, to the
    file. The returned scenario holds absolute paths.

    Args:
        name: name of a scenario of the package, a TOML file, or the folder of a run.
        assignments: values of --set, such as "sensor.clock=20 kHz".
        tolerance, seed, draws: replace the keys of the same name; None keeps them.
        sections: data of whole sections, which replace those of the scenario before `--set`.

    Returns:
        The short name and the scenario.

    Raises:
        InputError: the scenario does not exist, cannot be read, or has an invalid key.
    """
    short, data, folder = _read(name)
    data = _in_current_names(data)
    for section, key in PATHS if folder is not None else ():
        inner = data.get(section)
        value = inner.get(key) if isinstance(inner, dict) else None
        if not isinstance(inner, dict) or not isinstance(value, str) or folder is None:
            continue
        path = named_path(section, key, value)
        if path:
            inner[key] = with_path(section, key, value, str(folder / path))
    data |= _in_current_names(copy.deepcopy(sections or {}))
    _remove_conflicts(data, assignments or [])
    for assignment in assignments or []:
        assign(data, assignment)
    given = {"tolerance": tolerance, "seed": seed, "draws": draws}
    data |= {key: value for key, value in given.items() if value is not None}
    return short, _absolute(validate(data))


def filmed(scenario: AnyScenario, command: str) -> Scenario:
    """The scenario, for a command that needs a spike camera and a scene. Raises InputError for
    another kind of scenario."""
    if not isinstance(scenario, Scenario):
        raise InputError(
            "the scenario", f"one with a [scene] for `viform {command}`"
            if not isinstance(scenario, ImagerScenario)
            else f"one of a spike camera for `viform {command}`",
            f"one of {kind_of(scenario).words}", "see `viform list`",
        )  # fmt: skip
    return scenario


def linked(scenario: AnyScenario, command: str) -> LinkScenario:
    """The scenario, for a command that needs a link. Raises InputError for another kind of
    scenario."""
    if not isinstance(scenario, LinkScenario):
        scene = isinstance(scenario, Scenario)
        other = "one with a [scene]" if scene else f"one of {kind_of(scenario).words}"
        raise InputError(
            "the scenario", f"one with a [link] for `viform {command}`", other,
            "name light-link, or a file with a [link]",
        )  # fmt: skip
    return scenario


def assignments_of(settings: Mapping[str, Any]) -> list[str]:
    """Settings as the command line has them. One that is None is not given; a dictionary is a
    section. Raises InputError for a value of another kind."""
    out = []
    for key, value in settings.items():
        if isinstance(value, Mapping) and value:
            out += assignments_of({f"{key}.{name}": inner for name, inner in value.items()})
        elif value is not None:
            out.append(f"{key}={_text(key, value)}")
    return out


def _text(key: str, value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple, np.ndarray)):
        return json.dumps(np.asarray(value).tolist())
    if isinstance(value, (str, int, float, np.integer, np.floating, os.PathLike)):
        return str(value)
    given = "an empty dictionary" if isinstance(value, Mapping) else type(value).__name__
    raise InputError(key, "a text, number, path, list or dictionary of keys", given, "convert it")
