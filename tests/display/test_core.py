"""The display that is called: agreement of its renderers, draws of any length, what it keeps."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosim import Block, Clock, Viform
from cosim.spikes.staged import StreamStage
from display import CameraPlane, DisplaySetting, FixedEye, PursuingEye, SpikePanel
from display.core import _KEPT, _TOGETHER, ARITHMETIC, CalledDisplay, LiveDisplay
from display.drives import DRIVES
from display.observe.views import Observer
from display.render.golden import GoldenRenderer
from display.render.kinds import RendererKind

CLOCK = Clock(40_000)
SHAPE = (9, 70)
Images = dict[str, npt.NDArray[np.float32]]


@pytest.fixture(scope="module")
def spikes(stream: Callable[..., Any]) -> Viform:
    """Longer than what is shown at once, and not of whole words."""
    cycles = _TOGETHER + 77
    words = stream(cycles, np.random.default_rng(5).random(SHAPE) ** 2)
    return Viform(words, cycles, CLOCK)


def panel(drive: str = "causal", shape: tuple[int, int] = SHAPE) -> SpikePanel:
    slow = {"rise": 2e-6, "decay": 5e-6} if drive == "causal" else {}
    return SpikePanel(shape, CLOCK, 0.6, drive, **slow)


def observers(cycles: int) -> dict[str, Observer]:
    at = tuple(CLOCK.middle(n) for n in (cycles // 5, cycles // 2, cycles - 3))
    still = FixedEye(at, 300.0, 0, CLOCK.edge(cycles))
    return {
        "still": still, "pursuing": PursuingEye(still, (0.0, 900.0)),
        "camera": CameraPlane(at, 10**9),
    }  # fmt: skip


def seen(
    display: CalledDisplay, spikes: Viform, drive: str = "causal", cycles: int | None = None
) -> Images:
    cycles = spikes.cycles if cycles is None else cycles
    setting = DisplaySetting(panel(drive, spikes.shape), observers(cycles)["still"])
    return display.show(StreamStage(spikes), cycles, setting, observers(cycles))


def same(one: Images, other: Images) -> bool:
    return all(np.array_equal(one[name], other[name]) for name in one) and list(one) == list(other)


@pytest.mark.parametrize("drive", DRIVES)
def test_kernels_see_what_the_golden_model_sees(drive: str, spikes: Viform) -> None:
    part = spikes[:200]
    called, golden = (seen(CalledDisplay(kind), part, drive) for kind in ("opencl", "numpy"))
    for name, images in called.items():
        assert images.shape == (3, *SHAPE) and images.dtype == np.float32 and images.std() > 0.05
        assert np.abs(images - golden[name]).max() < ARITHMETIC * max(1.0, images.max())


def test_draws_of_any_length_give_the_same_bits(spikes: Viform) -> None:
    display = CalledDisplay("opencl")
    whole = seen(display, spikes)
    made: Any = display._kept.pop()
    setting = DisplaySetting(panel(), observers(spikes.cycles)["still"])
    for size in (32, 64, 128, 1088):
        # Blocks of 32 are joined to draws of 128 planes, as in a run.
        live = LiveDisplay(setting, observers(spikes.cycles), lambda images: made)
        source, first = StreamStage(spikes), 0
        while first < spikes.cycles:
            block = Block(first, min(size, spikes.cycles - first))
            live.push(source.step(None, block).words, block.cycles, last=block.stop == 1101)
            first = block.stop
        assert same(live.take(), whole)
        made.reset()


@pytest.mark.parametrize("kind", ["opencl", "numpy"])
def test_a_call_leaves_nothing_to_the_next(kind: RendererKind, spikes: Viform) -> None:
    part = spikes[:300]
    display, other = CalledDisplay(kind), Viform(~spikes.words[:3], 96, CLOCK)
    first = seen(display, part)
    assert not same(seen(display, other), first) and same(seen(display, part), first)
    assert not same(seen(display, part, cycles=200), first)
    dim = DisplaySetting(replace(panel(), white_rate=1.0), observers(300)["still"])
    shown = display.show(StreamStage(part), 300, dim, observers(300))
    np.testing.assert_allclose(shown["still"], 0.6 * first["still"], rtol=1e-5)
    display.forget()
    assert not display._kept and same(seen(display, part), first)


def test_threads_give_the_bits_of_one(spikes: Viform) -> None:
    parts = [spikes[:300], spikes[:300, :5], spikes[100:400], spikes[:, :, 3:60]]
    display = CalledDisplay("opencl")
    alone = [seen(CalledDisplay("opencl"), part) for part in parts]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda part: seen(display, part), parts * 3))
    assert all(same(one, alone[n % 4]) for n, one in enumerate(together))
    assert 0 < len(display._kept) <= _KEPT


def test_a_call_that_fails_closes_its_renderer(
    spikes: Viform, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed = []
    monkeypatch.setattr(GoldenRenderer, "close", lambda self: closed.append(self))

    class Broken:
        def step(self, data: Any, block: Block) -> Viform:
            raise OSError("the disk is gone")

    display = CalledDisplay("numpy")
    setting = DisplaySetting(panel(), observers(64)["still"])
    with pytest.raises(OSError, match="gone"):
        display.show(Broken(), 64, setting, observers(64))
    assert len(closed) == 1
