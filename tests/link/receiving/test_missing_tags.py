"""Which cause is named if some tags of a panel are not detected."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from link.layout import Layout
from link.mode import Mode
from link.receiving.diagnosis.failure import few_tags_verdict
from link.receiving.tags import LEAST_MODULE, tag_corners
from link.verdict import Cause

MODE = Mode(960, 960, 1, 1, "none", 32)


def seen(module: float, corners: tuple[int, ...]) -> Any:
    """What a camera of 1000 x 1000 pixels finds of a panel in its middle, with modules so large."""
    layout = Layout(MODE)
    scale = module / layout.module
    tags = {
        corner: (960 // 32 * 4, (np.asarray(tag_corners(layout, corner)) - 480) * scale + 500)
        for corner in corners
    }
    return SimpleNamespace(search=SimpleNamespace(tags=tags))


@pytest.mark.parametrize("corners", [(1, 3), (0, 1, 2)])
def test_tags_too_small_are_not_hidden(corners: tuple[int, ...]) -> None:
    recording: Any = SimpleNamespace(shape=(1000, 1000))
    small = few_tags_verdict(recording, seen(0.85 * LEAST_MODULE, corners))
    assert small.cause is Cause.TOO_SMALL
    assert f"{0.85 * LEAST_MODULE:.2g} camera pixels and need {LEAST_MODULE:g}" in small.text
    large = few_tags_verdict(recording, seen(2 * LEAST_MODULE, corners))
    assert large.cause is Cause.OCCLUDED
