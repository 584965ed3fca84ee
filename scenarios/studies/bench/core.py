"""Throughput of the camera, the display and the link that are called from Python, beside ten lines
of numpy."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.run.timing import REAL_TIME, TimingRow, least, least_of
from cosim.spikes.viform import WORD, Words
from display import FixedEye
from scenarios.python import Camera, Display, Link

CHIP: Final = (250, 400)
"""Rows and columns of the clip of SpikeOne, and of its chip."""
FRAMES, RATE = 20, 2000.0
"""Frames of that clip, and frames/s: 400 cycles at 40 kHz."""
LARGE, LARGE_FRAMES, LARGE_RATE = (1000, 1000), 64, 1000.0
"""Rows and columns, frames and frames/s of the clip of SpikeTwo: 2560 cycles."""
CHIPS: Final = {CHIP: "spikeone", LARGE: "spiketwo"}
BYTES: Final = 100_000
"""Bytes of a call of the link."""
WHITE: Final = 0.6
"""Spikes a cycle of white."""


def _clip(shape: tuple[int, int], count: int) -> npt.NDArray[np.uint8]:
    """A pattern of waves that moves by a pixel a frame, sRGB codes from 40 to 250."""
    y, x = np.mgrid[: shape[0], : shape[1] + count]
    wave = (145 + 105 * np.sin(x / 15) * np.cos(y / 20)).astype(np.uint8)
    return np.stack([wave[:, n : n + shape[1]] for n in range(count)])


def plain_film(frames: npt.NDArray[np.uint8], steps: int) -> npt.NDArray[np.bool_]:
    """The plain way, in numpy without any noise: light interpolated between frames, integrated,
    compared and subtracted.

    Args:
        frames: (T, H, W) uint8 in sRGB.
        steps: cycles from a frame to the next.

    Returns:
        (T steps, H, W) bool, whether a pixel fires.
    """
    code = np.arange(256) / 255
    curve = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    light = (WHITE * curve).astype(np.float32)[frames]
    fired = np.empty((len(frames) * steps, *frames.shape[1:]), np.bool_)
    charge = np.zeros(frames.shape[1:], np.float32)
    for n, first in enumerate(light):
        change = (light[min(n + 1, len(light) - 1)] - first) / np.float32(steps)
        for k in range(steps):
            charge += first + change * np.float32(k + 0.5)
            np.greater_equal(charge, 1, out=fired[n * steps + k])
            charge -= fired[n * steps + k]
    return fired


def plain_show(words: Words, weights: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """The plain way, in numpy without a drive: planes, integrated with the weights of an eye.

    Args:
        words: (n, H, W) uint32.
        weights: (images, 32 n), share of the light of each plane in an image.

    Returns:
        (images, H, W) float32.
    """
    bit = np.arange(WORD, dtype=np.uint32)[:, None, None]
    image = np.zeros((len(weights), *words.shape[1:]), np.float32)
    for word, own in zip(words, np.split(weights, len(words), axis=1), strict=True):
        image += np.tensordot(own, (word >> bit & 1).astype(np.float32), 1)
    return image


def _camera(shape: tuple[int, int], device: Device | None, **keys: Any) -> Camera:
    return Camera(
        CHIPS[shape], device=None if device is not None else "numba", threshold="1000 e",
        width=shape[1], height=shape[0], **keys,
    )  # fmt: skip


def core_rows(device: Device | None, ceiling: float | None) -> list[TimingRow]:
    """Rows of calls from Python: a clip of 400 x 250 and one of 1000 x 1000 with every effect of
    the preset `silicon`, a frame that is pushed to a live camera, and what a still eye sees of the
    first clip on a display.

    The plan of `core.film` may give tiles of strong contrast to the reference, by the tolerance of
    a run; the tier `fast` simulates every tile in the fast tier and states its bound. The plain way
    of the second clip is that of a part of it.

    Args:
        device: OpenCL device, None for the compiled form.
        ceiling: throughput of the least work for a spike bit, pixel-cycles/s; None if unknown.
    """
    steps = round(REAL_TIME / RATE)
    small = _clip(CHIP, FRAMES)
    tiers: tuple[Any, ...] = ("fast", "exact") if device is not None else ("exact",)
    planned = _camera(CHIP, device, preset="silicon")
    cameras = [planned, *(_camera(CHIP, device, preset="silicon", tier=tier) for tier in tiers)]
    calls: list[Callable[[], Any]] = [partial(plain_film, small, steps)]
    calls += [partial(camera.film, small, RATE, call=0) for camera in cameras]
    plain, *films = least_of(calls)
    done = small.size * steps
    rows = [
        _row("core.film", name, done, spent, plain / spent, small.size // FRAMES, ceiling)
        for name, spent in zip(("planned", *tiers), films, strict=True)
    ]
    live = planned.open(RATE)
    frames = iter(small)

    def push() -> None:
        nonlocal frames
        frame = next(frames, None)
        if frame is None:
            frames = iter(small)
            frame = next(frames)
        live.push(frame)

    push()
    spent = least(push, 2 * FRAMES)
    rows.append(_row("core.push", tiers[0], done // FRAMES, spent, None, small[0].size, ceiling))
    rows.append(_show_row(cameras[-1], small, ceiling))
    large, steps = _clip(LARGE, LARGE_FRAMES), round(REAL_TIME / LARGE_RATE)
    part = large[:, :100]
    camera = _camera(LARGE, device, preset="silicon", tier=tiers[0])
    spent, plain = least_of(
        [lambda: camera.film(large, LARGE_RATE, call=0), lambda: plain_film(part, steps)], 2
    )
    ratio = plain * large.size / part.size / spent
    done, pixels = large.size * steps, large[0].size
    rows.append(_row("core.film-large", tiers[0], done, spent, ratio, pixels, ceiling))
    return rows + send_rows(device, BYTES)


def _show_row(camera: Camera, frames: npt.NDArray[np.uint8], ceiling: float | None) -> TimingRow:
    """Five images of a clip on a display with the drive `causal`, which keeps every effect."""
    spikes, display = camera.film(frames, RATE, call=0), Display("causal")
    seen = display.show(spikes, "still", white_rate=WHITE)
    clock, planes = spikes.clock, WORD * len(spikes.words)
    at = np.array([clock.edge(n) for n in range(planes + 1)], np.int64)
    centres = tuple(clock.middle(n) for n in seen.instants)
    eye = FixedEye(centres, seen.luminance, 0, clock.edge(spikes.cycles))
    weights = (eye.weights(at[:-1], at[1:]) / WHITE).astype(np.float32)
    spent, plain = least_of([
        lambda: display.show(spikes, "still", white_rate=WHITE).images["still"],
        lambda: plain_show(spikes.words, weights),
    ])  # fmt: skip
    height, width = spikes.shape
    done = spikes.cycles * height * width
    return _row("core.show", "exact", done, spent, plain / spent, height * width, ceiling)


def _row(
    name: str, tier: str, done: int, seconds: float, plain: float | None, pixels: int,
    ceiling: float | None,
) -> TimingRow:  # fmt: skip
    value = done / seconds
    return TimingRow(
        name, tier, value, "pixel-cycles/s", value / (pixels * REAL_TIME),
        None if ceiling is None else value / ceiling, plain,
    )  # fmt: skip


def plain_send(
    data: bytes, planes: int, panel: tuple[int, int], camera: tuple[int, int], cell: int
) -> bytes:
    """The plain way to send, in numpy without any noise, lens, search or code: cells become panel
    pixels, the nearest of which each camera pixel sees; charge is compared and reset, and the
    camera pixel in the middle of each cell decides.

    Args:
        data: the bytes, which the planes have room for.
        planes: planes to show; those after the data are off.
        panel, camera: (height, width) of both, pixels.
        cell: panel pixels to a cell's side.

    Returns:
        The bytes that were decided.
    """
    shape = panel[0] // cell, panel[1] // cell
    bits = np.zeros((planes, *shape), np.uint8)
    sent = np.unpackbits(np.frombuffer(data, np.uint8))
    bits.reshape(-1)[: sent.size] = sent
    sees = [(2 * np.arange(n) + 1) * m // (2 * n) for n, m in zip(camera, panel, strict=True)]
    rows, columns = (
        (2 * np.arange(count) + 1) * cell * n // (2 * m)
        for count, n, m in zip(shape, camera, panel, strict=True)
    )
    charge, got = np.zeros(camera, np.float32), np.empty_like(bits)
    for n, plane in enumerate(bits):
        light = np.float32(1.4) * plane.repeat(cell, 0).repeat(cell, 1)
        charge += light[np.ix_(*sees)]
        fired = charge >= 1
        charge[fired] = 0
        got[n] = fired[np.ix_(rows, columns)]
    return np.packbits(got.reshape(-1)[: sent.size]).tobytes()


def send_rows(device: Device | None, size: int, **keys: Any) -> list[TimingRow]:
    """Rows of a link: its set-up, the first call, which searches for the panel, and later ones,
    which know it.

    Args:
        device: OpenCL device, None for the compiled form.
        size: bytes of a call.
        **keys: keys of the link.
    """
    data = np.random.Generator(np.random.Philox(key=1)).bytes(size)

    def make() -> Link:
        return Link(size=size, device=None if device is not None else "numba", **keys)

    link = make()
    sent = link.send(data, call=1)
    mode, cycles = sent.mode, round(sent.simulated_s * REAL_TIME)
    panel = mode.height, mode.width
    plain, again, first = least_of([
        lambda: plain_send(data, cycles, panel, link.camera_shape, mode.cell),
        lambda: link.send(data, call=1), lambda: link.send(data, call=0),
    ], 3)  # fmt: skip
    tier = sent.error.tier
    rows = [TimingRow("core.send-setup", tier, least(make, 1), "s", None, None, None)]
    for which, spent in (("first call", first), ("later calls", again)):
        real = sent.simulated_s / spent
        rate = 8 * size / spent
        name = f"{tier}, {which}"
        rows.append(TimingRow("core.send", name, rate, "bit/s", real, None, plain / spent))
    return rows
