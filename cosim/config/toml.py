"""A section or a whole scenario as TOML text, and files of text that users write."""

from __future__ import annotations

import codecs
import tomllib
from pathlib import Path
from typing import Any, Final

import tomli_w
from pydantic import BaseModel

_MARKS: Final = {
    codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16",
}  # fmt: skip
"""Encodings by the byte-order marks with which editors and shells of Windows begin a file."""


def to_toml(section: BaseModel) -> str:
    """The section as TOML, including defaults. Keys with the value None are omitted."""
    return tomli_w.dumps(section.model_dump(mode="json", exclude_none=True))


def read_text(path: Path) -> str:
    """The text of a file that a user wrote, in UTF-8, or as its byte-order mark says.

    Raises:
        OSError: it cannot be read.
        ValueError: it is no text.
    """
    with path.open("rb") as file:
        head = file.read(3)
    known = (name for mark, name in _MARKS.items() if head.startswith(mark))
    return path.read_text(encoding=next(known, "utf-8"))


def read_toml(path: Path) -> dict[str, Any]:
    """The data of a TOML file; see `read_text`. Raises RecursionError for one nested too deep."""
    return tomllib.loads(read_text(path))
