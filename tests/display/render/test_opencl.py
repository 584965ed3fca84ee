"""What the OpenCL renderer promises beyond agreement with the golden model, and its choice."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import display.render.factory as factory
from cosim import Clock, InputError
from cosim.compute.opencl import Device, open_device
from display import SpikePanel, make_renderer
from display.drives import DRIVES
from display.observe.views import Views
from display.render.golden import GoldenRenderer
from display.render.opencl import OpenCLRenderer
from display.render.renderer import Renderer

CLOCK = Clock.from_hz(40e3)
SHAPE = (9, 150)
"""Wider than four groups of sixteen pixels, and no multiple of them."""
PLANES = 256
Words = npt.NDArray[np.uint32]


@pytest.fixture(scope="module")
def words(stream: Callable[..., Words]) -> Words:
    return stream(PLANES, np.random.default_rng(4).random(SHAPE) ** 2)


def part(views: Views, first: int, stop: int) -> Views:
    return Views(*(values[:, first:stop] for values in vars(views).values()))


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("cut", [64, 128])
def test_blocks_of_whole_windows_give_the_same_bits(
    drive: str, cut: int, words: Words, views: Callable[..., Views]
) -> None:
    shown, batch = SpikePanel(SHAPE, CLOCK, 0.6, drive), 8
    look = views(5, PLANES // batch, 2, cross=False)
    whole, pieces = OpenCLRenderer(shown, batch, 5), OpenCLRenderer(shown, batch, 5)
    whole.step(words, PLANES, look)
    for first in range(0, PLANES, cut):
        seen = part(look, first // batch, (first + cut) // batch)
        pieces.step(words[first // 32 : (first + cut) // 32], cut, seen)
        again = OpenCLRenderer(shown, batch, 5)
        again.restore(pieces.state())  # as after an interruption
        pieces = again
    for image in range(5):
        straight = whole.take(image)
        assert straight.std() > 1e-3
        np.testing.assert_array_equal(pieces.take(image), straight)


@pytest.mark.parametrize("batch", [1, 8])
@pytest.mark.parametrize("drive", ["impulse", "causal"])
def test_an_image_does_not_depend_on_the_others(
    drive: str, batch: int, words: Words, views: Callable[..., Views]
) -> None:
    """Six still images, drawn four at a time, and two that move."""
    shown, planes = SpikePanel(SHAPE, CLOCK, 0.6, drive), 72
    look = views(8, -(-planes // batch), 6, cross=False)
    golden, several = GoldenRenderer(shown, batch, 8), OpenCLRenderer(shown, batch, 8)
    golden.step(words[:3], planes, look)
    for _ in range(2):  # the second time after a reset
        several.step(words[:3], planes, look)
        for image in range(8):
            alone = OpenCLRenderer(shown, batch, 1)
            alone.step(words[:3], planes, Views(*(v[image, None] for v in vars(look).values())))
            seen, exact = several.take(image), golden._images[image]
            np.testing.assert_array_equal(alone.take(0), seen)
            assert np.abs(seen - exact).max() < 1e-6 * max(1, exact.max())
        several.reset()


def test_shifts_across_rows_agree_with_those_along_rows(
    words: Words, views: Callable[..., Views]
) -> None:
    # One image that shifts across rows sends the whole block through the other kernel.
    shown = SpikePanel(SHAPE, CLOCK, 0.6, "causal")
    look = views(3, PLANES // 8, 1, cross=False)
    plain, crossing = OpenCLRenderer(shown, 8, 3), OpenCLRenderer(shown, 8, 4)
    plain.step(words, PLANES, look)
    across = Views(*(v[:1].copy() for v in vars(look).values()))
    across.dy[:] = 0.5
    crossing.step(words, PLANES, Views.joined([look, across]))
    for image in range(3):
        np.testing.assert_allclose(crossing.take(image), plain.take(image), atol=1e-6)


def test_shifts_of_any_size_are_dark_beyond_the_panel(words: Words) -> None:
    shown, spans = SpikePanel(SHAPE, CLOCK, 0.6, "hold"), PLANES // 64
    shifts = [-1e7, -149.5, -64.25, -1.0, -1e-3, 0.5, 15.0, 16.75, 86.0, 149.0, 1e7]
    images, none = len(shifts), np.zeros((len(shifts), spans))
    dx = np.tile(np.array(shifts)[:, None], spans)
    look = Views(none + 0.1, none, none, dx, none, none)
    golden, kernels = GoldenRenderer(shown, 64, images), OpenCLRenderer(shown, 64, images)
    for renderer in (golden, kernels):
        renderer.step(words, PLANES, look)
    for image in range(images):
        np.testing.assert_allclose(kernels.take(image), golden.take(image), rtol=1e-6, atol=1e-6)


def opened(gpu: bool) -> Device:
    """The device, taken for a GPU or for a processor."""
    device = open_device()
    device.__dict__["gpu"] = gpu
    return device


def test_the_renderer_of_software_gl_is_opencl(gl: str, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = SpikePanel((4, 4), CLOCK, 0.6)
    monkeypatch.setattr(factory, "open_device", lambda: opened(gpu=False))

    def made(kind: Any) -> type:
        renderer = make_renderer(kind, shown, 8, 0)
        renderer.close()
        return type(renderer)

    assert made("gl") is Renderer and made("opencl") is OpenCLRenderer
    monkeypatch.setattr(factory, "software", lambda context: True)
    assert made("auto") is OpenCLRenderer

    def no_device() -> None:
        raise InputError("the OpenCL device", "one that this machine has", "none", "install one")

    monkeypatch.setattr(factory, "open_device", no_device)
    assert made("auto") is Renderer
    monkeypatch.undo()
    monkeypatch.setattr(factory, "software", lambda context: False)
    assert made("auto") is Renderer


def test_without_gl_or_with_an_opencl_gpu_auto_does_what_works(
    gl: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = SpikePanel((4, 4), CLOCK, 0.6)

    def no_gl() -> None:
        raise InputError("GL", "3.3", "none", "install it")

    def made() -> type:
        renderer = make_renderer("auto", shown, 8, 0)
        renderer.close()
        return type(renderer)

    monkeypatch.setattr(factory, "software", lambda context: True)
    for gpu, beside in ((False, OpenCLRenderer), (True, Renderer)):
        monkeypatch.setattr(factory, "open_device", lambda gpu=gpu: opened(gpu))
        assert made() is beside
        with monkeypatch.context() as without:
            without.setattr(factory, "open_context", no_gl)
            assert made() is OpenCLRenderer


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits)", True), ("softpipe", True),
        ("NVIDIA H100/PCIe/SSE2", False), ("Mesa Intel(R) UHD Graphics 620 (KBL GT2)", False),
    ],
)  # fmt: skip
def test_software_gl_is_known_by_its_name(name: str, known: bool) -> None:
    context: Any = SimpleNamespace(info={"GL_RENDERER": name})
    assert factory.software(context) is known
