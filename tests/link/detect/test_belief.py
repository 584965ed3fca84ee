"""Belief propagation against sums over all bits, and beside the joint detector."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosim import InputError
from link.detect.catalogue import make_detector
from link.detect.detector import Detector
from link.layout import TRAINING, Layout, training
from link.mode import Mode
from link.prediction.error_bound import edge_share
from link.section import ModemSection
from link.theory.soft_information import soft_information
from link.timing import Registration, Timing
from tests.link.detect import scenes
from tests.link.detect.belief import BeliefPropagation
from tests.link.detect.belief_kernel import LEVELS, LIGHTS, laws, messages
from tests.link.detect.belief_learning import PixelModel
from tests.link.detect.footprints import Footprints, seen_by
from tests.link.detect.propagation import graph_of, propagate

MODEL = PixelModel(off=0.02, on=1.6, softness=0.03, shot=2e-3)
SHAPE = 56, 56
"""A camera that sees the middle of the panel."""


def footprint(*pixels: dict[int, float]) -> Footprints:
    """Pixels by the shares of their cells."""
    most = max(len(each) for each in pixels)
    cell, share = np.zeros((2, len(pixels), most))
    for p, each in enumerate(pixels):
        cell[p, : len(each)], share[p, : len(each)] = list(each), list(each.values())
    place = np.arange(len(pixels))
    return Footprints(place, place, cell.astype(np.int64), share.astype(np.float32))


@cache
def matrix(model: PixelModel, light: float, spike: int) -> npt.NDArray[np.float64]:
    """P(spike, charge after | charge before) of a tick, on the grid; a light on its steps."""
    kernel, first, fires = (np.asarray(each, float) for each in laws(
        model.brightest, model.shot, model.softness, model.hard
    ))  # fmt: skip
    states, q = len(fires), round(light * 2 * LIGHTS)
    moved = np.zeros((states, states))
    for g in range(states):
        for t, part in enumerate(kernel[q]):
            moved[g, min(g + int(first[q]), states - kernel.shape[1]) + t] += part
    if not spike:
        return moved * (1 - fires)
    after = np.zeros((states, states))
    for g in range(states):
        after[:, 0 if model.hard else max(g - LEVELS, 0)] += moved[:, g] * fires[g]
    return after


def symbol(
    model: PixelModel, light: float, spikes: npt.NDArray[np.uint8]
) -> npt.NDArray[np.float64]:
    """The same of a symbol; linear between the steps of light, as the detector has it."""
    low = int(np.float32(light) * LIGHTS)
    part = light * LIGHTS - low
    ends = []
    for m in (low, low + 1):
        whole = np.eye(len(matrix(model, 0, 0)))
        for spike in spikes:
            whole = whole @ matrix(model, m / LIGHTS, int(spike))
        ends.append(whole)
    return (1 - part) * ends[0] + part * ends[1]


def by_sum(
    seen: Footprints, model: PixelModel, spikes: list[npt.NDArray[np.uint8]], cells: int
) -> npt.NDArray[np.float64]:
    """Log likelihood ratios of all bits, (symbols, cells), by a sum over all of them."""
    symbols = len(spikes)
    start = np.zeros(len(matrix_size(model)))
    start[:LEVELS] = 1 / LEVELS

    @cache
    def of(p: int, n: int, light: float) -> npt.NDArray[np.float64]:
        return symbol(model, light, spikes[n][p])

    @cache
    def charge(p: int, *lights: float) -> npt.NDArray[np.float64]:
        """Of a pixel, after symbols of these lights."""
        if not lights:
            return start
        return charge(p, *lights[:-1]) @ of(p, len(lights) - 1, lights[-1])

    on, off = np.zeros((2, symbols, cells))
    for drawn in itertools.product((0, 1), repeat=symbols * cells):
        bits, chance = np.reshape(drawn, (symbols, cells)), 1.0
        for p in range(len(seen.row)):
            lit = bits[:, seen.cell[p]] @ seen.share[p].astype(float)
            chance *= charge(p, *np.round(model.off + model.on * lit, 9).tolist()).sum()
        on += chance * bits
        off += chance * (1 - bits)
    return np.log(np.maximum(on, 1e-300)) - np.log(np.maximum(off, 1e-300))


def matrix_size(model: PixelModel) -> npt.NDArray[np.float32]:
    return laws(model.brightest, model.shot, model.softness, model.hard)[2]


def propagated(
    seen: Footprints, model: PixelModel, spikes: list[npt.NDArray[np.uint8]], cells: int,
    rounds: tuple[int, ...], damping: float,
) -> npt.NDArray[np.float32]:  # fmt: skip
    late = np.zeros((len(spikes), len(seen.row)), np.float32)
    none = np.zeros((len(spikes), cells), np.float32)
    return propagate(graph_of(seen, cells), model, spikes, late, none, 9, rounds, damping)


def spikes_of(
    rng: np.random.Generator, seen: Footprints, model: PixelModel, symbols: int, ticks: int,
    cells: int,
) -> list[npt.NDArray[np.uint8]]:  # fmt: skip
    """Spikes of random bits, without noise of the charge."""
    charge, out = rng.random(len(seen.row)), []
    for _ in range(symbols):
        lit = (rng.integers(0, 2, cells)[seen.cell] * seen.share).sum(axis=1)
        spikes = np.zeros((len(charge), ticks), np.uint8)
        for j in range(ticks):
            charge = charge + model.off + model.on * lit
            spikes[:, j] = charge >= 1
            charge = np.where(charge >= 1, 0.0 if model.hard else charge - 1, charge)
        out.append(spikes)
    return out


@pytest.mark.parametrize("hard", [True, False])
@pytest.mark.parametrize("ticks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_without_loops_it_is_the_sum_over_all_bits(hard: bool, ticks: int) -> None:
    """One pixel and its charge through three symbols: a tree."""
    model = PixelModel(MODEL.off, MODEL.on, softness=0.03, shot=2e-3, hard=hard)
    seen, rng = footprint({0: 0.5, 1: 0.3, 2: 0.17}), np.random.default_rng(3)
    for _ in range(4):
        spikes = spikes_of(rng, seen, model, 3, ticks, 3)
        exact = by_sum(seen, model, spikes, 3)
        found = propagated(seen, model, spikes, 3, (1, 1), 0.0)
        # Laws are floored at 1e-4, so sure bits differ: compared as probabilities.
        assert np.tanh(found / 2) == pytest.approx(np.tanh(exact / 2), abs=4e-3)


def test_the_sum_is_over_the_cells_that_a_pixel_sees(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its time doubles with each cell, so a place of the footprint without a cell is left out."""
    seen, rng = footprint({0: 0.5, 1: 0.3, 2: 0.17}, {0: 0.9}), np.random.default_rng(3)
    padded, counts = footprint(*({0: 0.5, 1: 0.3, 2: 0.17} | {9: 0.0}, {0: 0.9})), []

    def noted(p0: int, p1: int, law: Any, cell: Any, share: Any, many: Any, *more: Any) -> None:
        counts.append(np.broadcast_to(many, len(cell)).tolist())
        messages(p0, p1, law, cell, share, many, *more)

    monkeypatch.setattr("tests.link.detect.propagation.messages", noted)
    spikes = spikes_of(rng, seen, MODEL, 3, 2, 10)
    found = [propagated(each, MODEL, spikes, 10, (2, 1), 0.3) for each in (seen, padded)]
    assert (found[0] == found[1]).all() and all(each == [3, 1] for each in counts)


def test_two_pixels_that_share_a_cell_are_a_tree_as_well() -> None:
    seen, rng = footprint({0: 0.6, 1: 0.36}, {1: 0.44, 2: 0.5}), np.random.default_rng(5)
    for _ in range(8):
        spikes = spikes_of(rng, seen, MODEL, 1, 2, 3)
        exact = by_sum(seen, MODEL, spikes, 3)
        found = propagated(seen, MODEL, spikes, 3, (4,), 0.0)
        assert np.tanh(found / 2) == pytest.approx(np.tanh(exact / 2), abs=4e-3)


def test_with_loops_it_stays_near_the_sum_and_decides_alike() -> None:
    """Four pixels over nine cells, four to each: the loops of a panel. Stated: probabilities of a
    bit within 0.1 RMS, and 97 % of the clear decisions alike."""
    parts = (0.4, 0.25, 0.2, 0.13)
    pixels = [
        {3 * (r + i) + c + j: parts[2 * i + j] for i in range(2) for j in range(2)}
        for r in range(2) for c in range(2)
    ]  # fmt: skip
    seen, rng = footprint(*pixels), np.random.default_rng(7)
    apart, alike = [], []
    for _ in range(8):
        spikes = spikes_of(rng, seen, MODEL, 1, 2, 9)
        exact = by_sum(seen, MODEL, spikes, 9)
        found = propagated(seen, MODEL, spikes, 9, (16,), 0.3)
        apart.append((np.tanh(found / 2) - np.tanh(exact / 2)) / 2)
        clear = np.abs(exact) > 1
        alike.append(((found > 0) == (exact > 0))[clear])
    assert np.sqrt(np.mean(np.square(apart))) < 0.1
    assert np.concatenate(alike).mean() >= 0.97


def test_shares_of_a_pixel_add_up_to_one_and_follow_the_place() -> None:
    layout = Layout(Mode(128, 128, 1, 2, "scrambled", 32))
    place = Registration(np.diag([1.0, 1.0, 1.0]), np.zeros((0, 3)), 0.3)
    row, column = np.array([60, 61, 64]), np.array([60, 70, 64])
    _, share, free = seen_by(layout, place, row, column, 0.3)
    assert (free == (share > 0)).all() and share.sum(axis=1) == pytest.approx(1, abs=0.02)
    # Closed form along either axis: a cell and a pixel of side 1, and the integral of the normal.
    x, y = np.indices((3, 3)).reshape(2, -1) - 1 + np.array([[0.2], [-0.3]])
    exact = np.prod([edge_share(z + 0.5, 0.35) - edge_share(z - 0.5, 0.35) for z in (x, y)], axis=0)
    cell, share, _ = seen_by(layout, place, row[:1], column[:1], 0.35, (0.2, -0.3))
    at = 60 + np.indices((3, 3)).reshape(2, -1)[::-1] - 1
    for n, (r, c) in enumerate(at.T):
        assert share[cell == r * 128 + c].sum() == pytest.approx(exact[n], abs=3e-3)


def scene(
    monkeypatch: pytest.MonkeyPatch, cell: int, ticks: int, moved: tuple[float, float], on: float
) -> tuple[scenes.Scene, Registration]:
    """A scene, and a registration that is `moved` from its own."""
    monkeypatch.setattr(scenes, "FINE", 16)
    layout = Layout(Mode(128, 128, cell, ticks, "scrambled", 32))
    h = scenes.homography(layout, SHAPE, 0.994, 0.3, (0.3, -0.4))
    timing = Timing(8.0, float(ticks), 0.0, SHAPE[0])
    made = scenes.make(
        layout, Registration(h, np.zeros((0, 3)), 0.33), timing, TRAINING + 8, SHAPE,
        known=training(layout), on=on,
    )  # fmt: skip
    shift = np.array([[1, 0, moved[0]], [0, 1, moved[1]], [0, 0, 1]])
    return made, Registration(shift @ h, np.zeros((0, 3)), 0.33)


def information(made: scenes.Scene, place: Registration, name: str, count: int) -> float:
    """Information of a bit of the cells in the middle of the view."""
    parts = made.layout, place, made.timing
    detector: Detector = (
        BeliefPropagation(*parts) if name == "belief-propagation" else make_detector(name, *parts)
    )
    detector.learn(made.words, 0, made.bits[:TRAINING], 0)
    if isinstance(detector, BeliefPropagation):
        assert detector.model is not None
        # What the registration lacks is learned to hundredths of a pixel.
        x, y = place.camera(0, 0)
        u, v = made.registration.camera(0, 0)
        assert detector.model.dx == pytest.approx(float(u - x), abs=0.02)
        assert detector.model.dy == pytest.approx(float(v - y), abs=0.02)
    soft = detector.soft(made.words, 0, TRAINING, count)
    row, column = np.divmod(made.layout.data, made.layout.shape[1])
    side = made.layout.mode.cell
    middle = (np.abs(row * side - 64) < 22) & (np.abs(column * side - 64) < 22)
    found = soft_information(
        soft[:, middle].ravel(), made.bits[TRAINING : TRAINING + count, middle].ravel()
    )
    assert found is not None
    return found.bits


@pytest.mark.slow
def test_large_cells_have_the_information_of_the_joint_detector(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made, place = scene(monkeypatch, 2, 1, (0.0, 0.0), 1.4)
    joint = information(made, place, "joint", 4)
    assert joint > 0.99
    assert information(made, place, "belief-propagation", 4) > joint - 0.003


@pytest.mark.slow
def test_cells_of_one_pixel_gain_much_also_from_a_registration_that_is_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made, place = scene(monkeypatch, 1, 2, (0.04, -0.03), 1.7)
    joint = information(made, place, "joint", 4)
    assert information(made, place, "belief-propagation", 4) > joint + 0.25


def test_what_it_cannot_do_is_said_and_what_is_not_filmed_is_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made, place = scene(monkeypatch, 2, 2, (0.0, 0.0), 1.4)
    detector = BeliefPropagation(made.layout, place, made.timing)
    with pytest.raises(ValueError, match="must have learned"):
        detector.soft(made.words, 0, TRAINING, 1)
    with pytest.raises(ValueError, match="must learn from the training"):
        detector.learn_pilots(made.words, 0, 0, 8)
    with pytest.raises(ValueError, match="known must be of"):
        detector.learn(made.words, 0, made.bits[:, :5], 0)
    detector.model = MODEL
    soft = detector.soft(made.words, 0, TRAINING, 2, stop_tick=8 + 2 * TRAINING + 2)
    assert soft[0].any() and not soft[1].any()


def test_a_scenario_that_asks_for_it_is_told_what_to_write() -> None:
    """No mode takes it; earlier versions had it as a value of the key."""
    with pytest.raises(InputError, match=r"link\.modem\.detector must be one of .*; write packed"):
        ModemSection.model_validate({"detector": "belief-propagation"})
