"""The measurements of `viform bench code`, and its scenes, from static to entirely moving, on a
small grid.

The share of pixels whose light changes in a given time does not depend on the resolution: on a grid
n times coarser, edges cover an n times larger share of the pixels and move n times slower.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from cosim import Box, Clock, Plane, SpikeStream, Viform
from cosim.compute.opencl import Device
from cosim.light.source import Source
from cosim.spikes.viform import count_spikes
from cosim.stage import blocks
from scenarios.scenes.catalogue import SceneSection
from scenarios.scenes.drawing.analytic import AnalyticSource
from scenarios.scenes.kinds.film import FilmScene
from scenarios.scenes.kinds.grid import SceneGrid
from scenarios.scenes.kinds.star import StarScene
from scenarios.scenes.kinds.step import StepScene
from scenarios.scenes.kinds.wave import WaveScene
from sensor import CHIPS, EFFECTS, CameraSetting, SpikeCamera, make_pixels, tfi, tfp
from sensor.codec import Code, entropy_bounds, event_rate, recode
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.coder import from_packets, size_of, to_packets
from sensor.codec.size import REFINE, coded_size, zstd_size
from sensor.latched.effects import SHOT_NOISE
from sensor.latched.pixel.charge import Span, to_fixed
from sensor.latched.pixel.model import ExactModel
from sensor.reconstruct.fidelity import psnr, to_white

SHAPE = (96, 128)
CYCLES = 2560
CLOCK = Clock(40_000)
WHITE = 0.6
"""Spike rate of white, spikes a cycle."""
SCENES = {
    "step": "still: grey bars, after their step",
    "workbench": "a fan, a disc and a ball on a still bench",
    "wave": "a person waves an arm",
    "star": "a turning star in a still chart",
    "pan": "everything moves: a texture that pans",
}
_GRATINGS = ((1 / 31, 1 / 47), (1 / 17, -1 / 53), (1 / 71, 1 / 11))
"""Frequencies of the gratings along rows and columns, cycles per pixel. All have a component along
the motion, so that every pixel changes."""
THRESHOLDS = (100.0, 1000.0, 30_000.0)
KS = (1.0, 2.0, 3.0, 5.0)
RUNGS = (1, 3, 5, 6, 7, 8)
"""Numbers of layers of the layered code."""
INSTANTS = (320, 1280, 2240)
WINDOW = 41
MEANS = (4.3, 20.3)
"""Mean intervals of steady light, ticks; they are neither integers nor simple fractions."""
STEADY_PIXELS, STEADY_CYCLES = 256, 131_072


class Pan:
    """A texture of gratings in three directions that moves along the rows at `speed`, pixels/s;
    implements `AnalyticScene`."""

    def __init__(self, shape: tuple[int, int], speed: float = 800.0) -> None:
        self.shape, self._speed = shape, speed
        self._y, self._x = (g.astype(np.float32) for g in np.mgrid[: shape[0], : shape[1]])

    def reflectance(self, t: float) -> Plane:
        x = self._x + np.float32(self._speed * t)
        waves = sum(np.sin(2 * np.pi * (x * u + self._y * v)) for u, v in _GRATINGS)
        return np.asarray(0.5 + 0.48 / len(_GRATINGS) * waves, np.float32)

    def speed(self) -> float:
        return self._speed

    def moving(self, start: float, stop: float) -> Box:
        return (0, self.shape[0], 0, self.shape[1])

    def points(self) -> list[tuple[int, int, str]]:
        return [(0, 0, "a corner")]


def camera(threshold: float, shot: bool) -> CameraSetting:
    """The camera of the bench: the pixel of SpikeTwo on a small grid, with or without shot
    noise."""
    chip = replace(CHIPS["spiketwo"], width=SHAPE[1], height=SHAPE[0])
    effects = tuple(e for e in EFFECTS.values() if shot or e is not SHOT_NOISE)
    return CameraSetting(chip, CLOCK, threshold, 1, effects=effects)


def open_scene(name: str, setting: CameraSetting) -> Source:
    """A scene under the light at which white fires at WHITE."""
    lux = WHITE / setting.rate(1.0)
    light = {"illuminance": f"{lux!r} lux"}
    if name == "pan":
        return AnalyticSource(Pan(SHAPE), lux, CLOCK)
    sections: dict[str, Callable[[], SceneSection]] = {
        "step": lambda: StepScene.model_validate({"kind": "step", "at": "0 s", **light}),
        "workbench": lambda: FilmScene.model_validate(light),
        "wave": lambda: WaveScene.model_validate({"kind": "wave", **light}),
        "star": lambda: StarScene.model_validate({"kind": "star", **light}),
    }
    return sections[name]().source(SceneGrid(SHAPE, CLOCK, CYCLES))


def film(source: Source, setting: CameraSetting, device: Device | None) -> Viform:
    """The whole stream of a scene."""
    lens_free = SpikeCamera(setting, device)
    parts = [lens_free.step(source.step(None, block), block).words for block in blocks(CYCLES)]
    return Viform(np.concatenate(parts), CYCLES, CLOCK)


def truth(source: Source, cycle: int) -> Plane:
    """Reflectance in the middle of a cycle, (H, W)."""
    return source.truth(CLOCK.middle(cycle))


@dataclass(frozen=True)
class SizeRow:
    """Sizes of one stream in every format, bits per pixel and cycle.

    Attributes:
        scene: name of the scene.
        threshold: threshold Q, e.
        shot_noise: whether the light has shot noise.
        spike_rate: mean spike rate, spikes per pixel and cycle.
        zstd: size of the three layouts at level 3, and of the best of them at level 19.
        events: size of every spike as (i, j, t), sorted by time.
        repeat, line: size of the bits of the code.
        repeat_zstd, line_zstd: the same with zstd 3 where it is smaller.
        sent: number of spikes in each code over the spikes of the stream, by name.
        statistical: sizes of the statistical codes, by name.
        layered: sizes of the layered code with its first layers, by their number.
        psnr: PSNR of TFP and TFI after each statistical code and each number of layers, dB.
    """

    scene: str
    threshold: float
    shot_noise: bool
    spike_rate: float
    zstd: dict[str, float]
    events: float
    repeat: float
    repeat_zstd: float
    line: float
    line_zstd: float
    sent: dict[str, float]
    statistical: dict[str, float]
    layered: dict[str, float]
    psnr: dict[str, dict[str, float]]


@dataclass(frozen=True)
class SteadyRow:
    """Sizes for steady light, bits per spike.

    Attributes:
        mean: mean interval, ticks.
        threshold: threshold Q, e.
        floor, ceiling: lower and upper bound of the entropy of latched intervals.
        zstd: size with zstd 19.
        repeat, line: sizes of the codes.
        predicted, measured: share of spikes in the statistical code, by k, without the first two
            spikes of each pixel.
        level_error: relative RMS error of a pixel's mean rate in the stream and after the
            statistical codes, by name.
    """

    mean: float
    threshold: float
    floor: float
    ceiling: float
    zstd: float
    repeat: float
    line: float
    predicted: dict[str, float]
    measured: dict[str, float]
    level_error: dict[str, float]


def _codes(threshold: float) -> dict[str, Code]:
    """The statistical codes in the comparison, by name."""
    codes = {f"k{k:g}": Code("statistical", k, threshold) for k in KS}
    return codes | {
        f"k{k:g}r": Code("statistical", k, threshold, refine=REFINE) for k in (3.0, 5.0)
    }


def event_bits(stream: SpikeStream, spikes: int) -> float:
    """Size of all spikes as events of fixed size, sorted by time, bits per pixel and cycle: one
    address for each spike, and one mark for each cycle."""
    places = math.ceil(math.log2(stream.shape[0] * stream.shape[1] + 1))
    return (spikes + stream.cycles) * places / (stream.cycles * stream.shape[0] * stream.shape[1])


def _fidelity(stream: SpikeStream, source: Source) -> dict[str, float]:
    """Mean PSNR of TFP and TFI over the instants, dB."""
    quality: dict[str, list[float]] = {"tfp": [], "tfi": []}
    for cycle in INSTANTS:
        light = truth(source, cycle)
        quality["tfp"].append(psnr(to_white(tfp(stream, cycle, WINDOW), WHITE), light))
        quality["tfi"].append(psnr(to_white(tfi(stream, cycle), WHITE), light))
    return {name: float(np.mean(values)) for name, values in quality.items()}


def _size_row(scene: str, threshold: float, shot: bool, device: Device | None) -> SizeRow:
    setting = camera(threshold, shot)
    stream = film(open_scene(scene, setting), setting, device)
    source = open_scene(scene, setting)
    spikes = int(np.bitwise_count(stream.words).sum(dtype=np.int64))
    zstd = {f"{name}_3": size for name, size in zstd_size(stream, 3).items()}
    best = min(zstd, key=lambda name: zstd[name]).removesuffix("_3")
    zstd["best_19"] = zstd_size(stream, 19, (best,))[best]
    sizes, sent = {}, {}
    for name in ("repeat", "line"):
        first = Code("repeat") if name == "repeat" else Code("line")
        sizes[name], events = coded_size(stream, first, None)
        sizes[f"{name}_zstd"], _ = coded_size(stream, first)
        sent[name] = events / max(spikes, 1)
    statistical, quality = {}, {"stream": _fidelity(stream, source)}
    for name, lossy in _codes(threshold).items():
        statistical[name], events = coded_size(stream, lossy)
        sent[name] = events / max(spikes, 1)
        quality[name] = _fidelity(recode(stream, lossy), source)
    layered, code = {}, StreamCode()
    packets = to_packets(stream, code)
    for layers in RUNGS:
        kept = [packet for packet in packets if packet.layer < layers]
        layered[f"{layers}"] = size_of(kept, stream)
        quality[f"{layers}"] = _fidelity(from_packets(kept, stream, code), source)
    return SizeRow(
        scene, threshold, shot, spikes / (CYCLES * SHAPE[0] * SHAPE[1]), zstd,
        event_bits(stream, spikes), sizes["repeat"], sizes["repeat_zstd"], sizes["line"],
        sizes["line_zstd"], sent, statistical, layered, quality,
    )  # fmt: skip


def steady(mean: float, threshold: float, device: Device | None) -> SteadyRow:
    """Measures pixels under steady light with shot noise.

    Args:
        mean: mean interval, ticks.
        threshold: threshold Q, e.
        device: OpenCL device, None for numba.
    """
    model = ExactModel(threshold, 1, tuple(EFFECTS.values()))
    numbers = np.arange(STEADY_PIXELS, dtype=np.uint32)
    charge = np.broadcast_to(to_fixed(np.array([threshold / mean])), numbers.shape).copy()
    words = make_pixels(model, numbers, device).expose(
        [Span(0, STEADY_CYCLES, charge)], STEADY_CYCLES
    )
    stream = Viform(words.reshape(len(words), 1, -1), STEADY_CYCLES, camera(1.0, True).clock)
    spikes = int(np.bitwise_count(words).sum(dtype=np.int64))
    cycles = STEADY_CYCLES * STEADY_PIXELS
    floor, ceiling = entropy_bounds(mean, threshold)
    predicted, measured, errors = {}, {}, {"stream": _level_error(stream, mean)}
    for name, code in _codes(threshold).items():
        _, events = coded_size(stream, code, None)
        # The first spike of each pixel, whose interval began before the stream, and the second one
        # are not counted.
        measured[name] = max(events - 2 * STEADY_PIXELS, 0) / spikes
        if not code.refine:
            predicted[name] = event_rate(mean, threshold, code.k)
        errors[name] = _level_error(recode(stream, code), mean)
    best = zstd_size(stream, 19, ("pixel",))["pixel"]
    sizes = {
        code.name: coded_size(stream, code)[0] * cycles / spikes
        for code in (Code("repeat"), Code("line"))
    }
    return SteadyRow(
        mean, threshold, floor, ceiling, best * cycles / spikes, sizes["repeat"], sizes["line"],
        predicted, measured, errors,
    )  # fmt: skip


def _level_error(stream: SpikeStream, mean: float) -> float:
    """Relative RMS error of the pixels' rates over the whole stream."""
    rate = count_spikes(stream, 0, stream.cycles) / stream.cycles
    return float(np.sqrt(np.mean((rate * mean - 1) ** 2)))


def bench_code(device: Device | None) -> dict[str, Any]:
    """The document of `viform bench code --json`."""
    sizes = [
        _size_row(scene, threshold, shot, device)
        for scene in SCENES
        for threshold, shot in [*((q, True) for q in THRESHOLDS), (THRESHOLDS[-1], False)]
    ]
    rows = [steady(mean, q, device) for mean in MEANS for q in THRESHOLDS]
    return {
        "device": device.name if device is not None else "numba on this processor",
        "shape": list(SHAPE),
        "cycles": CYCLES,
        "scenes": SCENES,
        "sizes": [asdict(row) for row in sizes],
        "steady": [asdict(row) for row in rows],
    }
