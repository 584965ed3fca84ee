"""Settings in Python as assignments of the command line."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim import InputError


def assignments_of(settings: Mapping[str, Any]) -> list[str]:
    """Settings as the command line has them. Raises InputError for a value of another kind."""
    return [f"{key}={_text(key, value)}" for key, value in settings.items()]


def _text(key: str, value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple, np.ndarray)):
        return json.dumps(np.asarray(value).tolist())
    if isinstance(value, (str, int, float, np.integer, np.floating, os.PathLike)):
        return str(value)
    raise InputError(key, "a text, number, path or list", type(value).__name__, "convert it")
