"""The EMCCD in `viform compare`; exposure and gain are set for the light."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.frames import Frame
from imagers.common.kind import Comparison, Setting
from imagers.emccd.device.timing import exposure_range
from imagers.emccd.pixels import GAIN_RANGE, EmccdPixels, without_smear
from imagers.emccd.pixels.chip import PITCH
from imagers.emccd.section import EmccdSection
from sensor.laboratory.bench import Bench
from sensor.laboratory.cameras import Camera

FULL: Final = 0.8
"""Share of a well that white fills."""
DARK_ROWS: Final = 8
"""Dark rows above the image area."""
COLUMNS: Final = 512
"""Columns of the image area."""
STEP: Final = 1e-5
"""Step of the exposure, s."""
LONGEST: Final = 4096 * STEP
"""Longest exposure, s."""


class EmccdComparison(Comparison):
    """See `Comparison`."""

    title = "EMCCD"
    note = "middle of its 512 x 512, dark around"

    def keys(self, shape: tuple[int, int]) -> dict[str, Any]:
        return {}

    def adjust(
        self, section: EmccdSection, white: float, mean: float, given: frozenset[str]
    ) -> EmccdSection:
        """Chooses the exposure at which white fills a share of the image well, up to the longest.
        In dim light, chooses the gain that brings the noise of the amplifier below the shot noise
        of mid-grey."""
        pixels = EmccdPixels()
        exposure = section.exposure
        if "exposure" not in given:
            full = FULL * pixels.image_well / (white * pixels.responsivity)
            exposure = max(math.floor(min(full, LONGEST) / STEP), 1) * STEP
        changed: dict[str, float] = {"exposure": exposure}
        if not given & {"gain", "gain_step"}:
            electrons = white * pixels.responsivity * exposure
            needed = 3 * pixels.read_noise / math.sqrt(max(electrons / 2, 1e-6))
            room = FULL * pixels.register_well / max(electrons, 1e-6)
            changed["gain"] = min(max(min(needed, room), GAIN_RANGE[0]), GAIN_RANGE[1])
        return section.model_copy(update=changed)

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        shortest, longest = exposure_range()[:2]
        low, high = (EmccdPixels(gain=gain) for gain in GAIN_RANGE)
        return Setting(low, shortest), Setting(high, longest)

    def sent(self, section: EmccdSection) -> int:
        return section.rows * COLUMNS

    def setting(self, section: EmccdSection, pixels: Any) -> str:
        return f"gain {pixels.gain:.3g}"

    def first_row(self, frame: Frame) -> int:
        return DARK_ROWS + int(frame.state["first_row"])

    def without_smear(
        self, signal: npt.NDArray[np.float64], imager: Any, seconds: float
    ) -> npt.NDArray[np.float64] | None:
        return without_smear(signal, imager.timing.row_shift / seconds)


def _bench(seed: int) -> Bench:
    """Without multiplication; rows and columns of the image area."""
    pixels = EmccdPixels(gain=1.0, shape=(48, 88))
    return Bench(
        pixels, PITCH**2, 0.01, (0.01, 2, 4), rows=32, first=8, columns=(12, 64),
        levels=10, frames=6, stack=24, seed=seed, kept=frozenset(pixels.effects) - {"smear"},
    )  # fmt: skip


MEASURED: Final = Camera(
    "emccd", "EMCCD, gain 1", _bench,
    ("no multiplication and no smear: the parameters are those of the chip",),
)  # fmt: skip
"""Its part in `viform laboratory`."""
