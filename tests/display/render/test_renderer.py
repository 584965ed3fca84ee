"""The shaders and the OpenCL kernels against the golden model in float64, and against what light
must add up to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosim import Clock
from display import SpikePanel, make_renderer
from display.drives import DRIVES
from display.observe.views import Views
from display.render.golden import FOREVER, GoldenRenderer
from display.render.opencl import OpenCLRenderer
from display.render.renderer import Renderer

CLOCK = Clock.from_hz(40e3)
WITHIN = 1e-6
"""Of white, or of itself where brighter."""
SHAPE = (13, 18)
EMITTERS = {
    "quick": (1.0, 0.0, 0.0), "short": (0.3, 20e-6, 1e-3), "slow": (1.0, 0.0, 10e-3),
    "falling at once": (1.0, 1e-5, 0.0), "falling fast": (1.0, 1e-5, 1e-6),
}  # fmt: skip
Words = npt.NDArray[np.uint32]


@pytest.fixture(params=["gl", "opencl"])
def renderer_of(request: pytest.FixtureRequest) -> type[Renderer] | type[OpenCLRenderer]:
    """Each renderer that is held to the golden model."""
    if request.param == "opencl":
        return OpenCLRenderer
    request.getfixturevalue("gl")
    return Renderer


AnyType = type[Renderer] | type[OpenCLRenderer]


def panel(drive: str, emitter: str = "quick", shape: tuple[int, int] = SHAPE) -> SpikePanel:
    pulse, rise, decay = EMITTERS[emitter]
    return SpikePanel(shape, CLOCK, 0.2, drive, pulse, rise, decay)  # type: ignore[arg-type]


def rates(shape: tuple[int, int] = SHAPE) -> npt.NDArray[np.float64]:
    """Dim to bright, with a row without a spike and one of all spikes."""
    rate = np.random.default_rng(5).random(shape) ** 2 * 0.9
    rate[0], rate[-1] = 0, 1
    return rate


def agree(seen: npt.NDArray[np.float64], golden: npt.NDArray[np.float64]) -> None:
    assert seen.shape == golden.shape and seen.dtype == golden.dtype == np.float64
    assert np.abs(seen - golden).max() <= WITHIN * max(1.0, np.abs(golden).max())


@pytest.mark.parametrize("emitter", EMITTERS)
@pytest.mark.parametrize("drive", DRIVES)
def test_blocks_of_any_length_agree_with_the_golden_model(
    renderer_of: AnyType,
    drive: str,
    emitter: str,
    stream: Callable[..., Words],
    views: Callable[..., Views],
) -> None:
    shown, batch = panel(drive, emitter), 8
    golden, shaders = GoldenRenderer(shown, batch, 4), renderer_of(shown, batch, 4)
    for seed, cycles in enumerate((64, 37, 128, 1)):
        words, look = stream(cycles, rates(), seed), views(4, -(-cycles // batch), 2, seed)
        for renderer in (golden, shaders):
            renderer.step(words, cycles, look)
        agree(shaders.light, golden.light)
    for image in range(4):
        golden_image = golden.take(image)
        assert golden_image.std() > 1e-3
        agree(shaders.take(image), golden_image)
        assert not shaders.take(image).any()
    want, got = golden.state(), shaders.state()
    assert want.keys() == got.keys()
    if drive != "impulse":
        for key in ("tau", "age", "started"):
            assert got[key].dtype == want[key].dtype and (got[key] == want[key]).all(), key
    shaders.close()


@pytest.mark.parametrize("batch", [1, 5, 64])
@pytest.mark.parametrize("shape", [(1, 1), (7, 5)])
def test_spans_of_any_number_of_planes_and_panels_of_any_size(
    renderer_of: AnyType,
    batch: int,
    shape: tuple[int, int],
    stream: Callable[..., Words],
    views: Callable[..., Views],
) -> None:
    shown = panel("causal", shape=shape)
    golden, shaders = GoldenRenderer(shown, batch, 3), renderer_of(shown, batch, 3)
    rate = np.random.default_rng(2).random(shape)
    for seed, cycles in enumerate((70, 200)):
        words = stream(cycles, rate, seed)
        for still, rows, cross in ((3, True, True), (0, False, False)):
            look = views(3, -(-cycles // batch), still, seed, rows, cross)
            for renderer in (golden, shaders):
                renderer.step(words, cycles, look)
    agree(shaders.light, golden.light)
    for image in range(3):
        agree(shaders.take(image), golden.take(image))
    shaders.close()


def test_more_images_than_a_draw_has_targets(
    renderer_of: AnyType, stream: Callable[..., Words], views: Callable[..., Views]
) -> None:
    for drive in ("impulse", "hold"):
        shown, images = panel(drive), 11
        golden, shaders = GoldenRenderer(shown, 64, images), renderer_of(shown, 64, images)
        words = stream(128, rates())
        look = views(images, 2, 9)
        look.weight[3], look.slope[3] = 0, 0  # one that looks elsewhere
        for renderer in (golden, shaders):
            for _ in range(20):  # beyond the draws after which an image is carried over
                renderer.step(words, 128, look)
        for image in range(images):
            agree(shaders.take(image), golden.take(image))
        shaders.close()


@pytest.mark.parametrize("drive", DRIVES)
def test_a_state_goes_over_to_either_renderer(
    renderer_of: AnyType, drive: str, stream: Callable[..., Words], views: Callable[..., Views]
) -> None:
    shown = panel(drive, "short")
    words, look = stream(192, rates()), views(2, 12, 1)
    whole, first = renderer_of(shown, 8, 2), renderer_of(shown, 8, 2)
    second, plain = renderer_of(shown, 8, 2), GoldenRenderer(shown, 8, 2)
    whole.step(words[:3], 96, look)
    first.step(words[:3], 96, look)
    state = first.state()
    first.close()
    second.restore(state)
    plain.restore(state)
    for renderer in (whole, second, plain):
        renderer.step(words[3:], 96, look)
    for image in range(2):
        straight = whole.take(image)
        agree(second.take(image), straight)
        agree(plain.take(image), straight)
    whole.close()
    second.close()


@pytest.mark.parametrize("constant", [0.0, 100e-6, 1e-3])
def test_the_light_of_impulse_is_spikes_times_q(
    renderer_of: AnyType, constant: float, stream: Callable[..., Words]
) -> None:
    # An emitter as slow to rise as to decay moves light in time and loses none.
    shown = SpikePanel(SHAPE, CLOCK, 0.2, "impulse", 0.5, constant, constant)
    words = stream(2000, rates())
    spikes = np.bitwise_count(words).sum(axis=0).astype(np.float64)
    dark = np.zeros((64, *SHAPE), np.uint32)  # 51 ms, in which all that is left is emitted
    shaders = renderer_of(shown, 64, 1)
    for block, cycles in ((words, 2000), (dark, 2048)):
        still = np.zeros((1, -(-cycles // 64)))
        shaders.step(block, cycles, Views(still + 1, still, still, still, still, still))
    light = shaders.take(0)
    shaders.close()
    assert light.sum() == pytest.approx(spikes.sum(), rel=WITHIN)
    assert np.abs(light - spikes).max() <= WITHIN * spikes.max()


@pytest.mark.parametrize("drive", DRIVES)
def test_extremes_all_spikes_one_ever_none_and_very_old_ages(
    renderer_of: AnyType, drive: str, stream: Callable[..., Words]
) -> None:
    shown = panel(drive, shape=(1, 8))
    golden, shaders = GoldenRenderer(shown, 64, 0), renderer_of(shown, 64, 0)
    state: dict[str, Any] = golden.state()
    state["started"][0, 4:] = True
    state["age"][0, 4:] = [FOREVER, FOREVER - 1, 2**31, 10**8]
    state["tau"][0, 4:] = [FOREVER, 3, 2**24, 2**30]
    for renderer in (golden, shaders):
        renderer.restore(state)
    words = np.zeros((4, 1, 8), np.uint32)
    words[:, 0, 0] = 2**32 - 1
    words[1, 0, 1] = 1 << 7
    words[2, 0, 5:] = 1 << 31
    for _ in range(2):
        for renderer in (golden, shaders):
            renderer.step(words, 128, None)
        scale = np.maximum(golden.light, 1e-6)
        assert (np.abs(shaders.light - golden.light) <= WITHIN * scale).all()
    assert (shaders.light[:, 0, 2:4] == 0).all()
    if drive != "impulse":
        assert shaders.state()["age"][0, 4] == FOREVER
        assert (shaders.state()["tau"][0, 2:4] == 0).all()
    shaders.close()


def test_a_long_exposure_keeps_its_digits(renderer_of: AnyType) -> None:
    # 1500 blocks whose sum a float32 would hold to 1e-4 at best: a tenth is none of its numbers.
    shown = SpikePanel((2, 8), CLOCK, 0.5, "hold")
    shaders = renderer_of(shown, 128, 1)
    every_third = np.packbits(np.arange(96) % 3 == 0, bitorder="little").view(np.uint32)
    words = np.broadcast_to(every_third[:, None, None], (3, 2, 8))
    one = np.full((1, 1), 0.1)
    none = np.zeros((1, 1))
    look = Views(one, none, none, none, none, none)
    shaders.step(words, 96, None)
    state = shaders.state()
    for _ in range(1500):
        shaders.step(words, 96, look)
    assert np.abs(shaders.take(0) / (1500 * 0.1 * 96 / 3) - 1).max() < WITHIN
    assert (shaders.state()["tau"] == state["tau"]).all()
    shaders.close()


def test_words_of_another_size_are_refused_as_the_golden_model_does(
    gl: str, renderer_of: AnyType
) -> None:
    for renderer in (
        make_renderer(kind, panel("hold"), 8, 0) for kind in ("gl", "opencl", "numpy")
    ):
        with pytest.raises(ValueError, match=r"\(13, 18\) pixels, not \(13, 17\)"):
            renderer.step(np.zeros((1, 13, 17), np.uint32), 32, None)
        renderer.close()
    with pytest.raises(ValueError, match="batch must be 1 or more"):
        renderer_of(panel("hold"), 0, 0)


@pytest.mark.usefixtures("gl")
def test_what_a_scene_does_not_need_is_not_in_its_shader(
    stream: Callable[..., Words], views: Callable[..., Views]
) -> None:
    def members(drive: str, emitter: str, **kinds: Any) -> set[str]:
        renderer = Renderer(panel(drive, emitter), 64, 1)
        renderer.step(stream(64, rates()), 64, views(1, 1, **kinds))
        names = {name for program, _ in renderer._programs.values() for name in program}
        renderer.close()
        return names

    still = members("impulse", "quick", still=1, rows=False)
    assert not still & {"tau_before", "level_before", "unit", "span0", "height"}
    assert {"tau_before", "height"} <= members("hold", "quick", still=1)
    assert {"level_before", "unit"} <= members("impulse", "slow", still=1)
    assert "span0" in members("impulse", "quick", still=0)
