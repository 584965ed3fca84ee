"""The pilot for the choice of a mode: a strip of the panel through the same air and camera.

The strip is as high as the panel, so that it contains every phase of the rows, and as narrow as a
panel may be. Its registration and timing are known, not estimated: a receiver gets them from the
full panel's tags, which are larger.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cosim import Block
from cosim.compute.opencl import Device
from cosim.spikes.viform import WORD, Words
from link.air import Air, image_of
from link.air.geometry import panel_corners
from link.detect.catalogue import make_detector
from link.layout import TRAINING
from link.mode import Mode
from link.sending import FileTransmission, Transmission
from link.setting import LinkSetting
from link.setup.truth import true_timing
from link.timing import Timing
from sensor import SpikeCamera

WIDTH = 128
"""Panel pixels of the strip: the smallest width of a mode."""
SYMBOLS = 60
"""Symbols of random data after the training."""
_BEHIND = 2
"""Further symbols of data, so that the decided ones do not end in darkness, as those of a file do
not."""
_MARGIN = 12
"""Camera pixels around the strip's image."""


def strip_of(setting: LinkSetting, width: int = WIDTH) -> LinkSetting:
    """Link of a narrow panel from the panel's middle, with a camera as small as its image. width:
    of the panel, at most, panel pixels."""
    height, across = setting.camera.chip.height, setting.camera.chip.width
    optics = replace(setting.optics, width=min(width, setting.optics.width))
    corners = panel_corners(optics) @ image_of(optics, setting.aim, setting.air, (height, across)).T
    xy = corners[:, :2] / corners[:, 2:]
    low = np.maximum(np.floor(xy.min(axis=0)).astype(int) - _MARGIN, 0)
    high = np.minimum(np.ceil(xy.max(axis=0)).astype(int) + _MARGIN + 1, (across, height))
    high = np.maximum(high, low + 2 * _MARGIN)  # out of view: any part of the sensor
    wide, high_rows = (int(n) for n in high - low)
    chip = replace(setting.camera.chip, width=wide, height=high_rows)
    camera = replace(setting.camera, chip=chip)
    camera = camera.changed(row_skew=setting.camera.row_skew * high_rows / height)
    # Offset between the centres of the small and the whole sensor.
    x = setting.aim.offset[0] + (across - 1) / 2 - (float(low[0]) + (wide - 1) / 2)
    y = setting.aim.offset[1] + (height - 1) / 2 - (float(low[1]) + (high_rows - 1) / 2)
    period = camera.clock.edge(1)
    # The small sensor samples its first row without delay, the whole sensor so much later.
    early = round(setting.camera.row_skew * int(low[1]) / height * period)
    first_light = setting.first_light - early
    panel = replace(setting.panel, shape=(optics.height, optics.width))
    return replace(
        setting, camera=camera, optics=optics, panel=panel, first_light=first_light,
        aim=replace(setting.aim, offset=(x, y)),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Pilot:
    """A received pilot.

    Attributes:
        soft: (symbols, cells) float32, soft values of the random data.
        sent: (symbols, cells) bool, the random data.
    """

    soft: npt.NDArray[np.float32]
    sent: npt.NDArray[np.bool_]

    @property
    def errors(self) -> int:
        return int(((self.soft > 0) != self.sent).sum())


def film_words(
    strip: LinkSetting, sent: Transmission, device: Device | None
) -> tuple[Words, Timing, Air]:
    """Films a transmission whole, through the air and the camera of a link.

    Returns:
        The spikes as words, the first bit tick 0, the true timing of the symbols, and the air.
    """
    camera = strip.camera
    air = strip.make_air(sent, sent.planes)
    pixels = SpikeCamera(camera, device, row_delay=air.row_delay)
    dark = strip.first_light + strip.panel.clock.edge(sent.planes)
    cycles = -(-(camera.clock.cycle_at(dark) + 3) // WORD) * WORD
    parts = []
    for start in range(0, cycles, 2 * WORD):
        block = Block(start, min(2 * WORD, cycles - start))
        parts.append(pixels.step(air.step(None, block), block).words)
    return np.concatenate(parts), true_timing(strip, air.row_delay, sent.mode.ticks), air


def film_pilot(
    strip: LinkSetting, mode: Mode, detector: str, seed: int, device: Device | None,
    symbols: int = SYMBOLS,
) -> Pilot:  # fmt: skip
    """Films random data in a mode of the strip's size: at least `symbols`, in whole groups, after
    the training."""
    size = FileTransmission(mode, b"0", "pilot")
    groups = -(-symbols // size.layout.group)
    data = np.random.Generator(np.random.Philox(key=seed)).bytes(size.layout.group_bytes(groups))
    count = groups * size.layout.group
    sent = FileTransmission(mode, data, "pilot", most_symbols=TRAINING + count + _BEHIND)
    words, timing, air = film_words(strip, sent, device)
    learned = make_detector(detector, sent.layout, air.truth, timing)
    learned.learn(words, 0, sent.bits(0, TRAINING), 0)
    return Pilot(learned.soft(words, 0, TRAINING, count), sent.bits(TRAINING, count))
