"""`AdaptivePixels`: three-transistor linear pixels with an 8-bit converter, row by row.

Electrons are a Poisson count of the light (with the response of the pixel) plus a Poisson count of
the dark current, limited by the full well. Reset noise, noise of follower and converter, and the
offset of the column follow; the converter truncates. Light is in lx s and the response in V/(lx s),
so no assumption about photons is needed: 1.0 V/(lx s) over 20 uV per electron is 50 000
photoelectrons per lux second.

The converter truncates: document 001 recovers in one frame from light that falls to 1/2 LSB and in
two from 1/256 LSB, and the factors of its table give exactly this with a truncating converter (a
rounding one would need two frames between 1/2 and 1 LSB).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream
from cosim.plan.effects import Effect
from imagers.adaptive.pixels.effects import make_effects
from imagers.adaptive.pixels.setting import BITS, ROUNDING, CmosSetting
from imagers.common.frame_pixel import Conversion, FixedPattern, digitised, summary_of
from sensor.frame_pixels import Exposed, ImagerSummary, Values

_FULL = 100.0
"""Wells of light, or dark, beyond which a pixel is full whatever its noise; more is not drawn."""
_DSNU, _PRNU, _COLUMN = 0, 1, 2


@dataclass(frozen=True, eq=False)
class CmosExposed(Exposed):
    """Rows that are sampled beside switching logic.

    Attributes:
        kicks: (rows,) charge that the logic adds to every pixel of a row at its sample, e.
    """

    kicks: Values


class AdaptivePixels:
    """Three-transistor pixels (see the module). setting: of pixel and converter. shape: (H, W)."""

    bits = BITS

    def __init__(self, shape: tuple[int, int] = (256, 256), setting: CmosSetting | None = None):
        self.shape = shape
        self.setting = setting or CmosSetting()
        self.effects: dict[str, Effect] = make_effects(self.setting)

    @property
    def everything(self) -> frozenset[str]:
        """Names of all effects."""
        return frozenset(self.effects)

    def digitise(
        self, rows: Exposed, seed: int, kept: frozenset[str]
    ) -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.bool_]]:
        """Values (DN), and whether the comparator beside the converter reports more than full
        scale."""
        s, at = self.setting, Conversion.of(rows, seed, kept)
        light = at.times(rows.lux_seconds * s.sensitivity, "PRNU", self._response)
        light = np.minimum(light, _FULL * s.well)
        electrons = at.counts(light, "shot noise", Stream.IMAGER_SHOT)
        electrons = electrons + at.dark_counts(
            s.dark_now, rows.seconds, self._darkness, _FULL * s.well
        )
        electrons = np.minimum(electrons, s.well)
        electrons = at.noisy(electrons, s.reset_noise, "reset noise", Stream.IMAGER_RESET)
        electrons = at.noisy(electrons, s.read_noise, "read noise", Stream.IMAGER_READ)
        if isinstance(rows, CmosExposed):
            electrons = electrons + rows.kicks[:, None]
        values = electrons / s.step
        if "column pattern" in kept:
            values += self._offsets
        full = 1 << BITS
        saturated = values > full * (1 + ROUNDING)
        return digitised(np.floor(values + ROUNDING), BITS), saturated

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """See `PixelModel`."""
        return self.digitise(rows, seed, kept)[0]

    def mean_variance(self, lux_seconds: float, seconds: float) -> tuple[float, float]:
        """See `PixelModel`. Truncation lowers the mean by 0.5 DN and adds 1/12 DN^2. This holds to
        2 % of a DN if the noise before truncation is at least 0.4 DN, and on average over light for
        any noise."""
        s = self.setting
        photo, dark = lux_seconds * s.sensitivity, s.dark_now * seconds
        variance = photo + dark + s.reset_noise**2 + s.read_noise**2
        return (photo + dark) / s.step - 0.5, variance / s.step**2 + 1 / 12

    def summary(
        self, lux_seconds: tuple[float, float], seconds: tuple[float, float], frames: int
    ) -> ImagerSummary:
        """See `PixelModel`."""
        s = self.setting
        light = lux_seconds[0] * s.sensitivity, lux_seconds[1] * s.sensitivity
        return summary_of(light, seconds, frames, s.well, kelvin=s.kelvin, step=s.step)

    @cached_property
    def _pattern(self) -> FixedPattern:
        return FixedPattern(self.shape, self.setting.device)

    def _darkness(self) -> Values:
        """(H, W) dark current of each pixel over the mean."""
        return self._pattern.factor(_DSNU, self.setting.dsnu)

    def _response(self) -> Values:
        """(H, W) response of each pixel over the mean."""
        return self._pattern.factor(_PRNU, self.setting.prnu)

    @cached_property
    def _offsets(self) -> Values:
        """(1, W) offset of each column, DN."""
        drawn = self._pattern.normal(_COLUMN, (1, self.shape[1]))
        return drawn * (self.setting.column * (1 << BITS))
