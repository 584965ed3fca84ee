"""`config.yaml` next to a recording: how other spike software describes a folder of `.dat` files.

Keys: filename, spike_w, spike_h, is_labeled, labeled_data_type, labeled_data_suffix, and with
labels data_field_identifier and label_field_identifier. `filename` names a recording or, as in the
data sets of SpikeCV, the whole data set. Only the size of the frames is used here. The keys about
labels are checked, but have no effect.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, cast

import yaml

from cosim.errors import InputError
from cosim.files.atomic import atomic_write

CONFIG = "config.yaml"
"""Name of such a file."""
_LARGEST = 2**13
"""Upper limit of the size of a config.yaml, bytes; public ones have 150."""
_BRACKETS = 100
"""Upper limit of brackets. The time of the YAML reader grows with the square of their depth."""
_MOST_PIXELS = 10**9


@dataclass(frozen=True)
class Config:
    """Content of a config.yaml.

    Attributes:
        filename: recording or data set.
        size: (width, height) of the stored frames.
    """

    filename: str
    size: tuple[int, int]

    def names(self, recording: Path) -> bool:
        """Whether `filename` names this recording, with or without its ending."""
        return PurePosixPath(self.filename).name in (recording.name, recording.stem)


def _bad(path: Path, value: str) -> InputError:
    return InputError(
        f"{path}",
        "YAML with filename, spike_w and spike_h",
        value,
        "correct it, or give the recording itself with its --size WxH",
    )


def _load(path: Path) -> dict[str, Any] | None:
    """The mapping in a YAML file; None if it is other YAML."""
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST + 1)
    except OSError as exc:
        raise _bad(path, f"one that cannot be read ({exc.strerror})") from exc
    if len(content) > _LARGEST:
        raise _bad(path, f"more than {_LARGEST} bytes")
    if content.count(b"[") + content.count(b"{") > _BRACKETS:
        raise _bad(path, f"one of more than {_BRACKETS} lists and mappings")
    try:
        document = yaml.safe_load(content)
    except Exception as exc:  # YAML errors, and those of numbers, dates and nesting in it
        mark = getattr(exc, "problem_mark", None)
        where = f" in line {mark.line + 1}" if mark is not None else ""
        raise _bad(path, f"broken{where} ({getattr(exc, 'problem', None) or exc})"[:200]) from exc
    return document if isinstance(document, dict) else None


def _whole_number(path: Path, document: dict[str, Any], key: str) -> int:
    value = document.get(key)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= _MOST_PIXELS:
        raise _bad(path, f"one whose {key} is {_short(value)}")
    return value


def _short(value: object) -> str:
    """A short text for a value; for a list or a mapping only its type, as it may be large."""
    if isinstance(value, str | int | float | bool) or value is None:
        return ascii(value)[:40]
    return f"a {type(value).__name__}"


def _check_labels(path: Path, document: dict[str, Any]) -> None:
    """Raises InputError if a key about labels is present with a value of the wrong type."""
    for key in ("labeled_data_suffix", "data_field_identifier", "label_field_identifier"):
        if not isinstance(document.get(key), str | None):
            raise _bad(path, f"one whose {key} is {_short(document[key])}")
    if not isinstance(document.get("is_labeled", False), bool):
        raise _bad(path, f"one whose is_labeled is {_short(document['is_labeled'])}")
    kinds = document.get("labeled_data_type", [])
    numbers = kinds if isinstance(kinds, list) else [kinds]
    if not all(isinstance(n, int | float) and not isinstance(n, bool) for n in numbers):
        raise _bad(path, f"one whose labeled_data_type is {_short(kinds)}")


def _parse(path: Path, document: dict[str, Any]) -> Config:
    filename = document.get("filename")
    if not isinstance(filename, str) or not filename.strip():
        raise _bad(path, f"one whose filename is {_short(filename)}")
    size = (_whole_number(path, document, "spike_w"), _whole_number(path, document, "spike_h"))
    if size[0] * size[1] > _MOST_PIXELS:
        raise _bad(path, f"one of {size[0]}x{size[1]} pixels")
    _check_labels(path, document)
    return Config(filename, size)


def read_config(path: Path) -> Config:
    """The content of a config.yaml. Raises InputError if it is no such file."""
    document = _load(path)
    if document is None:
        raise _bad(path, "something else")
    return _parse(path, document)


def _is_recording(path: Path) -> bool:
    """Whether a `.dat` of this name exists; never raises, for any name in YAML."""
    return path.suffix.lower() == ".dat" and os.path.isfile(path)


def adjacent_config(recording: Path) -> Config | None:
    """The config.yaml next to a recording, None if there is none.

    It applies to every recording of its folder, unless its filename is that of another recording
    there: public data sets contain the name of the set. A config.yaml without spike_w and spike_h
    belongs to another program. Raises InputError if the file is damaged, because a guessed size
    could be wrong.
    """
    path = recording.with_name(CONFIG)
    if not path.is_file():
        return None
    document = _load(path)
    if document is None or not {"spike_w", "spike_h"} & set(cast("dict[Any, Any]", document)):
        return None
    config = _parse(path, document)
    if not config.names(recording):
        name = PurePosixPath(config.filename).name
        if any(_is_recording(recording.parent / n) for n in (name, f"{name}.dat")):
            return None
    return config


def recording_of(path: Path) -> tuple[Path, Config]:
    """The recording of a config.yaml or of its folder, and the content of the config.yaml.

    It is the recording that `filename` names, or else the only `.dat` in the folder.
    """
    path = path / CONFIG if path.is_dir() else path
    config = read_config(path)
    name = PurePosixPath(config.filename)
    if not name.is_absolute() and ".." not in name.parts:
        for candidate in (path.parent / name, path.parent / f"{name}.dat"):
            if _is_recording(candidate):
                return candidate, config
    others = [p for p in path.parent.iterdir() if _is_recording(p)]
    if len(others) != 1:
        value = f"{len(others)} others" if others else "none"
        raise InputError(
            f"{path.parent}",
            f"a folder with the recording {ascii(config.filename)[:80]} that its {path.name} names",
            f"one with {value}",
            "give the recording itself",
        )
    return others[0], config


def write_config(recording: Path, size: tuple[int, int], *, whole_set: bool = False) -> None:
    """Writes a config.yaml without labels next to a recording. An existing file with the same size
    is not changed.

    Args:
        recording: the file.
        size: (width, height) as stored.
        whole_set: whether the file stands for all recordings of the folder, by its name, as in the
            data sets of SpikeCV, and not for this one.

    Raises:
        InputError: there is one with another size, or of another recording.
    """
    path = recording.with_name(CONFIG)
    if path.exists():
        check_config(recording, size)
        return
    text = yaml.safe_dump(
        {
            "filename": recording.absolute().parent.name if whole_set else recording.stem,
            "spike_w": size[0],
            "spike_h": size[1],
            "is_labeled": False,
            "labeled_data_type": [0],  # raw spikes, as public sets number it
            "labeled_data_suffix": "None",  # "None" in public sets means no suffix
        },
        sort_keys=False,
        default_flow_style=None,
        allow_unicode=True,
    )
    with atomic_write(path) as part:
        part.write_text(text, encoding="utf-8")


def check_config(recording: Path, size: tuple[int, int]) -> None:
    """Raises InputError if the config.yaml next to a recording states another size."""
    path = recording.with_name(CONFIG)
    if not path.exists():
        return
    try:
        existing = adjacent_config(recording)
    except InputError:
        existing = None
    if existing is None or existing.size != size:
        raise InputError(
            f"{path}",
            f"absent, or one that says {size[0]}x{size[1]} of {recording.name}",
            "another"
            if existing is None
            else f"one that says {existing.size[0]}x{existing.size[1]}",
            "write into another folder",
        )
