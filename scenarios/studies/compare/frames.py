"""A frame imager in a comparison: its simulation, and the figures measured on its frames.

Its dynamic range is from the closed forms of its pixels: the light at saturation over the light
whose signal equals the noise in the dark.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import PS
from cosim.frames import Frame
from imagers.catalogue import IMAGERS
from imagers.common.kind import Comparison
from imagers.common.model import View
from scenarios.assemble.schema.scenario import ImagerScenario
from scenarios.studies.compare.measure import Camera, Figure, noise, snr_curve
from scenarios.studies.compare.motion import Motion, edge_blur
from scenarios.studies.compare.run_in import Footage, Placed, RunIn, film_at, middle
from scenarios.studies.compare.setting import SHAPE
from sensor.dynamic_range import decibels
from sensor.frame_pixels import Exposed
from sensor.reconstruct.fidelity import psnr

_STEADY: Final = 1e3
"""Exposure at which the smear of the EMCCD, which is not a signal, is negligible, s."""
_NOISELESS: Final = frozenset({"direct light", "dark current"})
"""Effects of a value without noise."""


def black_and_slope(pixels: Any, seconds: float) -> tuple[float, float]:
    """The value without light after `seconds`, DN, and the responsivity, DN/(lx s), by the closed
    form."""
    step = 1e-6
    lit, dark = (pixels.mean_variance(light, _STEADY)[0] for light in (step, 0.0))
    return pixels.mean_variance(0.0, seconds)[0], (lit - dark) / step


def ends(pixels: Any, seconds: float) -> tuple[float, float]:
    """Least and most light of one exposure, lx s: the light whose signal equals the noise in the
    dark, and the light at saturation (of converter or well), computed without noise. Pixels whose
    values are not in proportion to light state theirs (`light_range`)."""
    if hasattr(pixels, "light_range"):
        least, most = pixels.light_range(seconds)
        return least, most
    black, slope = black_and_slope(pixels, seconds)
    _, variance = pixels.mean_variance(0.0, seconds)
    full = (1 << pixels.bits) - 1
    rows, columns = pixels.shape
    flood = np.full((rows, columns), 4 * (full - black) / slope)
    still = Exposed(flood, np.full(rows, seconds), np.zeros(rows), 0, 0)
    effects = _NOISELESS & pixels.effects.keys()
    highest = float(np.median(pixels.convert(still, 1, effects)[rows // 2]))
    return variance**0.5 / slope, (min(highest, full) - black) / slope


def signal_to_noise(pixels: Any, lux: float, seconds: float) -> float:
    """Signal over its temporal noise at an illuminance, by the closed form of the pixels."""
    if hasattr(pixels, "snr"):
        return float(pixels.snr(lux * seconds, seconds))
    _, variance = pixels.mean_variance(lux * seconds, seconds)
    return float(black_and_slope(pixels, seconds)[1] * lux * seconds / variance**0.5)


def one_frame(pixels: Any, seconds: float) -> float:
    """Dynamic range of one frame of this exposure, dB."""
    least, most = ends(pixels, seconds)
    return decibels(most / least)


def with_controls(comparison: Comparison, pixels: Any) -> float:
    """Dynamic range over all settings of exposure, gain and high voltage, dB."""
    low, high = comparison.extremes(pixels)
    most = ends(low.pixels, low.seconds)[1] / low.seconds
    least = ends(high.pixels, high.seconds)[0] / high.seconds
    return decibels(most / least)


def film_frames(
    scenario: ImagerScenario, comparison: Comparison, view: View, motion: Motion, white: float
) -> Camera:
    """Simulates one imager before the scene and measures its frames.

    Args:
        scenario: scenario of the imager.
        comparison: properties of the imager for the comparison.
        view: the scene on the pixels of `SHAPE`.
        motion: the scene around the instant.
        white: illuminance of reflectance 1 on the pixels, lux.
    """
    begin = time.perf_counter()
    truth, instant = motion.truth, motion.instant
    kind = scenario.imager.kind
    model = IMAGERS[kind].model(scenario.imager, scenario.duration)
    imager: Any = model.make()
    light = RunIn(view.scenery)
    corner = (0, 0)
    placed: Any = light
    if model.shape != SHAPE:
        corner = ((model.shape[0] - SHAPE[0]) // 2, (model.shape[1] - SHAPE[1]) // 2)
        placed = Placed(light, model.shape, corner)
    effects = frozenset(imager.pixels.effects)
    footage = film_at(imager, placed, light, instant, scenario.seed, effects)
    frames = _Frames(scenario, comparison, model.make().pixels, footage, corner, white)
    image = frames.estimate(footage.frame)
    unsmeared = frames.without_smear(footage.frame, imager)
    corrected = None if unsmeared is None else np.clip(unsmeared, 0, 1)
    # The still frames have the first instant of the scene.
    first, now = truth(0), truth(instant)
    quiet = np.ones(SHAPE, bool)
    still = motion.moving() is None
    rate = PS / footage.period
    bits, pixels = frames.sent()
    ready = (footage.frame.ready - middle(footage.frame)) / PS
    skew = float(frames.instants[-1] - frames.instants[0]) / PS
    clipped = frames.clipped(footage.frame)
    stills = [frames.estimate(f) for f in footage.still]
    blur, unknown = None, "most pixels are saturated: blur is unknown"
    if clipped <= 0.5:
        blur, unknown = edge_blur(motion, image, now, frames.instants)
    figures = {
        "dynamic_range": Figure(one_frame(frames.pixels, frames.seconds), "dB"),
        "dynamic_range_controls": Figure(with_controls(comparison, frames.pixels), "dB"),
        "blur": Figure(blur, "pixels"),
        "noise": Figure(noise(stills, first, quiet), "1"),
        "data_rate": Figure(bits * rate, "bit/s"),
        "data_rate_pixel": Figure(bits * rate / pixels, "bit/s/pixel"),
        "latency": Figure(ready * 1e3, "ms"),
        "psnr": Figure(psnr(np.clip(image, 0, 1), now.astype(np.float32)), "dB"),
        "psnr_smear_corrected": Figure(
            None if corrected is None else psnr(corrected, now.astype(np.float32)), "dB"
        ),
        "skew": Figure(skew * 1e3, "ms"),
        "exposure": Figure(frames.seconds * 1e3, "ms"),
        "saturated": Figure(clipped, "1"),
        "off": Figure((middle(footage.frame) - footage.offset - instant) * 1e-9, "ms"),
    }
    notes = [] if footage.settled else ["its exposure oscillates and does not settle"]
    notes += ["no motion: blur of the static scene"] if still else []
    notes += [unknown, comparison.note]
    return Camera(
        kind, comparison.title, frames.setting(), "; ".join(n for n in notes if n),
        np.clip(image, 0, 1), figures, time.perf_counter() - begin, corrected,
        [
            replace(point, formula=frames.formula(point.reflectance))
            for point in snr_curve(frames.sharp(footage.still, imager), first, quiet)
        ],
    )  # fmt: skip


class _Frames:
    """Reads the frames of an imager.

    Args:
        scenario, comparison: see `film_frames`.
        pixels: pixels of the imager in its state at power-on.
        footage: recorded frames.
        corner: (row, column) of the scene's first pixel on the imager.
        white: illuminance of reflectance 1 on the pixels, lux.
    """

    def __init__(
        self, scenario: ImagerScenario, comparison: Comparison, pixels: Any, footage: Footage,
        corner: tuple[int, int], white: float,
    ) -> None:  # fmt: skip
        self._section, self._comparison = scenario.imager, comparison
        frame = footage.frame
        self.seconds = frame.exposure / PS
        self._top, self._left = corner
        self._white, self._rate = white, PS / footage.period
        self._first = comparison.first_row(frame)
        self.pixels = pixels
        rows = self._rows(frame)
        self.instants = (frame.begin[rows] + frame.end[rows]) // 2 - footage.offset
        black = self._dark(scenario.seed)
        pedestal = comparison.pedestal(self._section)
        self._black = black if pedestal is None else pedestal
        self._subtracted = 0.0 if pedestal is None else black

    def _dark(self, seed: int) -> float:
        """Mean of a frame of this exposure without light, DN: the offset that a user subtracts."""
        high, wide = self.pixels.shape
        none = Exposed(
            np.zeros((high, wide)), np.full(high, self.seconds), np.zeros(high), 0, 2**20
        )
        values = self.pixels.convert(none, seed, frozenset(self.pixels.effects))
        part = values[self._top : self._top + SHAPE[0], self._left : self._left + SHAPE[1]]
        return float(part.mean())

    def _rows(self, frame: Frame) -> slice:
        start = self._top - self._first
        return slice(start, start + SHAPE[0])

    def values(self, frame: Frame) -> npt.NDArray[np.float64]:
        """The part of a frame that has the scene, DN."""
        part = frame.values[self._rows(frame), self._left : self._left + SHAPE[1]]
        return part.astype(np.float64)

    def clipped(self, frame: Frame) -> float:
        """Share of saturated pixels: within 2 % of full scale (less the subtracted dark frame), or
        of the most light of pixels whose values are not in proportion to light."""
        values = self.values(frame)
        if hasattr(self.pixels, "lux"):
            most = ends(self.pixels, self.seconds)[1] / self.seconds
            return float((self.pixels.lux(values) >= 0.98 * most).mean())
        full = (1 << frame.bits) - 1
        return float((values >= full - self._subtracted - 0.02 * full).mean())

    def formula(self, reflectance: float) -> float:
        """Signal over noise at a reflectance, by the closed form of the pixels in the state at
        power-on."""
        return signal_to_noise(self.pixels, reflectance * self._white, self.seconds)

    def estimate(self, frame: Frame) -> npt.NDArray[np.float64]:
        """Reflectance by the closed form of the pixels, not clipped."""
        if hasattr(self.pixels, "lux"):
            return np.asarray(self.pixels.lux(self.values(frame)) / self._white)
        return (self.values(frame) - self._black) / self._white_step(frame)

    def _white_step(self, frame: Frame) -> float:
        """Difference between white and black, DN."""
        seconds = frame.exposure / PS
        return black_and_slope(self.pixels, seconds)[1] * self._white * seconds

    def without_smear(self, frame: Frame, imager: Any) -> npt.NDArray[np.float64] | None:
        """Reflectance, not clipped, after correction of the frame-transfer smear, column by column
        over all rows of the frame; None for an imager without smear."""
        signal = frame.values.astype(np.float64) - self._black
        whole = self._comparison.without_smear(signal, imager, frame.exposure / PS)
        if whole is None:
            return None
        part = whole[self._rows(frame), self._left : self._left + SHAPE[1]]
        return np.asarray(part / self._white_step(frame))

    def sharp(self, frames: list[Frame], imager: Any) -> list[npt.NDArray[np.float64]]:
        """Reflectance of each frame, without smear if the imager has any."""
        corrected = ((frame, self.without_smear(frame, imager)) for frame in frames)
        return [self.estimate(frame) if image is None else image for frame, image in corrected]

    def sent(self) -> tuple[float, float]:
        """Number of bits and of pixels that the imager transmits for a frame."""
        pixels = self._comparison.sent(self._section)
        return pixels * self.pixels.bits, pixels

    def setting(self) -> str:
        """Description of the imager's setting."""
        text = f"{self._rate:.3g} frames/s, exposure {self.seconds * 1e3:.4g} ms"
        return f"{text}, {self._comparison.setting(self._section, self.pixels)}"
