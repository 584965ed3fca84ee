"""What a source says beyond its spikes, on a panel: thresholds that are written, charges of pixels
that do not fire, rejected pixels. Each renderer against closed forms of the light."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosim import Block, Clock, Viform
from cosim.spikes.ancillary import (
    Ancillary,
    ChargePlane,
    RegisterWrite,
    from_arrays,
    to_arrays,
)
from cosim.spikes.viform import cut_words, pack_planes, unpack_planes
from cosim.stage import blocks
from display import CameraPlane, DisplaySetting, SpikePanel
from display.chain.display import PanelStage
from display.chain.tap import spike_waves
from display.core import CalledDisplay
from display.drives import DRIVES
from display.plan.pixels import PanelPixels
from display.render.golden import GoldenRenderer

CLOCK = Clock(40_000)
SHAPE = (6, 40)
WHITE = 0.5
RENDERERS = ("numpy", "opencl", "gl")
Values = npt.NDArray[np.float64]


class Source:
    """The planes of a stream with its ancillary data, block by block."""

    def __init__(self, planes: npt.NDArray[Any], ancillary: Sequence[Ancillary] = ()) -> None:
        self._planes, self._ancillary = planes, ancillary
        self.shape = planes.shape[1:]

    def step(self, data: Any, block: Block) -> Viform:
        told = tuple(e for e in self._ancillary if block.start <= e.cycle < block.stop)
        words = pack_planes(self._planes[block.start : block.stop])
        return Viform(words, block.cycles, CLOCK, block.start, told)


def light(
    source: Source, drive: str, renderer: Any, spans: Sequence[tuple[int, int]], **panel: Any
) -> Values:
    """Light of each pixel in planes `first` to `stop` of each span, packets a plane."""
    made = SpikePanel(SHAPE, CLOCK, WHITE, drive, row_scan=0.0, **panel)
    cycles = len(source._planes)
    eyes = {}
    for n, (first, stop) in enumerate(spans):
        start, end = made.start(first), made.start(stop)
        eyes[f"{n}"] = CameraPlane(((start + end) // 2,), end - start)
    setting = DisplaySetting(made, eyes["0"])
    seen = CalledDisplay(renderer).show(source, cycles, setting, eyes)
    return np.concatenate([*seen.values()]).astype(np.float64) * WHITE


def fired(rate: Values, thresholds: Values, seed: int = 1) -> npt.NDArray[np.bool_]:
    """Planes of pixels that gather `rate` nominal thresholds a plane and fire at `thresholds`, one
    a plane. The residue of the charge is kept."""
    charge = np.random.default_rng(seed).random(rate.shape) * thresholds[0]
    planes = []
    for threshold in thresholds:
        charge = charge + rate
        planes.append(charge >= threshold)
        charge = np.where(planes[-1], charge % threshold, charge)
    return np.stack(planes)


WRITES = [(0, 1.0), (205, 0.5), (411, 0.25), (600, 1.5)]


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("drive", DRIVES)
def test_light_is_rate_times_threshold_whatever_is_written(drive: str, renderer: str) -> None:
    """Pixels of a constant light: in each phase the panel emits that light, though they fire up to
    four times as often at a lower threshold. Of a phase, a packet at either end is another's."""
    rate = np.linspace(0.02, 0.2, SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    thresholds = np.concatenate([
        np.full(stop - first, packet)
        for (first, packet), (stop, _) in zip(WRITES, [*WRITES[1:], (1000, 0)], strict=True)
    ])  # fmt: skip
    told = [RegisterWrite(cycle, packet, (0, 6)) for cycle, packet in WRITES[1:]]
    source = Source(fired(rate, thresholds), told)
    # The first phase without the first two spikes of a pixel, before which it is dark.
    spans = [(105, 205), (205, 411), (411, 600), (600, 1000)]
    seen = light(source, drive, renderer, spans)
    for (first, stop), packet, image in zip(spans, (1, 0.5, 0.25, 1.5), seen, strict=True):
        assert np.abs(image - rate).max() < 2.5 * max(packet, 1.0) / (stop - first)
        assert image.mean() == pytest.approx(rate.mean(), rel=0.02)
    # With spikes of one size, as without the writes, the second phase has twice the light.
    plain = light(Source(fired(rate, thresholds)), drive, renderer, spans[1:2])
    assert plain.mean() == pytest.approx(2 * rate.mean(), rel=0.03)


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("drive", DRIVES)
def test_rows_that_are_not_read_are_dark(drive: str, renderer: str) -> None:
    rate = np.full(SHAPE, 0.15)
    planes = fired(rate, np.ones(800))
    planes[200:500, :2] = planes[200:500, 5:] = False
    told = [RegisterWrite(200, 1.0, (2, 5)), RegisterWrite(500, 1.0, (0, 6))]
    seen = light(Source(planes, told), drive, renderer, [(200, 500), (540, 800)])
    assert np.all(seen[0][:2] == 0) and np.all(seen[0][5:] == 0)
    assert np.abs(seen[0][2:5] - 0.15).max() < 2 / 300
    assert np.abs(seen[1] - 0.15).max() < 2 / 260


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("drive", ["hold", "causal"])
def test_an_interval_of_the_dark_is_dark(drive: str, renderer: str) -> None:
    """Spikes every 10 planes to plane 95, then every 60 from 155 on, with a limit of 40: dark from
    plane 135 on; and the light comes back with a short interval, which ends in plane 290."""
    planes = np.zeros((400, *SHAPE), bool)
    planes[[*range(5, 100, 10), 155, 215, 275, *range(290, 400, 15)]] = True
    source, spans = Source(planes), [(90, 100), (130, 135), (135, 290), (350, 395)]
    lit = light(source, drive, renderer, spans, dark=40)
    # The last held interval is repaid, so its light is near that of its rate.
    assert np.all(np.abs(lit[0] - 0.1) < 0.03) and np.all(lit[1] > 0.01)
    assert np.all(lit[2] == 0)
    assert np.all(np.abs(lit[3] - 1 / 15) < 0.02)
    assert light(source, drive, renderer, spans[2:3]).min() > 0.005
    pixels = PanelPixels(SpikePanel(SHAPE, CLOCK, WHITE, drive, dark=40), 1)
    of_patch = pixels.light(pack_planes(planes[:, :1, 0]), 400, 1)
    assert np.all(of_patch[135:290] == 0) and of_patch[130] > 0


def charges(rate: Values, span: int, levels: int, cycles: int) -> tuple[Any, list[ChargePlane]]:
    """Planes of pixels with a constant light, and the levels of those that do not fire in a span,
    both without noise."""
    phase = np.random.default_rng(2).random(SHAPE)
    charge = phase + rate * np.arange(cycles + 1)[:, None, None]
    count = np.floor(charge)
    level = np.floor((charge - count) * levels)
    told = []
    for cycle in range(span, cycles, span):
        still = count[cycle] == count[cycle - span]
        gain = np.where(still, level[cycle] - level[cycle - span], 0).astype(np.uint16)
        told.append(ChargePlane(cycle, span, gain, levels))
    return np.diff(count, axis=0) > 0, told


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("drive", DRIVES)
def test_charges_show_light_below_one_spike(drive: str, renderer: str) -> None:
    """Pixels that do not fire at all, dark without charges: after a plane of charges the light is m
    of N levels in T planes, which is that of the scene within two levels."""
    span, levels, cycles = 64, 50, 512
    rate = np.linspace(0.0, 1e-3, SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    planes, told = charges(rate, span, levels, cycles)
    never = ~planes.any(axis=0)
    assert 0.6 < never.mean() < 0.9
    spans = [(span, 2 * span), (span, cycles)]
    one, all_planes = light(Source(planes, told), drive, renderer, spans, residues=True)
    gain = told[0].gain / (levels * span)
    # A held interval is a whole number of planes.
    off = 1e-5 if drive == "impulse" else 0.51 * gain.max()
    np.testing.assert_allclose(one[never], gain[never], rtol=off, atol=1e-9)
    total = sum(each.gain for each in told) / (levels * (cycles - span))
    np.testing.assert_allclose(all_planes[never], total[never], rtol=2e-3, atol=1e-7)
    assert np.abs(all_planes - rate)[never].max() < 2 / (levels * (cycles - span)) + 1e-3 / 8
    plain = light(Source(planes), drive, renderer, spans)
    assert np.all(plain[:, never] == 0)


@pytest.mark.parametrize("renderer", RENDERERS)
@pytest.mark.parametrize("drive", DRIVES)
def test_charges_are_a_part_of_the_packets(drive: str, renderer: str) -> None:
    """Dim pixels that fire now and then: what charges have shown is not shown again, so that all
    light is that of the scene. As spikes and charges without it, it would be up to twice that."""
    span, levels, cycles = 32, 200, 6400
    rate = np.linspace(0.002, 0.02, SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    planes, told = charges(rate, span, levels, cycles)
    seen = light(Source(planes, told), drive, renderer, [(1600, cycles)], residues=True)[0]
    # A packet at both ends, and the balance that a drive may owe.
    assert np.abs(seen - rate).max() < 3.5 / (cycles - 1600)
    assert seen.mean() == pytest.approx(rate.mean(), rel=0.02)
    twice = (planes[1600:].sum(axis=0) + sum(e.gain for e in told[50:]) / levels) / (cycles - 1600)
    assert twice.mean() > 1.3 * rate.mean()


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("kind", ["writes", "charges"])
def test_a_display_goes_on_from_a_state(drive: str, kind: str) -> None:
    """At blocks before and after ancillary data, also between a block and the planes drawn."""
    rate = np.linspace(0.002, 0.2, SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    cycles = 320
    if kind == "charges":
        source = Source(*charges(rate / 10, 40, 100, cycles))
    else:
        written = [RegisterWrite(70, 0.5, (0, 6)), RegisterWrite(200, 0.25, (1, 5))]
        source = Source(fired(rate, np.repeat([1, 0.5, 0.25], [70, 130, 120])), written)
    charged = kind == "charges"
    made = SpikePanel(SHAPE, CLOCK, WHITE, drive, residues=charged, rise=4e-6, row_scan=0.0)
    eye = CameraPlane((CLOCK.middle(160),), CLOCK.edge(320))
    setting = DisplaySetting(made, eye)

    def stage() -> PanelStage:
        points = [(2, 3, "a"), (4, 30, "b")]
        return PanelStage(
            setting, {"eye": eye}, None, cycles, lambda images: GoldenRenderer(made, 1, images),
            points=points,
        )  # fmt: skip

    whole = stage()
    for each in blocks(cycles, 32):
        whole.step(source.step(None, each), each)
    for cut in (32, 64, 96, 192, 224):
        first, second = stage(), stage()
        for each in blocks(cycles, 32):
            if each.start == cut:
                second.restore(first.state())
                first = second
            first.step(source.step(None, each), each)
        np.testing.assert_array_equal(first.images["eye"], whole.images["eye"])
        assert (first.fired, first.packets, first.emitted) == (
            whole.fired, whole.packets, whole.emitted
        )  # fmt: skip
        assert [each.cycle for each in first.told] == [each.cycle for each in whole.told]
    # The light of single pixels over time, as the report draws it, adds up to that of the panel.
    words = pack_planes(source._planes)
    _, waves = spike_waves(
        Viform(words, cycles, CLOCK), made, [(2, 3), (4, 30)], made.start(cycles), whole.told
    )  # fmt: skip
    eye = CameraPlane((made.start(160),), 320 * 25_000_000)
    panel = PanelStage(
        setting, {"eye": eye}, None, cycles, lambda images: GoldenRenderer(made, 1, images)
    )
    panel.step(Viform(words, cycles, CLOCK, 0, tuple(source._ancillary)), Block(0, cycles))
    for place, wave in zip(((2, 3), (4, 30)), waves.T, strict=True):
        assert wave.mean() == pytest.approx(panel.images["eye"][0][place], rel=0.01, abs=1e-4)


def test_bits_are_those_of_planes() -> None:
    planes = np.random.default_rng(3).random((133, 2, 3)) < 0.4
    words = pack_planes(planes)
    for first, stop in ((0, 133), (0, 32), (31, 33), (5, 101), (64, 128), (100, 133), (132, 133)):
        part = cut_words(words, first, stop)
        np.testing.assert_array_equal(unpack_planes(part, 0, stop - first), planes[first:stop])
        assert len(part) == -(-(stop - first) // 32)
        np.testing.assert_array_equal(part, pack_planes(planes[first:stop]))


def test_ancillary_data_go_through_arrays() -> None:
    gain = np.arange(6, dtype=np.uint16).reshape(2, 3)
    told = (RegisterWrite(7, 0.4375, (2, 9)), ChargePlane(64, 32, gain, 50))
    write, charge = from_arrays(to_arrays(told))
    assert write == told[0] and isinstance(charge, ChargePlane)
    assert (charge.cycle, charge.span, charge.levels) == (64, 32, 50)
    np.testing.assert_array_equal(charge.gain, gain)
