"""The files that a scenario names, identified by digests of their content."""

from __future__ import annotations

import hashlib
import re
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Final

PATHS: Final = (
    ("scene", "path"), ("link", "file"), ("board", "csr"), ("sensor", "source"),
    ("sensor", "preset"),
)  # fmt: skip
"""Sections and keys that may name a file."""
FILE: Final = "file:"
"""Beginning of a `sensor.source` that names a file."""
PIPE: Final = "pipe:"
"""Beginning of a `sensor.source` that names a pipe."""
STANDARD_INPUT: Final = "-"
"""The pipe that every process has."""
_SEAL: Final = re.compile(r"# (\w+)\.(\w+): sha256 ([0-9a-f]{64})")


def named_path(section: str, key: str, value: str) -> str | None:
    """The path that a value of `PATHS` names; None for a source or a preset that is no file."""
    if (section, key) == ("sensor", "preset"):
        return value if value.endswith(".toml") else None
    if (section, key) != ("sensor", "source"):
        return value
    kind = next((each for each in (FILE, PIPE) if value.startswith(each)), None)
    path = None if kind is None else value.removeprefix(kind)
    return None if kind == PIPE and path == STANDARD_INPUT else path


def with_path(section: str, key: str, value: str, path: str) -> str:
    """The value of a key of `PATHS` with another path in the place of its own."""
    if (section, key) != ("sensor", "source"):
        return path
    return (PIPE if value.startswith(PIPE) else FILE) + path


def digest(path: str | Path) -> str | None:
    """SHA-256 of a file in hexadecimal, or of the names and contents of the files of a folder; None
    if it cannot be read."""
    try:
        where = Path(path)
        if not where.is_dir():
            return _of_file(where)
        files = sorted(file for file in where.iterdir() if file.is_file() and file.name[0] != ".")
        parts = "".join(f"{file.name}\0{_of_file(file)}\n" for file in files)
        return hashlib.sha256(parts.encode("utf-8", "surrogateescape")).hexdigest()
    except (OSError, ValueError):
        return None


def _of_file(path: Path) -> str | None:
    status = path.stat()
    return _digest(str(path), status.st_size, status.st_mtime_ns) if path.is_file() else None


@lru_cache(maxsize=4096)
def _digest(path: str, size: int, modified: int) -> str:
    """SHA-256 of a file. size, modified: for the cache, so that a changed file is read again."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def add_digests(scenario: str) -> str:
    """A resolved scenario (TOML), preceded by a comment with the SHA-256 of each file that it
    names."""
    digests = ((f"{section}.{key}", digest(path)) for section, key, path in _named(scenario))
    return "".join(f"# {key}: sha256 {content}\n" for key, content in digests if content) + scenario


def changed_files(scenario: str) -> list[tuple[str, str]]:
    """Keys and paths of files whose content differs from the digests in front of a scenario.
    Missing files are not listed."""
    paths = {(section, key): path for section, key, path in _named(scenario)}
    out = []
    for line in scenario.splitlines():
        seal = _SEAL.fullmatch(line)
        if seal is None:
            break
        path = paths.get((seal[1], seal[2]), "")
        if digest(path) not in (None, seal[3]):
            out.append((f"{seal[1]}.{seal[2]}", path))
    return out


def _named(scenario: str) -> list[tuple[str, str, str]]:
    """Section, key and path of every file that a scenario names, except one that still grows."""
    data = tomllib.loads(scenario)
    if "source_timeout" in data.get("sensor", {}):
        data["sensor"].pop("source", None)
    named = (
        (section, key, named_path(section, key, data[section][key]))
        for section, key in PATHS if key in data.get(section, {})
    )  # fmt: skip
    return [(section, key, path) for section, key, path in named if path is not None]
