"""A section or a whole scenario as TOML text."""

from __future__ import annotations

import tomli_w
from pydantic import BaseModel

__all__ = ["to_toml"]


def to_toml(section: BaseModel) -> str:
    """The section as TOML, including defaults. Keys with the value None are omitted."""
    return tomli_w.dumps(section.model_dump(mode="json", exclude_none=True))
