"""True position of a panel's image, size of its tags, and true timing of its symbols, from the
setting."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim import PS
from link.air import image_of
from link.air.geometry import panel_corners
from link.layout import Layout
from link.mode import Mode
from link.prediction.light import cell_scene
from link.receiving.tags import least_module
from link.setting import LinkSetting
from link.timing import Timing
from sensor.latched.sampling import row_offsets


def panel_in_view(setting: LinkSetting) -> bool:
    """Whether the image of the whole panel, tags included, lies on the sensor."""
    chip = setting.camera.chip
    home = image_of(setting.optics, setting.aim, setting.air, (chip.height, chip.width))
    u, v, w = home @ panel_corners(setting.optics).T
    x, y = u / w, v / w
    inside = (x > -1) & (x < chip.width) & (y > -1) & (y < chip.height)
    return bool(inside.all())


def tag_module(setting: LinkSetting, mode: Mode) -> tuple[float, float]:
    """Side of a module of the tags, and the smallest that is detected through the blur of the
    image, camera pixels."""
    return setting.scale * Layout(mode).module, least_module(cell_scene(setting).blur)


def true_timing(setting: LinkSetting, row_delay: npt.NDArray[np.int64], ticks: int) -> Timing:
    """Timing of symbols in the camera's ticks.

    Args:
        setting: the link.
        row_delay: delay of the light of each camera row, ps.
        ticks: panel planes of a symbol.
    """
    camera, height = setting.camera, setting.camera.chip.height
    period = PS / camera.clock.hz
    delay = row_offsets(camera.clock, height, camera.row_skew, camera.comparator_delay, (0, height))
    shift = (row_delay - delay) / period  # delay of the light after the row's ticks, ticks
    first, slope = np.polynomial.polynomial.polyfit(np.arange(height), shift, 1)
    return Timing(
        setting.first_light / period + float(first),
        ticks * camera.clock.hz / setting.panel.clock.hz, float(slope) * height, height,
    )  # fmt: skip
