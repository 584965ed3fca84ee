"""The stage before the camera: symbols on the panel become illuminance on the camera's pixels."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Block, Light, Piece, Plane
from cosim.compute.cores import cores
from cosim.compute.stopping import threads
from link.air.emission import Emission, Source
from link.air.geometry import image_of, lengths
from link.air.kernel import Psf
from link.air.motion import vibration
from link.air.projection import Places, cut, projection_of
from link.air.radiometry import halo_angle, levels, sun_glare, sun_image
from link.air.scintillation import FlickerSeries, flicker_of
from link.air.setting import NAMES, Optics, Scene, simplified
from link.timing import Registration
from sensor import CameraSetting

_AROUND: Final = 2
"""Cycles of light before and after a block. Camera rows sample up to one cycle after the first row;
panel rows are shown up to one of their cycles after the first."""
_FOREVER: Final = 1 << 61
_TOGETHER: Final = 8
"""Planes that are made at once, at most: each takes memory of its own."""
_COARSE: Final = 8
"""Size of a pixel of the coarse grid that a wide halo is computed on, camera pixels."""
_NONE: Final = np.zeros((0, 0), np.float32)


def lens_psf(optics: Optics, distance: float, defocus: bool = True) -> Psf:
    """Point spread function of the lens at the panel's distance."""
    at_panel = lengths(optics, distance)
    cutoff = None
    if optics.diffraction:
        working = optics.f_number * at_panel.extension
        cutoff = optics.camera_pitch / (optics.wavelength_nm * 1e-9 * working)
    return Psf(optics.blur, at_panel.disc if defocus else 0.0, cutoff)


@njit(cache=True, nogil=True)
def _shine(plane, factors, bands, offset, hidden, weights, pad, out):  # type: ignore[no-untyped-def]
    """Fills the inside of `out` with the light of a panel's plane.

    Args:
        plane: (h, w), 1 for a pixel that is on.
        factors: (rows of patches, w) float32, light of a pixel that is on.
        bands: (rows of patches + 1,) first row of each, and the end.
        offset: light of every pixel, float32.
        hidden: number of columns that are covered.
        weights: (h, w) float32; (0, 0) for none.
        pad: rows and columns around the inside.
        out: (h + 2 pad, w + 2 pad) float32; the output.

    Returns:
        Sum of weights x light.
    """
    width, total = plane.shape[1], 0.0
    for band in range(len(factors)):
        for row in range(bands[band], bands[band + 1]):
            line, by, on = out[row + pad, pad:][:width], factors[band], plane[row]
            for column in range(width):
                line[column] = np.float32(on[column]) * by[column] + offset
            line[:hidden] = 0.0
            if weights.size:
                weight = weights[row]
                a = b = c = d = 0.0  # four sums, which do not wait for each other
                for column in range(0, width - 3, 4):
                    a += weight[column] * line[column]
                    b += weight[column + 1] * line[column + 1]
                    c += weight[column + 2] * line[column + 2]
                    d += weight[column + 3] * line[column + 3]
                for column in range(width - width % 4, width):
                    a += weight[column] * line[column]
                total += (a + b) + (c + d)
    return total


@njit(cache=True, nogil=True)
def _finish(image, base, glare, mean, stray):  # type: ignore[no-untyped-def]
    """Adds the base and the veiling glare to an image, in place.

    image = max(image + base, 0); then (1 - glare) image + glare mean + stray.

    Args:
        image, base: (h, w) float32, lux.
        glare: share of the light that the lens spreads over the whole image.
        mean: mean of the whole image, lux; NaN if `image` is the whole image.
        stray: illuminance added everywhere, lux.
    """
    if np.isnan(mean):
        total = 0.0
        for row in range(image.shape[0]):
            line = np.float64(0)
            for column in range(image.shape[1]):
                line += max(image[row, column] + base[row, column], np.float32(0))
            total += line
        mean = total / image.size
    keep, add = np.float32(1 - glare), np.float32(glare * mean + stray)
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            value = max(image[row, column] + base[row, column], np.float32(0))
            image[row, column] = keep * value + add


class Air:
    """Illuminance of the camera's pixels, block by block: a stage without input.

    The light follows the time of the panel's rows; `row_delay` gives the delay at each camera row.
    Vibration and scintillation are constant within a symbol. An occluder is as bright as the
    surroundings. `panel.pulse` must be 1. `panel.fill` and `panel.luminance` are not read: light is
    even over a panel pixel, of luminance `optics.luminance`.

    Attributes:
        shape: (height, width) of the camera.
        symbols: number of symbols of the transmission; the last one may be cut short.
        shifts: (symbols, 2) float64, shift of the image by vibration, camera pixels.
        flicker: law of the scintillation.
        patches: parts of the panel that scintillate independently.
        factors: factor of the panel's light for each symbol, (patches,) float64 each.
    """

    def __init__(
        self,
        source: Source,
        scene: Scene,
        camera: CameraSetting,
        *,
        first_light: int,
        planes: int,
        effects: Collection[str] | None = None,
        places: Places | None = None,
    ) -> None:
        """Prepares the stage.

        Args:
            source: the symbols that the panel shows.
            scene: panel, optics, aim and air.
            camera: the camera that films the panel.
            first_light: start of plane 0 in the panel's first row, ps.
            planes: length of the transmission, planes; the panel is dark before and after it.
            effects: names of the effects to simulate (`link.air.NAMES`), None for all.
            places: patches of the camera, as in `projection.cut`, if only these are computed. Their
                light has the same bits as on the whole plane. Where each pixel depends on the whole
                image (fog halo, wide blur), the whole image is computed and then cut.
        """
        panel, optics = scene.panel, scene.optics
        if panel.shape != (optics.height, optics.width):
            raise ValueError(f"panel must be {optics.height, optics.width}, not {panel.shape}")
        if panel.pulse != 1:
            raise ValueError(f"panel.pulse must be 1, not {panel.pulse}")
        if planes < 1 or first_light < 0:
            raise ValueError(f"planes must be 1 or more from 0 ps on, not {planes}, {first_light}")
        names = frozenset(NAMES if effects is None else effects)
        scene = simplified(scene, names)
        panel, optics, aim, air = scene.panel, scene.optics, scene.aim, scene.air
        self._ticks, self._planes, self._first = source.ticks, planes, first_light
        self._panel, self._clock = panel, camera.clock
        self.shape = shape = camera.chip.height, camera.chip.width
        self.symbols = -(-planes // source.ticks)
        self._levels = level = levels(optics, air, names)
        self._psf = lens_psf(optics, air.distance, "defocus" in names)
        self._homography = image_of(optics, aim, air, shape)
        self._projection = projection_of(self._homography, panel.shape, shape, self._psf)
        self._emission = Emission(source, panel, planes)
        seconds = source.ticks / panel.clock.hz
        self.shifts = vibration(
            aim.vibration, aim.vibration_frequency, seconds, self.symbols, air.seed
        )
        self.flicker, self.patches = flicker_of(optics, air)
        self.factors = FlickerSeries(self.flicker, seconds, self.patches.count, air.seed)
        self._hidden, self._blocked = round(aim.occluded * optics.width), aim.blocked
        self._glare, self._stray = air.glare, sun_glare(optics, air, aim, shape)
        self._halo = lengths(optics, air.distance).camera * halo_angle(optics.wavelength_nm)
        self._base = np.full(shape, level.around + level.fog, np.float32)
        if air.sun > 0:
            visible = 1 - self._projection(np.ones(panel.shape, np.float32))
            self._base += sun_image(optics, aim, air, shape) * np.clip(visible, 0, 1)
        # Weights of the panel's pixels in the image's mean, which veiling glare depends on.
        self._weights = None
        if level.halo <= 0 and not self._projection.wide:
            self._weights, self._base_sum = self._projection.weights, float(self._base.sum())
        self._places = places
        if places is not None and self._weights is not None:
            self._base = cut(self._base, places)
        self._pieces: dict[int, tuple[Piece, ...]] = {}
        self._resume = 0
        end = first_light + panel.clock.edge(planes)
        dark = self._lux(np.zeros(panel.shape, np.bool_), (0.0, 0.0), np.ones(self.patches.count))
        self._dark = dark
        if self._blocked:
            hidden, self._hidden = self._hidden, optics.width
            off = np.zeros(panel.shape, np.bool_)
            self._dark = self._lux(off, (0.0, 0.0), np.ones(self.patches.count))
            self._hidden = hidden
        self._before = Piece(0, first_light, dark, dark) if first_light > 0 else None
        self._after = Piece(end, max(end + 1, _FOREVER), dark, dark)

    @property
    def truth(self) -> Registration:
        """Geometry of the panel's pixels in the image, without vibration."""
        blur = float(np.hypot(self._psf.sigma, self._psf.disc / 2))
        return Registration(self._homography.copy(), np.zeros((0, 3)), blur)

    @property
    def row_delay(self) -> npt.NDArray[np.int64]:
        """(H,) int64 ps: delay of the light at each camera row after the panel's first row.

        The delay is that of the panel row which the camera row images in the middle column of the
        panel. If the panel is rotated about the line of sight, the other columns of the row deviate
        by up to row_scan sin(rotation) of a tick over the panel.
        """
        inverse, rows = np.linalg.inv(self._homography), np.arange(self.shape[0])
        height, width = self._panel.shape
        u, _, w = self._homography @ np.array([(width - 1) / 2, (height - 1) / 2, 1.0])
        _, y, t = inverse @ np.stack([np.full(len(rows), u / w), rows, np.ones(len(rows))])
        row = np.clip(y / t, 0, height - 1)
        return np.rint(row / height * self._panel.row_delay).astype(np.int64)

    def shift(self, ps: int) -> tuple[float, float]:
        """Shift (dx, dy) of the image by vibration at an instant, camera pixels."""
        symbol = self._symbol(ps)
        if not 0 <= symbol < self.symbols:
            return 0.0, 0.0
        dx, dy = self.shifts[symbol]
        return float(dx), float(dy)

    def step(self, data: Any, block: Block) -> Light:
        """Illuminance over the block and two cycles on either side, from instant 0 on."""
        start = max(self._clock.edge(block.start - _AROUND), 0)
        stop = self._clock.edge(block.stop + _AROUND)
        first = min(max(self._symbol(start), 0), self.symbols)
        last = min(self._symbol(stop - 1) + 1, self.symbols)
        pieces = [self._before] if self._before is not None and start < self._first else []
        pieces.extend(self._made(range(first, last)))
        if stop > self._after.start:
            pieces.append(self._after)
        self._pieces = {n: piece for n, piece in self._pieces.items() if n >= first}
        self._resume = self._symbol(self._clock.edge(block.stop - _AROUND))
        return Light(tuple(pieces))

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """All state that the next block depends on."""
        return self._emission.state(min(max(self._resume, 0), self.symbols))

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Continues from a `state`."""
        self._pieces.clear()
        self._emission.restore(state)

    def _symbol(self, ps: int) -> int:
        """Symbol in the panel's first row at an instant; before and after the transmission the
        number continues."""
        return self._panel.clock.cycle_at(ps - self._first) // self._ticks

    def _made(self, symbols: Sequence[int]) -> list[Piece]:
        """Pieces of symbols. Those that are not there are made on all cores."""
        with threads(min(cores(), _TOGETHER), "air") as pool:
            made = {}
            for symbol in symbols:
                if symbol not in self._pieces:
                    start, shown = self._edge(symbol * self._ticks), self._emission.planes(symbol)
                    given = self.shift(start), self.factors[symbol]
                    hidden = any(low <= start < high for low, high in self._blocked)
                    made[symbol] = [pool.submit(self._seen, each, hidden, *given) for each in shown]
            for symbol, planes in made.items():
                begin = symbol * self._ticks
                stop = min(begin + self._ticks, self._planes)
                edges = range(begin, stop + 1) if len(planes) > 1 else (begin, stop)
                at = [self._edge(n) for n in edges]
                self._pieces[symbol] = tuple(
                    Piece(one, two, lux, lux)
                    for one, two, lux in zip(
                        at[:-1], at[1:], (each.result() for each in planes), strict=True
                    )
                )
        return [piece for symbol in symbols for piece in self._pieces[symbol]]

    def _seen(
        self, plane: npt.NDArray[Any], hidden: bool, shift: tuple[float, float],
        factors: npt.NDArray[np.float64],
    ) -> Plane:  # fmt: skip
        return self._dark if hidden else self._lux(plane, shift, factors)

    def _edge(self, plane: int) -> int:
        return self._first + self._panel.clock.edge(plane)

    def _lux(
        self, plane: npt.NDArray[Any], shift: tuple[float, float], factors: npt.NDArray[np.float64]
    ) -> Plane:
        """Illuminance while the panel shows this plane.

        Args:
            plane: (height, width) of the panel, 1 for a pixel that is on.
            shift: (dx, dy) of the image, camera pixels.
            factors: (patches,) scintillation factors.
        """
        level, weighed = self._levels, 0.0
        by = self.patches.columns(level.panel * factors)
        # The difference from the surroundings is projected, so that the panel's edge is correct.
        offset = np.float32(level.face - level.around)
        weights = _NONE if self._weights is None else self._weights

        def shine(padded: npt.NDArray[np.float32], pad: int) -> None:
            nonlocal weighed
            weighed = _shine(
                plane, by, self.patches.bands, offset, self._hidden, weights, pad, padded
            )

        if self._weights is None:
            return self._whole(self._projection.image(shine, shift))
        image = self._projection.image(shine, shift, self._places)
        mean = max(self._base_sum + weighed, 0.0) / (self.shape[0] * self.shape[1])
        _finish(image, self._base, self._glare, mean, self._stray)
        return image

    def _whole(self, image: Plane) -> Plane:
        """`_lux` where light spreads over many pixels: from the whole image, then its patches."""
        level, base = self._levels, self._base
        if level.halo > 0:
            share = level.halo / level.dimmed
            base = base + share * (self._spread(image) + level.around)
        _finish(image, base, self._glare, math.nan, self._stray)
        return image if self._places is None else cut(image, self._places)

    def _spread(self, image: Plane) -> Plane:
        """Image after forward scattering by fog, computed on a coarse grid."""
        import cv2

        height, width = image.shape
        size = max(width // _COARSE, 1), max(height // _COARSE, 1)
        coarse = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        sigma = max(self._halo * size[0] / width, 0.5)
        coarse = cv2.GaussianBlur(coarse, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
        wide = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
        return np.asarray(wide, np.float32)
