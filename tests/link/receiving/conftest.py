"""A small link for the receiver's tests: planes warped, blurred, integrated by each row, fired."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from cosim.viform import Viform
from cosim.clock import Clock
from link.layout import Layout, pilots, training, PERIOD, TRAINING
from link.mode import Mode

CLOCK = Clock(40_000)


def panel_homography(
    layout: Layout, shape: tuple[int, int], scale: float, degrees: float, tilt: float = 0.0,
    offset: tuple[float, float] = (0.0, 0.0),
) -> npt.NDArray[np.float64]:
    """From panel to camera pixels: about both centres, turned clockwise, `tilt` in the third row."""
    w, h = layout.mode.width, layout.mode.height
    a = np.deg2rad(degrees)
    centre = np.array([[1, 0, -(w - 1) / 2], [0, 1, -(h - 1) / 2], [0, 0, 1]], float)
    turn = np.array(
        [[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [tilt / w, -tilt / h / 2, 1 / scale]]
    )
    back = np.array(
        [[1, 0, (shape[1] - 1) / 2 + offset[0]], [0, 1, (shape[0] - 1) / 2 + offset[1]], [0, 0, 1]],
        float,
    )
    out = back @ turn @ centre
    return out / out[2, 2]


@dataclass
class Toy:
    """One link. on, background: thresholds a tick. first: tick of symbol 0 at row 0."""

    mode: Mode = field(default_factory=lambda: Mode(256, 256, 2, 2, "8b10b", 32))
    shape: tuple[int, int] = (300, 300)
    homography: npt.NDArray[np.float64] | None = None
    blur: float = 0.5
    on: float = 1.4
    background: float = 0.02
    electrons: float = 1000.0
    first: float = 13.37
    ppm: float = 0.0
    slope: float = 0.0
    cycles: int = 160
    symbols: int = 200
    data: npt.NDArray[np.bool_] | None = None
    shift: Callable[[float], tuple[float, float]] = lambda tick: (0.0, 0.0)
    seed: int = 7
    hard: bool = True

    def __post_init__(self) -> None:
        self.layout = Layout(self.mode)
        if self.homography is None:
            self.homography = panel_homography(self.layout, self.shape, 1.02, 0.4)
        rng = np.random.default_rng(self.seed)
        n = self.layout.cells
        if self.data is None:
            self.data = np.concatenate(
                [training(n), rng.integers(0, 2, (max(self.symbols - TRAINING, 0), n)).astype(bool)]
            )[: self.symbols]
        self.rng = rng

    def cells(self, symbol: int) -> npt.NDArray[np.bool_]:
        """(rows, columns) of a symbol."""
        out = np.zeros(self.layout.shape, np.bool_)
        out[self.layout.pilot] = pilots()[symbol % PERIOD]
        out.ravel()[self.layout.data] = self.data[symbol]
        return out

    def panel(self, symbol: int) -> npt.NDArray[np.float32]:
        """(height, width) of 0 and 1."""
        mode, layout = self.mode, self.layout
        out = np.zeros((mode.height, mode.width), np.float32)
        big = self.cells(symbol).repeat(mode.cell, 0).repeat(mode.cell, 1)
        out[: big.shape[0], : big.shape[1]] = big
        book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        m, t = layout.module, layout.tag
        places = [(0, 0), (mode.width - t, 0), (mode.width - t, mode.height - t), (0, mode.height - t)]
        for tag, (x, y) in zip(mode.tags, places, strict=True):
            art = np.full((t, t), 1.0, np.float32)
            art[m:-m, m:-m] = cv2.aruco.generateImageMarker(book, tag, 8 * m) > 0
            out[y : y + t, x : x + t] = art
        return out

    def image(self, symbol: int, at: float) -> npt.NDArray[np.float32]:
        """Light on the camera, 0 to 1, four samples to a pixel's side."""
        n = 3
        dx, dy = self.shift(at)
        move = np.array([[1, 0, dx], [0, 1, dy], [0, 0, 1]], float)
        up = np.array([[n, 0, (n - 1) / 2], [0, n, (n - 1) / 2], [0, 0, 1]], float)
        h, w = self.shape
        fine = cv2.warpPerspective(
            self.panel(symbol), up @ move @ self.homography, (w * n, h * n), flags=cv2.INTER_NEAREST
        )
        if self.blur:
            fine = cv2.GaussianBlur(fine, (0, 0), self.blur * n)
        return cv2.resize(fine, (w, h), interpolation=cv2.INTER_AREA)

    def planes(self) -> npt.NDArray[np.bool_]:
        """(cycles, height, width) spikes."""
        h, w = self.shape
        row = np.arange(h)[:, None]
        period = self.mode.ticks * (1 - self.ppm * 1e-6)
        charge = np.zeros(self.shape)
        out = np.zeros((self.cycles, h, w), np.bool_)
        held: dict[int, npt.NDArray[np.float32]] = {}
        for k in range(self.cycles):
            light = np.zeros(self.shape)
            late = self.slope * row / h
            low = int(np.floor((k - self.first - max(self.slope, 0)) / period)) - 1
            high = int(np.floor((k + 1 - self.first - min(self.slope, 0)) / period)) + 1
            for n in range(max(low, 0), min(high, self.symbols - 1) + 1):
                begin = self.first + n * period + late
                share = np.clip(np.minimum(begin + period, k + 1) - np.maximum(begin, k), 0, 1)
                if share.any():
                    if n not in held:
                        held[n] = self.image(n, self.first + (n + 0.5) * period)
                    light += share * held[n]
            held = {n: v for n, v in held.items() if n >= low}
            mean = (self.on * light + self.background) * self.electrons
            charge += self.rng.poisson(mean) / self.electrons
            fired = charge >= 1
            out[k] = fired
            charge[fired] = 0 if self.hard else charge[fired] % 1
        return out

    def stream(self) -> Viform:
        """As a camera gives it."""
        return Viform.from_planes(self.planes(), CLOCK)


@pytest.fixture
def toy() -> type[Toy]:
    """The small link."""
    return Toy
