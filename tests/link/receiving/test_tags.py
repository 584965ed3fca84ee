"""The panel's tags in images of spike rates."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from link.layout import Layout
from link.mode import Mode
from link.receiving.tags import find_tags, fit_homography, least_module, tag_places
from link.sending.transmission import draw_tags
from tests.link.receiving.toy import homography

WIDE = Mode(960, 960, 8, 2, "8b10b", 64)


def seen(scale: float, white: float) -> np.ndarray:
    """(1000, 1000) rates: tags whose white fires so often a tick, data that fire in half as many,
    and darkness around."""
    panel = np.full((WIDE.height, WIDE.width), white / 2, np.float32)
    for tag in draw_tags(Layout(WIDE)):
        panel[tag.place] = white * tag.bright
    at = homography(WIDE, (4000, 4000), 4 * scale, 0.3)
    fine = cv2.warpPerspective(panel, at, (4000, 4000), flags=cv2.INTER_NEAREST)
    fine = cv2.GaussianBlur(fine, (0, 0), 4 * 0.4)
    noise = np.random.default_rng(3).standard_normal((1000, 1000)).astype(np.float32)
    rates = cv2.resize(fine, (1000, 1000), interpolation=cv2.INTER_AREA)
    return np.asarray(np.clip(rates + 0.01 * noise, 0, 1), np.float32)


@pytest.mark.parametrize(("module", "found"), [(1.7, True), (1.2, False)])
def test_tags_are_found_from_so_many_pixels_a_module_on(module, found):
    scale = module / Layout(WIDE).module
    assert (find_tags(seen(scale, 0.9)).mode == WIDE) == found == (module >= least_module(0.4))


@pytest.mark.parametrize("scale", [0.994, 0.2])
def test_tags_are_found_whether_the_panel_fills_the_view_or_little_of_it(scale):
    rates = seen(scale, 0.9)
    # In the small image fewer pixels than one in 200 are of the tags' white: the data's grey is not
    # to be taken for it.
    assert (np.quantile(rates, 0.995) < 0.5) == (scale < 0.5)
    found = find_tags(rates)
    assert found.mode == WIDE
    fitted = fit_homography(found, Layout(WIDE))
    assert fitted is not None
    x, y = tag_places(Layout(WIDE))[2]
    (u, v, w), true = fitted[0] @ [x, y, 1], homography(WIDE, (1000, 1000), scale, 0.3) @ [x, y, 1]
    assert np.hypot(*(np.array([u, v]) / w - true[:2] / true[2])) < 0.5
