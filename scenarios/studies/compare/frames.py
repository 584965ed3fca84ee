"""A frame imager in a comparison: its simulation, and the figures measured on its frames."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS
from cosim.frames import Frame
from imagers.catalogue import IMAGERS
from imagers.common.kind import Comparison
from imagers.common.model import View
from scenarios.assemble.schema.scenario import ImagerScenario
from scenarios.studies.compare.measure import noise, snr_curve
from scenarios.studies.compare.motion import Motion, edge_blur
from scenarios.studies.compare.ranges import (
    black_and_slope,
    ends,
    one_frame,
    signal_to_noise,
    with_controls,
)
from scenarios.studies.compare.row import Camera, Figure
from scenarios.studies.compare.run_in import Footage, Placed, RunIn, film_at, middle
from scenarios.studies.compare.setting import SHAPE
from sensor.frame_pixels import Exposed
from sensor.reconstruct.fidelity import psnr


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
