"""File names that are safe to write, whatever their origin."""

from __future__ import annotations

import re
from typing import Final

NAME_BYTES: Final = 120
"""Largest size of a name in UTF-8: well below the 255 bytes of common file systems."""
_NAMELESS: Final = "file"
_UNWANTED: Final = re.compile(r'[<>:"|?*]')
_DEVICES: Final = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)
"""Names that Windows reserves for devices."""


def safe_name(name: str) -> str:
    """Last part of a path, as a name that stays in the folder it is written to.

    Characters that a file system refuses, that control a terminal or reverse the direction of text
    become "_". An empty result becomes "file".
    """
    last = re.split(r"[/\\]", name)[-1]
    safe = "".join(c if c.isprintable() else "_" for c in last)
    safe = _UNWANTED.sub("_", safe).rstrip(" .").lstrip()
    if not safe or _DEVICES.match(safe):
        safe = _NAMELESS + safe
    stem, dot, ending = safe.rpartition(".")
    if not dot or not stem or len(ending.encode()) > NAME_BYTES // 4:
        stem, dot, ending = safe, "", ""
    room = NAME_BYTES - len((dot + ending).encode())
    return (stem.encode()[:room].decode(errors="ignore") + dot + ending).rstrip(" .")
