"""File names that are safe to write wherever they came from."""

from __future__ import annotations

import re
import unicodedata
from typing import Final

__all__ = ["NAME_BYTES", "safe_name"]

NAME_BYTES: Final = 120
"""Bytes of UTF-8 that a name may take: well below the 255 of common file systems."""
_NAMELESS: Final = "file"
_UNWANTED: Final = re.compile(r'[<>:"|?*]')
_DEVICES: Final = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)
"""Names that Windows keeps for devices."""


def safe_name(name: str) -> str:
    """The last part of a path, as a name that stays in the folder it is written to.

    Characters that no file system takes, that control a terminal or that turn the direction of
    text become "_"; what is left of "", "." and ".." is "file".
    """
    last = re.split(r"[/\\]", name)[-1]
    # Cc, Cf, Cs, Co, Cn: control, format, half of a pair, private, unassigned.
    kept = "".join("_" if unicodedata.category(c)[0] == "C" else c for c in last)
    kept = _UNWANTED.sub("_", kept).rstrip(" .").lstrip()
    if not kept or _DEVICES.match(kept):
        kept = _NAMELESS + kept
    stem, dot, ending = kept.rpartition(".")
    if not dot or not stem or len(ending.encode()) > NAME_BYTES // 4:
        stem, dot, ending = kept, "", ""
    room = NAME_BYTES - len((dot + ending).encode())
    return stem.encode()[:room].decode(errors="ignore") + dot + ending
