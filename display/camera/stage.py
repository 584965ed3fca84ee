"""The stage of a camera that films the panel, plane by plane, and the bands in its pictures.

A rolling shutter makes bands: rows begin one after another, so a row sees the light at its own
phase. They are measured from a picture, and have a closed form for pulses. With pulses of the
period P that last d P, an exposure T = (m + u) P collects m d P, and the overlap of a pulse with a
window u P. Over the rows this overlap is a trapezoid. Each harmonic k of the light is weakened by
|sinc(k T / P)|; whole periods leave no bands.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Block
from cosim.spikes.viform import Viform, Words
from display.camera.rolling import Shutter
from display.camera.section import FramesSection
from display.plan.pixels import FilmedPixels

Values = npt.NDArray[np.float64]
_DARK = 0.01
"""Rows with less than this share of the light of the brightest row are not measured."""
State = dict[str, npt.NDArray[Any]]
_SHOT: Final = 1
"""Number of the noise of frames among the random numbers of a seed."""


class PanelCamera:
    """Films a panel with a rolling shutter; passes the stream on unchanged.

    Args:
        section: the section [camera].
        shutter: its timing before the panel.
        seed: seed of the noise.
        mapping: maps words of the stream to words of the panel; None for equal sizes.

    Attributes:
        section, shutter: settings of the camera and its shutter, as above.
        frames: complete frames, in order.
    """

    def __init__(
        self,
        section: FramesSection,
        shutter: Shutter,
        seed: int,
        mapping: Callable[[Words], Words] | None = None,
    ) -> None:
        self.section, self.shutter, self._seed = section, shutter, seed
        self._pixels = FilmedPixels(shutter.panel, mapping)
        self._open: dict[int, tuple[Values, Values]] = {}
        self._plane = 0
        self.frames: list[Filmed] = []

    def step(self, data: Viform, block: Block) -> Viform:
        """Films the planes of one block; blocks begin at whole words."""
        for planes, light in self._pixels.words(data):
            self._film(light, planes)
        return data

    def _film(self, packets: Values, planes: int) -> None:
        """Films the planes of one word, (planes, pixels)."""
        shutter, first = self.shutter, self._plane
        height, width = shutter.panel.shape
        light = packets.reshape(planes, height, width) / shutter.panel.white_rate
        rows = light.mean(axis=2).T
        begin, end = shutter.panel.start(first), shutter.panel.start(first + planes + 1)
        last = first + planes == shutter.planes
        for frame in range(len(self.frames), shutter.frames):
            since, until = shutter.span(frame)
            if since > end:
                break
            if until < begin:
                continue
            image, steady = self._open.setdefault(
                frame, (np.zeros((height, width)), np.zeros(height))
            )
            weight = shutter.exposed(frame, first, planes)
            if weight.any():
                image += np.matmul(weight[:, None, :], light.transpose(1, 0, 2))[:, 0]
            steady += (shutter.around(frame, first, planes) * rows).sum(axis=1)
            # At once: a plane may be longer than a great many frames.
            if last or until <= shutter.panel.start(first + planes):
                self._finish(frame)
        self._plane += planes

    def _finish(self, frame: int) -> None:
        """Completes the next frame, whose light has all come."""
        image, steady = self._open.pop(frame)
        by, _ = self.shutter.box
        self.frames.append(
            Filmed(self._read(frame, self._boxed(image)), steady.reshape(-1, by).mean(axis=1))
        )

    def _boxed(self, image: Values) -> Values:
        """The mean light on each pixel of the camera, white = 1."""
        (rows, columns), (high, wide) = self.shutter.shape, self.shutter.box
        return np.asarray(image.reshape(rows, high, columns, wide).mean(axis=(1, 3)))

    def _read(self, frame: int, light: Values) -> npt.NDArray[np.uint16]:
        """Light as digital numbers: shot noise, full well, read noise, converter."""
        section = self.section
        noise = np.random.default_rng([self._seed, frame, _SHOT])
        electrons = noise.poisson(light * (section.white * section.full_well)).astype(np.float64)
        electrons = np.minimum(electrons, section.full_well)
        electrons += section.read_noise * noise.standard_normal(light.shape)
        full = (1 << section.bits) - 1
        values = np.rint(electrons * (full / section.full_well))
        return np.clip(values, 0, full).astype(np.uint16)

    def pictures(self) -> list[Values]:
        """The frames, (rows, columns), the panel's white = 1."""
        section = self.section
        scale = section.white * ((1 << section.bits) - 1)
        return [frame.values / scale for frame in self.frames]

    def bands(self) -> tuple[list[float], list[Values]]:
        """The contrast of bands in every lit frame, and the profile of every frame; see
        `banding`."""
        found = [
            banding(picture, frame.steady)
            for picture, frame in zip(self.pictures(), self.frames, strict=True)
        ]
        return [c for c, _ in found if c is not None], [profile for _, profile in found]

    def flicker(self) -> float | None:
        """Percent flicker of the frames' mean light over the steady light: (most - least) / (most +
        least), %. None for fewer than two lit frames."""
        means = [
            float(picture.mean() / frame.steady.mean())
            for picture, frame in zip(self.pictures(), self.frames, strict=True)
            if frame.steady.mean() > 0
        ]
        if len(means) < 2 or max(means) + min(means) == 0:
            return None
        return 100 * (max(means) - min(means)) / (max(means) + min(means))

    def state(self) -> State:
        """Everything that the next block depends on."""
        state = {"plane": np.array(self._plane), "open": np.array(sorted(self._open), np.int64)}
        for frame, (image, steady) in self._open.items():
            state |= {f"image{frame}": image.copy(), f"steady{frame}": steady.copy()}
        if self.frames:
            state["values"] = np.stack([frame.values for frame in self.frames])
            state["steady"] = np.stack([frame.steady for frame in self.frames])
        return state | {f"pixels/{k}": v for k, v in self._pixels.state().items()}

    def restore(self, state: State) -> None:
        """Restores a `state`."""
        self._plane = int(state["plane"])
        self._open = {
            int(n): (state[f"image{n}"].copy(), state[f"steady{n}"].copy()) for n in state["open"]
        }
        done = zip(state.get("values", ()), state.get("steady", ()), strict=True)
        self.frames = [Filmed(values, steady) for values, steady in done]
        mine = {k.removeprefix("pixels/"): v for k, v in state.items() if k.startswith("pixels/")}
        self._pixels.restore(mine)


@dataclass(frozen=True, eq=False)
class Filmed:
    """A frame of the camera.

    Attributes:
        values: (rows, columns) uint16, DN.
        steady: (rows,) mean light of each row over a period of the frame, white = 1.
    """

    values: npt.NDArray[np.uint16]
    steady: Values


def banding(
    picture: npt.NDArray[np.float64], steady: npt.NDArray[np.float64]
) -> tuple[float | None, npt.NDArray[np.float64]]:
    """The contrast of bands in a picture, and the profile that it is measured on.

    The contrast is sqrt(2) times the standard deviation of the profile over its mean: that of a
    sine wave is its amplitude over its mean. Noise of the row means counts as bands.

    Args:
        picture: (rows, columns).
        steady: (rows,) mean light of each row over a period of the frame, in the same unit.

    Returns:
        The contrast, None if no row is lit; and the profile, (rows,): mean of each row over its
        steady light, NaN where that is dark.
    """
    lit = steady > max(_DARK * float(steady.max(initial=0.0)), 0.0)
    profile = np.full(len(steady), np.nan)
    profile[lit] = picture.mean(axis=1)[lit] / steady[lit]
    if not lit.any() or not float(profile[lit].mean()):
        return None, profile
    return math.sqrt(2) * float(profile[lit].std() / profile[lit].mean()), profile


def pulse_banding(duty: float, frequency: float, exposure: float) -> float:
    """The same contrast in closed form, for equal pulses and rows at all phases.

    Args:
        duty: share of the period in which the light is on, above 0 to 1.
        frequency: frequency of the pulses, Hz.
        exposure: s.
    """
    periods = exposure * frequency
    u = periods - math.floor(periods)
    on = duty
    if u + on > 1:  # the complement of a window has the same variance
        u, on = 1 - u, 1 - on
    top = min(u, on)
    # The trapezoid rises over `top`, stays for |u - on|, falls over `top`; its mean is u on.
    variance = 2 * top**3 / 3 + top**2 * abs(u - on) - (u * on) ** 2
    return math.sqrt(2 * max(variance, 0.0)) / (periods * duty)
