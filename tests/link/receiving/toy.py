"""A small link for the receiver's tests: planes warped, blurred, integrated by each row, fired."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cosim import Clock, Viform
from link.layout import Layout
from link.mode import Mode
from link.sending import FileTransmission, Transmission

CLOCK = Clock(40_000)
MODE = Mode(256, 256, 2, 2, "8b10b", 32)
FINE = 3


def still(tick: float) -> tuple[float, float]:
    """No vibration."""
    return 0.0, 0.0


def homography(
    mode: Mode, shape: tuple[int, int], scale: float, degrees: float, tilt: float = 0.0,
    offset: tuple[float, float] = (0.0, 0.0),
) -> npt.NDArray[np.float64]:  # fmt: skip
    """From panel to camera pixels: about both centres, turned clockwise, tilted about an axis."""
    w, h = mode.width, mode.height
    a = np.deg2rad(degrees)
    centre = np.array([[1, 0, -(w - 1) / 2], [0, 1, -(h - 1) / 2], [0, 0, 1]])
    turn = np.array(
        [
            [np.cos(a), -np.sin(a), 0],
            [np.sin(a), np.cos(a), 0],
            [tilt / w, -tilt / h / 2, 1 / scale],
        ]
    )
    middle = (shape[1] - 1) / 2 + offset[0], (shape[0] - 1) / 2 + offset[1]
    back = np.array([[1, 0, middle[0]], [0, 1, middle[1]], [0, 0, 1]])
    out = back @ turn @ centre
    return np.asarray(out / out[2, 2])


@dataclass
class Toy:
    """One link. on, background: thresholds a tick. first: tick of symbol 0 at row 0. before: the
    tick that the stream begins at. shift: of the image, camera pixels, by tick."""

    sent: Transmission
    shape: tuple[int, int]
    homography: npt.NDArray[np.float64]
    cycles: int
    blur: float = 0.5
    on: float = 1.4
    background: float = 0.02
    electrons: float = 1000.0
    first: float = 13.37
    ppm: float = 0.0
    slope: float = 0.0
    begin: int = 0
    shift: Callable[[float], tuple[float, float]] = still
    hidden: float = 0.0
    hard: bool = True
    seed: int = 7

    @property
    def layout(self) -> Layout:
        return self.sent.layout

    @property
    def period(self) -> float:
        """Ticks to a symbol."""
        return self.sent.ticks / (1 + self.ppm * 1e-6)

    def image(self, symbol: int) -> npt.NDArray[np.float32]:
        """Share of full light on the camera in a symbol."""
        dx, dy = self.shift(self.first + (symbol + 0.5) * self.period)
        move = np.array([[1, 0, dx], [0, 1, dy], [0, 0, 1]])
        up = np.array([[FINE, 0, (FINE - 1) / 2], [0, FINE, (FINE - 1) / 2], [0, 0, 1]])
        h, w = self.shape
        panel = self.sent.pixels(symbol).astype(np.float32)
        panel[:, : round(self.hidden * panel.shape[1])] = 0
        fine = cv2.warpPerspective(
            panel, up @ move @ self.homography, (w * FINE, h * FINE), flags=cv2.INTER_NEAREST
        )
        if self.blur:
            fine = cv2.GaussianBlur(fine, (0, 0), self.blur * FINE)
        return np.asarray(cv2.resize(fine, (w, h), interpolation=cv2.INTER_AREA), np.float32)

    def planes(self) -> npt.NDArray[np.bool_]:
        """(cycles, height, width) spikes."""
        rng = np.random.default_rng(self.seed)
        h, _ = self.shape
        late = self.slope * np.arange(h)[:, None] / h
        charge = np.zeros(self.shape, np.float32)
        out = np.zeros((self.cycles, *self.shape), np.bool_)
        held: dict[int, npt.NDArray[np.float32]] = {}
        for n in range(self.cycles):
            k = n + self.begin
            light = np.zeros(self.shape, np.float32)
            low = int(np.floor((k - self.first - max(self.slope, 0)) / self.period)) - 1
            high = int(np.floor((k + 1 - self.first - min(self.slope, 0)) / self.period)) + 1
            for s in range(max(low, 0), min(high, self.sent.symbols - 1) + 1):
                start = self.first + s * self.period + late
                share = np.minimum(start + self.period, k + 1) - np.maximum(start, k)
                if (share > 0).any():
                    if s not in held:
                        held[s] = self.image(s)
                    light += np.clip(share, 0, 1).astype(np.float32) * held[s]
            held = {s: image for s, image in held.items() if s >= low}
            mean = (self.on * light + self.background) * self.electrons
            noise = rng.standard_normal(self.shape, np.float32)
            charge += np.maximum(mean + noise * np.sqrt(mean), 0) / self.electrons
            fired = charge >= 1
            out[n] = fired
            charge[fired] = 0 if self.hard else charge[fired] % 1
        return out

    def stream(self) -> Viform:
        """As a camera gives it."""
        return Viform.from_planes(self.planes(), CLOCK)


def small(data: bytes = b"", mode: Mode = MODE, *, spare: int = 16, turn: float = 0.4,
          scale: float = 1.02, margin: int = 22, overhead: float = 0.3,
          rates: Sequence[int] = (), **given: object) -> Toy:  # fmt: skip
    """A panel of 256 x 256, somewhat larger in the image; the stream ends `spare` ticks late."""
    sent = FileTransmission(
        mode, data or bytes(range(256)) * 2, "a.bin", overhead=overhead, rates=rates
    )
    shape = (int(mode.height * scale) + 2 * margin, int(mode.width * scale) + 2 * margin)
    at = homography(mode, shape, scale, turn, 0.01, (1.3, -0.6))
    cycles = int(given.pop("cycles", 0)) or 14 + sent.planes + spare  # type: ignore[call-overload]
    return Toy(sent, shape, at, cycles, **given)  # type: ignore[arg-type]


def corner_error(
    found: npt.NDArray[np.float64], true: npt.NDArray[np.float64], mode: Mode
) -> float:
    """Largest distance of two homographies over the panel, camera pixels."""
    x, y = np.meshgrid(np.linspace(0, mode.width - 1, 9), np.linspace(0, mode.height - 1, 9))
    points = np.stack([x.ravel(), y.ravel()], 1)[None]
    off = cv2.perspectiveTransform(points, found) - cv2.perspectiveTransform(points, true)
    return float(np.hypot(*off[0].T).max())
