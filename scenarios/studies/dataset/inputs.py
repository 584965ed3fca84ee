"""What the command line names: sources of light, and cameras."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from cosim import InputError
from cosim.config.toml import read_toml
from cosim.errors import quote, shorten
from scenarios.assemble.schema.loading import shipped
from sensor.device.chips import CHIPS

CLIPS: Final = frozenset({
    ".avi", ".bmp", ".gif", ".jpeg", ".jpg", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg",
    ".png", ".tif", ".tiff", ".webm", ".y4m",
})  # fmt: skip
"""Endings of files that a folder of clips is searched for. A file named itself may have any."""


@dataclass(frozen=True)
class SourceChoice:
    """A source of light.

    Attributes:
        given: source as the user named it, or the file of a folder.
        label: short name for files.
        scenario: name or TOML file of its scenario.
        clip: file of a clip; None for a scenario.
    """

    given: str
    label: str
    scenario: str
    clip: str | None = None


@dataclass(frozen=True)
class CameraChoice:
    """A camera.

    Attributes:
        label: short name for files.
        chip: preset that replaces the chip of the scenario; None to keep it.
        section: a whole [sensor]; None to keep that of the scenario.
        given: camera as the user named it; "" for that of the scenario.
    """

    label: str
    chip: str | None = None
    section: dict[str, Any] | None = None
    given: str = ""


def _label(text: str) -> str:
    """A text as part of a file name."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", text).strip("-.")[:40] or "source"


def read_sources(names: Sequence[str]) -> list[SourceChoice]:
    """The sources: scenarios, TOML files, clips, or folders of clips.

    Raises:
        InputError: nothing is given, a name is none of these, or a folder has no clips.
    """
    if not names:
        raise InputError(
            "SOURCE", "a scenario, a clip or a folder of clips", "absent",
            "name one or more, such as objects",
        )  # fmt: skip
    found: list[SourceChoice] = []
    for name in names:
        path = Path(name)
        try:
            is_scenario = path.suffix.lower() == ".toml" or (path / "scenario.toml").is_file()
            is_folder, is_file = path.is_dir(), path.is_file()
        except OSError:  # the name is too long
            is_scenario = is_folder = is_file = False
        if name in shipped() or is_scenario:
            found.append(SourceChoice(name, _label(path.stem), name))
        elif is_folder:
            clips = sorted(p for p in path.iterdir() if p.suffix.lower() in CLIPS)
            if not clips:
                raise InputError(
                    "SOURCE", "a folder with clips or images", f"{path}, which has none",
                    "name the files themselves",
                )  # fmt: skip
            found += [SourceChoice(str(p), _label(p.stem), "film", str(p)) for p in clips]
        elif is_file:
            found.append(SourceChoice(name, _label(path.stem), "film", name))
        else:
            raise InputError(
                "SOURCE", f"one of {', '.join(shipped())}, a TOML file, a clip or a folder",
                quote(name), "check the path",
            )  # fmt: skip
    twice = {each.given for each in found if [s.given for s in found].count(each.given) > 1}
    if twice:
        raise InputError("SOURCE", "named once", f"{min(twice)} twice", "use --samples for more")
    return found


def read_cameras(names: Sequence[str]) -> list[CameraChoice]:
    """The cameras: chip presets, or TOML files with a [sensor]; that of each scenario if empty.

    Raises:
        InputError: a name is none of these, or two have one label.
    """
    found = [_camera(name) for name in names] or [CameraChoice("camera")]
    labels = [each.label for each in found]
    for label in labels:
        if labels.count(label) > 1:
            raise InputError(
                "--camera", "different names", f"{label} twice", "rename the TOML file"
            )
    return found


def _camera(name: str) -> CameraChoice:
    if name in CHIPS:
        return CameraChoice(_label(name), chip=name, given=name)
    path = Path(name)
    try:
        data = read_toml(path)
    except OSError as exc:
        raise InputError(
            "--camera", f"one of {', '.join(CHIPS)}, or a TOML file with a [sensor]", quote(name),
            "check the name",
        ) from exc  # fmt: skip
    except (ValueError, RecursionError) as exc:
        raise InputError(
            "--camera", "a TOML file", f"{path} ({shorten(str(exc))})", "correct that place"
        ) from exc
    section = data.get("sensor")
    if not isinstance(section, dict):
        raise InputError("--camera", "a TOML file with a [sensor]", f"{path}", "add the section")
    return CameraChoice(_label(path.stem), section=section, given=name)
