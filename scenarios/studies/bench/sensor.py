"""Throughput of the sensor against real time, the ceiling of this machine, and plain numpy.

All values of a row are measured in one process: one discarded call, then the minimum of repeated
calls. The plain implementation is efficient numpy code: float32, in place.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import asdict
from importlib.resources import files
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock
from cosim.compute.opencl import Device
from cosim.errors import MissingPackages
from cosim.light.light import Box, Light, Piece, Plane
from cosim.run.timing import BRIGHT, DARK, REAL_TIME, REPEATS, TimingRow, least
from cosim.spikes.viform import words_for
from display import GL_INSTALL, probe_gl
from display.render.context import gl_packages
from scenarios.studies.bench.board import board_rows, readout_row
from scenarios.studies.bench.core import core_rows
from scenarios.studies.bench.display import display_rows, loop_rows
from scenarios.studies.bench.growth import THRESHOLD, growth_rows, planned_pixels
from scenarios.studies.bench.link import link_rows
from scenarios.studies.bench.view import view_rows
from sensor import CHIPS, EFFECTS, make_pixels
from sensor.device.pattern import DevicePattern, FixedPattern
from sensor.latched.effects import SHOT_NOISE
from sensor.latched.exposure import Exposure
from sensor.latched.fast import FastPixels, PixelArray
from sensor.latched.fast.units import BANK, NOISE
from sensor.latched.pixel.charge import Span, to_fixed
from sensor.latched.pixel.model import ExactModel

CYCLES = 512
PLAIN_CYCLES = 8
MEAN = 0.034
"""Mean spike rate of a drawn scene, spikes a cycle."""
BLOCK = 64
"""Length of a call for such a scene, cycles."""
BOX = (400, 500)
"""Rows and columns of the part that changes."""
MOVING = 10
"""Cycles between new planes of a scene that changes everywhere."""
PLANES = 32
"""Different planes of that scene: they come in turn, and no cache holds as many."""
SHORT = 24
"""Repetitions of its calls, which last milliseconds, so that one of them is undisturbed."""
MOVING_RATES, OVEREXPOSED = (0.1, 0.5), (0.9, 1.5)
"""Spikes a cycle of the darkest and brightest pixel of that scene, and of an overexposed one."""
STILL = 0.95
"""Share of the rows of a scene that do not change."""
UNLIT = 2.5e-6
"""Spikes a cycle from a dark current of 100 electrons a second."""
Call = Callable[[Light, int, int], Any]
"""Exposes the cycles from `start` to `start + cycles`; includes the transfer to the host."""
LARGE: Final = ("growth", "view")
"""Measurements that take minutes, much memory or gigabytes of disk, and are made on request
alone."""


def _ceiling(device: Device, n: int) -> float:
    """Throughput of the minimum work for a spike bit, pixel-cycles/s, for n pixels."""
    source = (files("sensor.latched.pixel") / "ceiling.cl").read_text(encoding="utf-8")
    kernel = device.kernel(source, "ceiling", ("-cl-std=CL1.2",))
    padded, n_words = -(-n // 16) * 16, words_for(CYCLES)
    phase, add = (
        device.upload(np.arange(padded, dtype=np.uint32) * k) for k in (2654435761, 40503)
    )
    words = device.upload(np.zeros((n_words, padded), np.uint32))

    def call() -> None:
        kernel(device.queue, (padded // 16,), None, phase, add, words, np.uint32(n_words))
        device.finish()

    return n * CYCLES / least(call)


def _rates(n: int) -> npt.NDArray[np.float64]:
    """Rates of a picture without edges: every brightness from dark to bright."""
    return np.linspace(DARK, BRIGHT, n)


def _exact(device: Device | None, n: int, *, noise: bool, ramp: bool) -> float:
    """Throughput of the exact tier for n pixels, with the transfer to the host, pixel-cycles/s."""
    effects = tuple(e for e in EFFECTS.values() if noise or e is not SHOT_NOISE)
    pixels = make_pixels(ExactModel(THRESHOLD, 1, effects), np.arange(n, dtype=np.uint32), device)
    charge = to_fixed(_rates(n) * THRESHOLD)
    slope = charge // (2 * CYCLES) if ramp else None
    spans = [Span(0, CYCLES, charge, slope)]
    return n * CYCLES / least(lambda: pixels.expose(spans, CYCLES))


def _plain(n: int, *, noise: bool, ramp: bool) -> float:
    """Throughput of the same in numpy, pixel-cycles/s: float32 charge, a flag array a cycle."""
    mean = (_rates(n) * THRESHOLD).astype(np.float32)
    slope = mean / (2 * CYCLES)
    charge, fired = np.zeros(n, np.float32), np.empty((PLAIN_CYCLES, n), np.bool_)
    random = np.random.default_rng(1)

    def call() -> None:
        add = mean.copy()
        for cycle in range(PLAIN_CYCLES):
            np.add(charge, random.poisson(add) if noise else add, out=charge, casting="unsafe")
            np.greater_equal(charge, THRESHOLD, out=fired[cycle])
            np.subtract(charge, THRESHOLD, out=charge, where=fired[cycle])
            if ramp:
                np.add(add, slope, out=add)

    return n * PLAIN_CYCLES / least(call, 3)


def _tiers(device: Device, noise: bool) -> dict[str, Call]:
    """Calls of both tiers, from light to words."""
    chip, clock = CHIPS["spiketwo"], Clock.from_hz(REAL_TIME)
    effects = tuple(e for e in EFFECTS.values() if noise or e is not SHOT_NOISE)
    model = ExactModel(THRESHOLD, 1, effects)
    numbers = np.arange(chip.width * chip.height, dtype=np.uint32)
    gain = THRESHOLD * REAL_TIME  # a unit of light is a threshold a cycle
    exposure, exact = Exposure(clock, gain), make_pixels(model, numbers, device)
    array = PixelArray(model, (chip.height, chip.width), numbers, clock, gain)
    fast = FastPixels(array, device)
    return {
        "exact": lambda light, start, cycles: exact.expose(
            exposure.spans(light, start, cycles), cycles
        ),
        "fast": fast.expose,
    }


def _rate(call: Call, light: Light, n: int, cycles: int, repeats: int | None = None) -> float:
    """Throughput of consecutive calls, each with new light, pixel-cycles/s."""
    start = -cycles

    def next_call() -> None:
        nonlocal start
        start += cycles
        call(light, start, cycles)

    return n * cycles / least(next_call, repeats or REPEATS)


def _smooth(shape: tuple[int, int], mean: float) -> npt.NDArray[np.float32]:
    """A smooth picture of two waves, from dark to twice the mean."""
    y, x = np.meshgrid(*(np.linspace(0, 2 * np.pi, n) for n in shape), indexing="ij")
    return (mean * (1 + np.sin(2 * x + y) * np.cos(y))).astype(np.float32)


def _scenes(shape: tuple[int, int]) -> dict[str, Light]:
    """Light at the mean rate of a drawn scene, by the name of the row: random, smooth, and smooth
    with a box that changes every two cycles."""
    random = np.random.default_rng(1).uniform(0, 2 * MEAN, shape).astype(np.float32)
    smooth, calls = _smooth(shape, MEAN), REPEATS + 1
    (h, w), tick = BOX, PS / REAL_TIME
    box = (shape[0] - h) // 2, (shape[0] + h) // 2, (shape[1] - w) // 2, (shape[1] + w) // 2
    inside = slice(*box[:2]), slice(*box[2:])
    planes = [smooth]
    for n in range(BLOCK // 2):
        planes.append(smooth.copy())
        planes[-1][inside] = np.roll(smooth, 8 * n, axis=1)[inside]
    edges = [round(2 * n * tick) for n in range(calls * BLOCK // 2 + 1)]
    levels = [planes[n % len(planes)] for n in range(len(edges))]
    moving = [
        Piece(*ends, *level, box)
        for ends, level in zip(itertools.pairwise(edges), itertools.pairwise(levels), strict=True)
    ]
    return {
        "sensor.noise-random": Light((Piece(0, PS, random, random),)),
        "sensor.noise-smooth": Light((Piece(0, PS, smooth, smooth),)),
        "sensor.noise-box": Light(tuple(moving)),
    }


def _random(shape: tuple[int, int], rates: tuple[float, float], seed: int) -> Plane:
    return np.random.default_rng(seed).uniform(*rates, shape).astype(np.float32)


def _bank_scenes(shape: tuple[int, int]) -> dict[str, tuple[Light, FixedPattern | None, int]]:
    """Light, fixed pattern and flags by the name of the row: the picture of `sensor.noise`; light
    that changes everywhere, or in STILL of the rows no more, with a fixed pattern; light near and
    above the threshold; and dark current alone, where every spike has a draw of its own."""
    n, tick = shape[0] * shape[1], PS / REAL_TIME
    picture = _rates(n).reshape(shape).astype(np.float32)
    bright = _random(shape, OVEREXPOSED, 1)
    edges = [round(MOVING * k * tick) for k in range((SHORT + 1) * BLOCK // MOVING + 2)]
    planes = [_random(shape, MOVING_RATES, k) for k in range(PLANES)]
    box = (0, round(shape[0] * (1 - STILL)), 0, shape[1])
    still = [planes[0].copy() for _ in planes]
    for plane, new in zip(still, planes, strict=True):
        plane[: box[1]] = new[: box[1]]

    def course(planes: list[Plane], box: Box | None) -> Light:
        ends, levels = itertools.pairwise(edges), itertools.pairwise(itertools.cycle(planes))
        return Light(
            tuple(Piece(*end, *level, box) for end, level in zip(ends, levels, strict=False))
        )

    pattern = DevicePattern(prnu=0.01, dark=0.1 * THRESHOLD, dsnu=0.1, device_seed=1)
    own = pattern.at(np.arange(n, dtype=np.uint32))
    dark = np.full(shape, UNLIT, np.float32)
    return {
        "sensor.noise": (Light((Piece(0, PS, picture, picture),)), None, BANK | NOISE),
        "sensor.noise-moving": (course(planes, None), own, BANK | NOISE),
        "sensor.noise-still": (course(still, box), own, BANK | NOISE),
        "sensor.noise-bright": (Light((Piece(0, PS, bright, bright),)), None, BANK | NOISE),
        "sensor.noise-dark": (Light((Piece(0, PS, dark, dark),)), None, NOISE),
    }


def _planned(
    device: Device, light: Light, pattern: FixedPattern | None, flag: int, cycles: int
) -> float:
    """Throughput of the fast tier with this flag in all groups, pixel-cycles/s."""
    pixels = planned_pixels(device, light.shape, flag, pattern)
    repeats = REPEATS if pattern is None else SHORT
    return _rate(pixels.expose, light, light.shape[0] * light.shape[1], cycles, repeats)


def _sensor(device: Device | None, ceiling: float | None) -> list[TimingRow]:
    chip = CHIPS["spiketwo"]
    shape, n = (chip.height, chip.width), chip.width * chip.height
    rows = []

    def row(name: str, tier: str, value: float, plain: float | None = None) -> None:
        rows.append(
            TimingRow(
                name, tier, value, "pixel-cycles/s", value / (n * REAL_TIME),
                value / ceiling if ceiling else None, value / plain if plain else None,
            )
        )  # fmt: skip

    for name, noise, ramp in (
        ("static", False, False),
        ("ramp", False, True),
        ("noise", True, False),
    ):
        plain = _plain(n, noise=noise, ramp=ramp)
        row(f"sensor.{name}", "exact", _exact(device, n, noise=noise, ramp=ramp), plain)
        if device is not None:
            first = _rates(n).reshape(shape).astype(np.float32)
            last = first * np.float32(1 + (REPEATS + 1) / 2) if ramp else first
            stop = round((REPEATS + 1) * CYCLES * PS / REAL_TIME)
            light = Light((Piece(0, stop, first, last),))
            fast = _rate(_tiers(device, noise)["fast"], light, n, CYCLES)
            row(f"sensor.{name}", "fast", fast, plain)
    if device is not None:
        for name, light in _scenes(shape).items():
            for tier, call in _tiers(device, True).items():
                row(name, tier, _rate(call, light, n, BLOCK))
        for name, (light, pattern, flag) in _bank_scenes(shape).items():
            cycles = CYCLES if pattern is None else BLOCK
            tier = "bank" if flag & BANK else "fast"
            row(name, tier, _planned(device, light, pattern, flag, cycles))
        rows.append(readout_row(device, ceiling))
    return rows


PARTS = {
    "sensor": _sensor, "core": core_rows, "display": display_rows, "link": link_rows,
    "loop": loop_rows, "board": board_rows, "growth": growth_rows, "view": view_rows,
}  # fmt: skip
"""The parts that have a benchmark."""


def _need_gl() -> None:
    works, description = probe_gl()
    if not works:
        raise MissingPackages(
            "GL through EGL", "available for bench display and loop", f"missing: {description}",
            f"install it ({GL_INSTALL}) or measure another part, such as viform bench sensor",
            gl_packages(),
        )  # fmt: skip


def bench(device: Device | None, parts: list[str]) -> dict[str, Any]:
    """The document of `viform bench --json`; the ceiling is None without an OpenCL device. Raises
    MissingPackages before any measurement if a part needs OpenGL and it is missing."""
    if {"display", "loop"} & set(parts):
        _need_gl()
    chip = CHIPS["spiketwo"]
    ceiling = _ceiling(device, chip.width * chip.height) if device is not None else None
    rows = [row for part in parts for row in PARTS[part](device, ceiling)]
    name = f"{device.name}, driver {device.driver}" if device else "numba on this processor"
    return {
        "device": name,
        "ceiling": {
            "value": ceiling,
            "unit": "pixel-cycles/s",
            "what": "one 32-bit addition and the packing of its carry per pixel and cycle",
        },
        "rows": [_document(row) for row in rows],
    }


def _document(row: TimingRow) -> dict[str, Any]:
    """The row as a JSON object; only stages of a chain have a share."""
    found = asdict(row)
    return found if row.share is not None else {k: v for k, v in found.items() if k != "share"}
