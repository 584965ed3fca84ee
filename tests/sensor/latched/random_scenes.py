"""Random small scenes and cameras, for tests of bounds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cosim import PS, Clock, Light, Piece, Summary
from cosim.compute.opencl import Device
from cosim.plan.tiles import TILE, PatchPlane, TileGrid
from sensor import CHIPS, CameraSetting
from sensor.device.pattern import DevicePattern
from sensor.latched.fine_tiles import PatchCamera
from sensor.latched.tiers import Tier

CLOCK = Clock.from_hz(40e3)
PERIOD = PS // 40_000


@dataclass(frozen=True, eq=False)
class Scene:
    """One tile: its camera with all effects, its light on the chip, and its summary."""

    setting: CameraSetting
    plane: PatchPlane
    light: Light
    window: tuple[int, int]
    cycles: int
    summary: Summary


def random_scene(seed: int) -> Scene:
    """A scene with Q = 1 to 1e5 electrons, from dark to saturated, constant or changing."""
    rng = np.random.default_rng(seed)
    chip = replace(CHIPS["spiketwo"], width=3 * TILE, height=3 * TILE)

    def some(low: float, high: float, chance: float = 0.6) -> float:
        """Nothing, or a size from low to high, evenly in its logarithm."""
        return float(10 ** rng.uniform(np.log10(low), np.log10(high))) * (rng.random() < chance)

    q = float(10 ** rng.uniform(0, 5))
    pattern = DevicePattern(
        prnu=some(1e-4, 0.1), dark=some(1, 1e5), dsnu=some(0.05, 0.5),
        threshold_fpn=some(1e-4, 0.1), hot=some(1e-4, 1e-2, 0.3),
        hot_current=some(1e3, 1e6), dead=some(1e-5, 1e-2, 0.3), device_seed=seed,
    )  # fmt: skip
    setting = CameraSetting(
        chip, CLOCK, q, seed, pattern=pattern, threshold_noise=q * some(1e-4, 0.1),
        dead_time=some(1e-9, 2e-5), row_skew=some(1e-2, 1), comparator_delay=some(1e-9, 1e-5),
        crosstalk=some(1e-4, 0.1), overshoot=q * some(1e-3, 0.3, 0.3),
        leak=-q * 40e3 * some(1e-7, 1e-4, 0.3),
    )  # fmt: skip
    if rng.random() < 0.4:
        setting = setting.without(["shot noise"])
    if rng.random() < 0.3:
        setting = setting.without(["shot noise", "threshold noise"])
    if rng.random() < 0.4:
        setting = replace(setting, pattern=None)
    per_lux = setting.electrons_per_lux * float(CLOCK.period)
    mean = q * 10 ** rng.uniform(-2.5, 0.5) / per_lux
    shape = (chip.height, chip.width)
    y, x = np.mgrid[: shape[0], : shape[1]] / shape[0]
    texture = 1 + rng.uniform(0, 0.9) * np.sin(
        2 * np.pi * (rng.uniform(0, 12) * x + rng.uniform(0, 12) * y)
    )
    first = (mean * texture).astype(np.float32)
    last = first if rng.random() < 0.5 else (first[:, ::-1] * np.float32(rng.uniform(0.2, 2)))
    cycles = int(rng.integers(60, 300))
    last = np.ascontiguousarray(last)  # `first` itself where the light is constant
    pieces = (
        Piece(-PERIOD, cycles * PERIOD // 3, first, first),
        Piece(cycles * PERIOD // 3, cycles * PERIOD // 2 + 777, first, last),
        Piece(cycles * PERIOD // 2 + 777, 2**60, last, last),
    )
    width = int(rng.integers(10, 50))
    start = int(rng.integers(0, cycles - width))
    grid = TileGrid(*shape)
    plane = PatchPlane(grid, [4])
    box = grid.box(4)
    near = (slice(box[0] - 1, box[1] + 1), slice(box[2] - 1, box[3] + 1))
    low, high = (
        how(first[near].astype(float), last[near].astype(float)) for how in (np.minimum, np.maximum)
    )
    changing = pieces[1].stop - pieces[1].start
    dark = 0.0
    if setting.pattern is not None:
        dark = setting.pattern.dark * float(CLOCK.period) * (1 + 4 * setting.pattern.dsnu)
    summary = Summary(
        np.array([low.min() * per_lux]), np.array([high.max() * per_lux + dark]), q, width, cycles,
        1 / width, setting.spread, planes=float(last is not first), slack=setting.slack,
        dead=setting.dead_time * CLOCK.hz, uneven=setting.uneven,
        slope=np.array([(high - low).max() * per_lux * PERIOD / changing]),
        moved=np.array([(high - low).max() * per_lux]),
    )  # fmt: skip
    return Scene(setting, plane, Light(pieces), (start, start + width), cycles, summary)


def rates(
    scene: Scene, setting: CameraSetting, tier: Tier = "exact", device: Device | None = None
) -> np.ndarray:
    """Spikes a cycle of each pixel in the window."""
    camera = PatchCamera(setting, scene.plane, tier, device)
    cut = Light(tuple(_cut(scene.plane, scene.light)))
    marks, at = [], 0
    for edge in scene.window:  # what comes after it changes nothing
        if edge > at:
            camera.step(cut, at, edge - at)
        at = edge
        marks.append((camera.phase(), camera.bits.copy()))
    (p0, b0), (p1, b1) = marks[:2]
    n = scene.window[1] - scene.window[0]
    return np.where(b1 - b0 == n, 1.0, (p1 - p0) / n)


def _cut(plane: PatchPlane, light: Light) -> list[Piece]:
    planes = {id(p): plane.cut(p) for piece in light.pieces for p in (piece.first, piece.last)}
    return [Piece(p.start, p.stop, planes[id(p.first)], planes[id(p.last)]) for p in light.pieces]
