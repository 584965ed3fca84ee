"""The packed detector beside its plain form, and its information beside that of the joint one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from link.detect.catalogue import make_detector
from link.detect.detector import Soft
from link.detect.joint import Joint
from link.detect.packed import Packed
from link.layout import TRAINING, Layout
from link.mode import Mode
from link.theory.soft_information import soft_information
from link.timing import Registration, Timing
from tests.link.detect.packed_numpy import packed_by_numpy
from tests.link.detect.scenes import Scene, homography, make

SYMBOLS = TRAINING + 24
SHAPE = 150, 150
TICK = np.arange(0, 400, 16)
SHAKEN = np.column_stack([TICK, 0.15 * np.sin(TICK / 48), 0.15 * np.cos(TICK / 48)])
"""Drift of 0.15 camera pixels at 130 Hz: some 13 times as fast as that of the shipped scenario."""


def _scene(
    cell: int = 2, ticks: int = 1, first: float = 5.25, slope: float = 0.0,
    drift: npt.NDArray[np.float64] = SHAKEN, **given: object,
) -> Scene:  # fmt: skip
    """Random symbols, the first of which are known: the training fits no symbol of one tick."""
    layout = Layout(Mode(128, 128, cell, ticks, "none", 32))
    registration = Registration(homography(layout, SHAPE, 0.995, 0.3, (0.3, -0.4)), drift, 0.35)
    timing = Timing(first, ticks * 1.00002, slope, SHAPE[0])
    return make(layout, registration, timing, SYMBOLS, SHAPE, **given)  # type: ignore[arg-type]


def _learned(scene: Scene, name: str) -> Joint:
    detector = make_detector(name, scene.layout, scene.registration, scene.timing)
    detector.learn(scene.words, 0, scene.bits[:TRAINING], 0)
    assert isinstance(detector, Joint)
    return detector


def _soft(scene: Scene, name: str) -> Soft:
    return _learned(scene, name).soft(scene.words, 0, TRAINING, SYMBOLS - TRAINING - 2)


def _information(soft: Soft, sent: npt.NDArray[np.bool_]) -> float:
    found = soft_information(soft, sent)
    assert found is not None
    return found.bits


@pytest.mark.parametrize(
    ("cell", "ticks", "slope"), [(2, 1, 0.0), (2, 2, 1.0), (1, 1, -1.0), (2, 3, 0.0), (1, 4, 0.0),
                                 (4, 6, 0.0)]
)  # fmt: skip
def test_its_soft_values_are_those_of_the_plain_form(cell: int, ticks: int, slope: float) -> None:
    scene = _scene(cell, ticks, 8.3, slope)
    detector = _learned(scene, "packed")
    assert isinstance(detector, Packed)
    ours = detector.soft(scene.words, 0, TRAINING, 13)
    plain = packed_by_numpy(detector, scene.words, 0, TRAINING, 13)
    # The chain's sums of float32 are rounded otherwise: some units in the seventh place of 1e3.
    assert np.abs(ours - plain).max() < 2e-3
    assert np.abs(ours).max() > 5


@pytest.mark.parametrize("ticks", [1, 2, 4])
@pytest.mark.parametrize("first", [5.02, 5.25, 5.5, 5.75])
def test_it_keeps_the_information(ticks: int, first: float) -> None:
    scene = _scene(ticks=ticks, first=first)
    sent = scene.bits[TRAINING : SYMBOLS - 2]
    joint, packed = (_information(_soft(scene, name), sent) for name in ("joint", "packed"))
    assert joint > 0.5
    # Both decide the same bits, so that the difference is known better than either.
    assert packed > joint - 0.002


def test_it_keeps_the_information_of_cells_of_one_pixel() -> None:
    scene = _scene(cell=1, ticks=2, first=5.1)
    sent = scene.bits[TRAINING : SYMBOLS - 2]
    joint, packed = (_information(_soft(scene, name), sent) for name in ("joint", "packed"))
    assert packed > joint - 0.002


def test_a_still_image_is_one_look_and_a_moving_one_several() -> None:
    still, moving = (
        _learned(_scene(drift=drift), "packed") for drift in (np.zeros((0, 3)), SHAKEN)
    )
    assert isinstance(still, Packed) and isinstance(moving, Packed)
    assert len(still.looks(TRAINING, 6, SHAPE[0]).ends) == 1
    looks = moving.looks(TRAINING, 6, SHAPE[0])
    assert len(looks.ends) > 1 and looks.ends[-1] == 6 and (np.diff(looks.ends) > 0).all()


def test_a_clock_far_off_moves_the_tick_within_a_call() -> None:
    # A symbol of 2.01 ticks passes a tick's edge every hundred symbols.
    layout = Layout(Mode(128, 128, 2, 2, "none", 32))
    registration = Registration(homography(layout, SHAPE, 0.995), np.zeros((0, 3)), 0.35)
    timing = Timing(5.5, 2.01, 0.0, SHAPE[0])
    scene = make(layout, registration, timing, SYMBOLS, SHAPE)
    soft = {name: _soft(scene, name) for name in ("joint", "packed")}
    wrong = {name: ((each > 0) != scene.bits[TRAINING : SYMBOLS - 2]).mean()
             for name, each in soft.items()}  # fmt: skip
    assert wrong["packed"] <= 1.2 * wrong["joint"] + 1e-4


def test_cells_at_the_sensor_s_edge_are_decided_by_what_is_there() -> None:
    scene = _scene(ticks=2, drift=np.zeros((0, 3)))
    detector = {name: _learned(scene, name) for name in ("joint", "packed")}
    cut = np.ascontiguousarray(scene.words[:, :, 20:])
    place = np.array([[1, 0, -20], [0, 1, 0], [0, 0, 1.0]]) @ scene.registration.homography
    moved = Registration(place, scene.registration.drift, scene.registration.blur)
    soft = {}
    for name, of_whole in detector.items():
        other = make_detector(name, scene.layout, moved, scene.timing)
        assert isinstance(other, Joint)
        other._counts = of_whole._counts
        soft[name] = other.soft(cut, 0, TRAINING, 8)
    assert np.abs(soft["joint"] - soft["packed"]).max() < 0.1
    assert ((soft["joint"] == 0) == (soft["packed"] == 0)).mean() > 0.999


def test_rows_are_timed_one_by_one_only_if_they_differ() -> None:
    scene = _scene(ticks=2)
    for slope, rows in ((0.0, 1), (0.5, SHAPE[0])):
        timing = Timing(5.25, 2.0, slope, SHAPE[0])
        detector = make_detector("packed", scene.layout, scene.registration, timing)
        assert isinstance(detector, Packed)
        assert detector.looks(TRAINING, 4, SHAPE[0]).tick.shape[0] == rows
