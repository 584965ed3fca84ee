"""The compiled pixels of a panel, held to the golden model."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Clock
from cosim.spikes.viform import pack_planes
from display import CameraPlane, DisplaySetting, FixedEye, PursuingEye, SpikePanel
from display.drives import DRIVES
from display.plan.pixels import PatchDisplay
from display.render.golden import GoldenRenderer

CLOCK = Clock(40_000)
SHAPE, PLANES = (6, 9), 320


def words_of(seed: int = 1) -> np.ndarray:
    """Pixels of every density, from one that never fires to one that always does."""
    rng = np.random.default_rng(seed)
    density = np.linspace(0, 1, SHAPE[0] * SHAPE[1]).reshape(SHAPE) ** 2
    return pack_planes(rng.random((PLANES, *SHAPE)) < density)


def panel_of(drive: str, emitter: tuple[float, float, float]) -> SpikePanel:
    pulse, rise, decay = emitter
    return SpikePanel(
        SHAPE,
        CLOCK,
        0.6,
        drive,
        pulse,
        rise,
        decay,
        transport=1_000_000,  # type: ignore[arg-type]
    )


EMITTERS = ((1.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.3, 2e-6, 40e-6), (1.0, 0.0, 9e-6))


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("emitter", EMITTERS)
@pytest.mark.parametrize("batch", [1, 8, 64])
def test_images_of_patches_are_those_of_the_golden_model(drive, emitter, batch):
    panel = panel_of(drive, emitter)
    instants = tuple(panel.start(n) for n in (60, 160, 250))
    eye = FixedEye(instants, 300.0, panel.start(0), panel.start(PLANES))
    for observer in (eye, CameraPlane(instants, 10**9)):
        setting = DisplaySetting(panel, observer, batch)
        one = PatchDisplay(setting, *SHAPE, np.arange(SHAPE[0]))
        golden, words = GoldenRenderer(panel, batch, 3), words_of()
        for first, cycles in ((0, 128), (128, 192)):
            part = words[first // 32 : (first + cycles) // 32]
            one.step(part.reshape(len(part), -1), first, cycles)
            golden.step(part, cycles, setting.views(first, cycles))
        for n in range(3):
            due = golden.take(n)
            assert due.max() > 0.1
            np.testing.assert_allclose(one.images[n].reshape(SHAPE), due, rtol=1e-12, atol=1e-14)


def test_a_pursuing_eye_sees_a_patch_that_goes_on_round_its_edges():
    """Two patches beside others of themselves: the middle of the golden model's nine."""
    instants = (CLOCK.edge(100), CLOCK.edge(200))
    small = panel_of("causal", EMITTERS[2])
    eye = PursuingEye(FixedEye(instants, 300.0, 0, CLOCK.edge(PLANES)), (150.0, -330.0))
    words = words_of()
    setting = DisplaySetting(small, eye, 8, row_timing=False)
    one = PatchDisplay(setting, *SHAPE, np.arange(SHAPE[0]))
    one.step(words.reshape(len(words), -1), 0, PLANES)
    large = SpikePanel((30, 45), CLOCK, 0.6, "causal", EMITTERS[2][0], *EMITTERS[2][1:],
                       row_scan=0.0, transport=1_000_000)  # fmt: skip
    golden = GoldenRenderer(large, 8, 2)
    golden.step(np.tile(words, (1, 5, 5)), PLANES, setting.views(0, PLANES))
    for n in range(2):
        due = golden.take(n)[12:18, 18:27]
        assert due.std() > 0.01
        np.testing.assert_allclose(one.images[n].reshape(SHAPE), due, rtol=1e-11, atol=1e-13)


def test_patches_go_on_from_their_state():
    panel = panel_of("hold", EMITTERS[2])
    setting = DisplaySetting(panel, CameraPlane((CLOCK.edge(150),), 10**10), 8)
    whole, first, second = (PatchDisplay(setting, *SHAPE, np.arange(SHAPE[0])) for _ in range(3))
    words = words_of().reshape(-1, SHAPE[0] * SHAPE[1])
    whole.step(words, 0, PLANES)
    first.step(words[:4], 0, 128)
    second.restore(first.state())
    second.step(words[4:], 128, PLANES - 128)
    np.testing.assert_allclose(second.images, whole.images, rtol=1e-13)
