"""A small link for the tests of `link.air`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Clock
from display import SpikePanel
from link.air import Aim, Air, AirSetting, Optics, Scene
from sensor import CHIPS, CameraSetting

CLOCK = Clock(40_000)
SHAPE = (48, 64)
CAMERA = CameraSetting(
    replace(CHIPS["spiketwo"], width=SHAPE[1], height=SHAPE[0]), CLOCK, 1000.0, 1, reset="hard"
)
OPTICS = Optics(40, 32, 500e-6, 1000.0, 0.04, 39e-3, 1.864, 0.9, None, 0.3, 10e-6)
AIR = AirSetting(2.0)
PANEL = SpikePanel((32, 40), Clock(40_000), 1.0, drive="impulse", row_scan=0.0)
FIRST = 61_234_567


@dataclass
class Shown:
    """Random pixels; `level` makes all of them on or off."""

    ticks: int = 2
    shape: tuple[int, int] = (32, 40)
    level: bool | None = None

    def pixels(self, symbol: int) -> npt.NDArray[np.bool_]:
        if self.level is not None:
            return np.full(self.shape, self.level)
        return np.random.default_rng(symbol).random(self.shape) < 0.5


def make(source: Any = None, planes: int = 24, effects: Any = None, **changes: Any) -> Air:
    """changes: optics, aim, air, panel, camera, places."""
    given: dict[str, Any] = {"optics": OPTICS, "aim": Aim(), "air": AIR, "panel": PANEL}
    given = given | changes
    scene = Scene(given["panel"], given["optics"], given["aim"], given["air"])
    return Air(
        source or Shown(), scene, given.get("camera", CAMERA), first_light=FIRST, planes=planes,
        effects=effects, places=given.get("places"),
    )  # fmt: skip
