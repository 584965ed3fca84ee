"""The golden model of a spike-continuous panel, in numpy and float64, plane by plane.

Tests compare the shaders with it. Within a plane it uses the closed form: the drive is constant (in
two parts for a packet shorter than the plane), and the emitter relaxes towards it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD
from display.observe.views import Views
from display.panels.panel import SpikePanel

FOREVER = np.uint32(2**32 - 1)
"""The largest age, which does not increase."""
Values = npt.NDArray[np.float64]


class GoldenRenderer:
    """A panel and the images of its observers, accurate in float64 and slow.

    Args:
        panel: the panel.
        batch: number of planes in a span of light.
        images: number of images of the observers.

    Attributes:
        tau, age: last interval, and planes since the last spike, (height, width) uint32; tau is 0
            before the second spike, age counts from the first spike on.
        started: whether the pixel has fired, (height, width) bool.
        memory: memory of the drive, (height, width) float64.
        emitted: sum of the drive's levels since the last spike, packets, (height, width) float64.
        level: level of the emitter at the end of the last plane, packets a cycle, (height, width).
        light: light of the last block, packets Q summed over each span, (spans, height, width)
            float64.
    """

    name = "numpy, float64"

    def __init__(self, panel: SpikePanel, batch: int, images: int) -> None:
        self.panel, self.batch = panel, batch
        self.tau, self.age = (np.zeros(panel.shape, np.uint32) for _ in range(2))
        self.started = np.zeros(panel.shape, np.bool_)
        self.level, self.memory, self.emitted = (np.zeros(panel.shape) for _ in range(3))
        self._images = np.zeros((images, *panel.shape))
        self.light = np.zeros((0, *panel.shape))

    def step(self, words: npt.NDArray[np.uint32], cycles: int, views: Views | None) -> None:
        """Shows `cycles` planes. Raises ValueError for words of another size.

        Args:
            words: (ceil(cycles / 32), height, width) uint32, pixel-major.
            cycles: number of planes.
            views: views for spans of `batch` planes; None for no observer.
        """
        if words.shape[1:] != self.panel.shape:
            raise ValueError(f"words must be of {self.panel.shape} pixels, not {words.shape[1:]}")
        spans = -(-cycles // self.batch)
        self.light = np.zeros((spans, *self.panel.shape))
        for n in range(cycles):
            spike = ((words[n // WORD] >> np.uint32(n % WORD)) & np.uint32(1)).astype(np.bool_)
            self.light[n // self.batch] += self._plane(spike)
        if views is not None:
            for image in range(views.images):
                self._integrate(image, views)

    def _plane(self, spike: npt.NDArray[np.bool_]) -> Values:
        """Light of one plane, packets; updates the state."""
        scheme = self.panel.scheme
        older = np.where(self.age < FOREVER, self.age + self.started.astype(np.uint32), FOREVER)
        if scheme.remember is not None:
            after = scheme.remember(self.memory, np.where(self.started, older, 0), self.emitted)
            self.memory = np.where(spike, after, self.memory)
        interval = np.where(older < dark, older, 0) if (dark := self.panel.dark) else older
        self.tau = np.where(spike & self.started, interval, self.tau).astype(np.uint32)
        self.age = np.where(spike, np.uint32(0), older).astype(np.uint32)
        self.started |= spike
        lit = self.started if scheme.spikes < 2 else self.tau > 0
        if dark:
            lit = lit & (self.age < dark)
        level = scheme.level(self.age, np.maximum(self.tau, np.uint32(1)), self.memory)
        drive, pulse = np.where(lit, level, 0.0), self.panel.share
        self.emitted = np.where(spike, 0.0, self.emitted) + drive
        if self.panel.rise == 0 and self.panel.decay == 0:
            self.level = drive if pulse == 1 else np.zeros_like(drive)
            return drive
        light = self._relax(drive / pulse, pulse)
        return light + self._relax(np.zeros_like(drive), 1 - pulse) if pulse < 1 else light

    def _relax(self, drive: Values, share: float) -> Values:
        """Light of a part of a plane under constant drive, packets; updates the level."""
        period = 1 / self.panel.clock.hz
        out = np.empty_like(drive)
        for way, constant in (
            (drive > self.level, self.panel.rise),
            (drive <= self.level, self.panel.decay),
        ):
            x, y = drive[way], self.level[way]
            if constant == 0:
                out[way], self.level[way] = x * share, x
                continue
            planes = constant / period
            gone = -np.expm1(-share / planes)
            out[way] = x * share + (y - x) * planes * gone
            self.level[way] = y + (x - y) * gone
        return out

    def _integrate(self, image: int, views: Views) -> None:
        height = self.panel.shape[0]
        row = np.arange(height)[:, None] / height
        for span, light in enumerate(self.light):
            weight, slope = views.weight[image, span], views.slope[image, span]
            if weight == 0 and slope == 0:
                continue
            dy = views.dy[image, span] + views.dy_slope[image, span] * row
            dx = views.dx[image, span] + views.dx_slope[image, span] * row
            moved = light if not (dy.any() or dx.any()) else _shifted(light, dy, dx)
            self._images[image] += (weight + slope * row) * moved

    def take(self, image: int) -> Values:
        """The image so far, (height, width) float64; resets the image to 0."""
        values = self._images[image].copy()
        self._images[image] = 0
        return values

    def pixels(self) -> dict[str, npt.NDArray[Any]]:
        """The state of the pixels, without the images."""
        return {
            "tau": self.tau.copy(), "age": self.age.copy(), "started": self.started.copy(),
            "level": self.level.copy(), "memory": self.memory.copy(),
            "emitted": self.emitted.copy(),
        }  # fmt: skip

    def put_pixels(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores the pixels of a `state`; the images stay."""
        self.tau, self.age = state["tau"].copy(), state["age"].copy()
        self.started, self.level = state["started"].copy(), state["level"].copy()
        self.memory, self.emitted = state["memory"].copy(), state["emitted"].copy()

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next block depends on."""
        return self.pixels() | {"images": self._images.copy()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        self.put_pixels(state)
        self._images = state["images"].copy()

    def close(self) -> None:
        """Does nothing: there are no resources to release."""


def _shifted(light: Values, dy: Values, dx: Values) -> Values:
    """`light` at (y + dy, x + dx), bilinear, 0 outside; dy, dx: (height, 1), one for each row."""
    height, width = light.shape
    y = np.arange(height)[:, None] + dy
    x = np.arange(width)[None, :] + dx
    y0, x0 = np.floor(y).astype(np.int64), np.floor(x).astype(np.int64)
    fy, fx = y - y0, x - x0
    out = np.zeros_like(light)
    for ay, wy in ((0, 1 - fy), (1, fy)):
        for ax, wx in ((0, 1 - fx), (1, fx)):
            yy, xx = np.broadcast_arrays(y0 + ay, x0 + ax)
            inside = (yy >= 0) & (yy < height) & (xx >= 0) & (xx < width)
            there = light[np.clip(yy, 0, height - 1), np.clip(xx, 0, width - 1)]
            out += wy * wx * np.where(inside, there, 0.0)
    return out
