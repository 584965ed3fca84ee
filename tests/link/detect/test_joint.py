"""The joint detector beside plain forms of what it computes, and what it gains."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from link.detect.catalogue import make_detector
from link.detect.counting import CONTEXT, PAIRS, PHASES, _begin
from link.detect.forward_backward import ForwardBackward
from link.detect.geometry import PLACES, cell_images
from link.detect.joint import Joint
from link.detect.joint_numpy import soft_by_numpy
from link.detect.pixel import PixelLaw
from link.detect.tables import lit, tables
from link.layout import TRAINING, Layout, training
from link.mode import Mode
from link.timing import Registration, Timing
from tests.link.detect.scenes import Scene, homography, make

SYMBOLS = TRAINING + 8


def _scene(
    ticks: int = 2, first: float = 5.37, slope: float = 0.0, degrees: float = 0.3, **given: object
) -> Scene:
    layout = Layout(Mode(128, 128, 2, ticks, "8b10b", 32))
    shape = (220, 220) if abs(degrees) > 5 else (150, 150)
    placed = homography(layout, shape, 0.995, degrees, (0.3, -0.4), 0.004)
    drift = np.array([[0, 0.0, 0.0], [300, 0.6, -0.5]])
    registration = Registration(placed, drift, 0.35)
    timing = Timing(first, ticks * 1.00002, slope, shape[0])
    known = training(layout)
    return make(layout, registration, timing, SYMBOLS, shape, known=known, **given)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return _scene()


def _learned(scene: Scene, name: str = "joint") -> Joint:
    detector = make_detector(name, scene.layout, scene.registration, scene.timing)  # type: ignore[arg-type]
    detector.learn(scene.words, 0, scene.bits[:TRAINING], 0)
    return detector  # type: ignore[return-value]


def _errors(scene: Scene, detector: Joint) -> float:
    soft = detector.soft(scene.words, 0, TRAINING, SYMBOLS - TRAINING)
    return float(((soft > 0) != scene.bits[TRAINING:]).mean())


def _plain(scene: Scene, detector: Joint, cell: int, first: int, symbols: int) -> list[float]:
    """What a window of symbols says of a cell's bits: tick by tick, pixel by pixel, and a chain of
    sums over all sequences of bits."""
    ticks = scene.layout.mode.ticks
    _, single = tables(detector._counts, ticks)
    seen = cell_images(scene.layout, scene.registration)
    said = np.zeros((symbols, PAIRS))
    for n in range(symbols):
        middle = float(scene.timing.start(first + n + 0.5, scene.timing.rows / 2))
        dx, dy = scene.registration.shift(middle)
        u, v = seen.x[cell] + dx, seen.y[cell] + dy
        x, y = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
        place = seen.region[cell], int((v - y + 0.5) * PLACES), int((u - x + 0.5) * PLACES)
        start = float(scene.timing.start(first + n, y))
        for k in range(seen.places.count[place]):
            row, column = y + seen.places.dy[place][k], x + seen.places.dx[place][k]
            share = seen.places.share[place][k]
            for j in range(ticks):
                at = np.arange(int(start) + j - CONTEXT, int(start) + j + 1)
                train = (scene.words[at // 32, row, column] >> (at % 32)) & 1
                before, phase = train[0] + 2 * train[1], int((start % 1) * PHASES)
                said[n] += single[place[0], phase, j, share, before, train[2]]
    total = np.array(
        [
            sum(said[n, 2 * bits[n] + bits[n + 1]] for n in range(symbols))
            for bits in itertools.product((0, 1), repeat=symbols + 1)
        ]
    )
    bits = np.array(list(itertools.product((0, 1), repeat=symbols + 1)), bool)[:, 1:]
    return [
        float(np.logaddexp.reduce(total[bits[:, n]]) - np.logaddexp.reduce(total[~bits[:, n]]))
        for n in range(symbols)
    ]


def test_soft_values_are_the_sum_over_all_sequences() -> None:
    # Slope 1: phases from 0 to 1, where a symbol's first tick says as much of the one before. The
    # kernel takes ln(1 + e^-x) to be linear, wrong by up to 0.07 each of a few times.
    scene = _scene(slope=1.0)
    detector = _learned(scene)
    got = detector.soft(scene.words, 0, TRAINING, 3)
    for cell in range(0, scene.layout.cells, 397):
        plain = _plain(scene, detector, cell, TRAINING - 2, 7)[2:5]
        assert got[:, cell] == pytest.approx(np.clip(plain, -60, 60), abs=0.3)


@pytest.mark.parametrize("name", ["joint", "packed"])
def test_how_the_words_are_cut_does_not_matter(scene: Scene, name: str) -> None:
    detector = _learned(scene, name)
    whole = detector.soft(scene.words, 0, TRAINING, 8)
    w = int(scene.timing.start(TRAINING + 1, 0)) // 32 - 1
    part = detector.soft(scene.words[w:], 32 * w, TRAINING + 3, 5)
    # symbols beyond the window's two change a value by little
    assert np.mean(np.abs(part - whole[3:]) > 0.1) < 0.01
    assert ((part > 0) == (whole[3:] > 0)).mean() > 0.9995


@pytest.mark.parametrize("name", ["joint", "packed"])
def test_a_symbol_held_in_part_is_decided_by_that_part(scene: Scene, name: str) -> None:
    detector = _learned(scene, name)
    whole = detector.soft(scene.words, 0, 40, 8)
    assert int(scene.timing.start(45, 0)) == 95  # the first of its three ticks alone is left
    cut = detector.soft(scene.words[:3], 0, 40, 8)
    assert np.mean(np.abs(cut[:4] - whole[:4]) > 0.1) < 0.03
    assert ((cut[:5] > 0) == (whole[:5] > 0)).mean() > 0.999
    assert (cut[6:] == 0).all()
    same = (cut[5] > 0) == (whole[5] > 0)
    assert not np.array_equal(cut[5], whole[5]) and same.mean() > 0.8


@pytest.mark.parametrize("name", ["joint", "packed"])
def test_words_without_the_symbol_say_nothing(scene: Scene, name: str) -> None:
    detector = _learned(scene, name)
    assert (detector.soft(scene.words, 0, 10_000, 3) == 0).all()
    assert (detector.soft(scene.words, 100_000, TRAINING, 3) == 0).all()


@pytest.mark.parametrize(
    "name",
    ["joint", "packed", "threshold", pytest.param("forward-backward", marks=pytest.mark.slow)],
)
def test_nothing_beyond_the_stream_s_last_tick_is_read(scene: Scene, name: str) -> None:
    # The stream ends 11 ticks into its third word; what the word holds beyond is of no one.
    law = PixelLaw(reset="hard", off=0.02, on=1.42)
    detector = make_detector(
        name, scene.layout, scene.registration, scene.timing, pixel=law,  # type: ignore[arg-type]
    )  # fmt: skip
    if name != "forward-backward":
        detector.learn(scene.words[:2], 0, scene.bits[:28], 0)
    stop, first = 75, 32
    assert scene.timing.start(first + 2, 0) < stop < scene.timing.start(first + 3, 0)
    kept = np.uint32((1 << (stop % 32)) - 1)
    dark, lit = scene.words[:3].copy(), scene.words[:3].copy()
    dark[2] &= kept
    lit[2] |= ~kept
    soft = [detector.soft(each, 0, first, 4, stop) for each in (dark, lit)]
    assert np.array_equal(*soft)
    assert (soft[0][3] == 0).all()  # begins after the end
    # Symbols that are held are decided by what is there, and not by dark ticks that never were.
    assert ((soft[0][:2] > 0) == scene.bits[first : first + 2]).mean() > 0.9
    blind = [detector.soft(each, 0, first, 4) for each in (dark, lit)]
    assert not np.array_equal(blind[0], blind[1]) and not np.array_equal(blind[0], soft[0])


@pytest.mark.parametrize(
    ("given", "most"),
    [
        ({}, 3e-3),
        ({"first": 5.02}, 1e-3),
        ({"slope": 1.0}, 6e-3),
        ({"slope": -1.0, "first": 7.0, "degrees": 33.0}, 6e-3),
        ({"ticks": 4}, 1e-3),
        ({"first": 5.02, "reset": "residual", "background": 0.1}, 1e-3),
    ],
)
def test_it_makes_a_tenth_of_the_plain_receivers_errors(
    given: dict[str, object], most: float
) -> None:
    scene = _scene(**given)  # type: ignore[arg-type]
    joint, plain = (_errors(scene, _learned(scene, name)) for name in ("joint", "threshold"))
    assert joint < most
    assert joint < plain / 10


def test_pilots_alone_teach_it(scene: Scene) -> None:
    detector = make_detector("joint", scene.layout, scene.registration, scene.timing)
    detector.learn_pilots(scene.words, 0, 0, SYMBOLS)
    taught = _errors(scene, detector)  # type: ignore[arg-type]
    assert taught < 1e-2
    assert taught < _errors(scene, _learned(scene, "threshold")) / 4


def test_a_dim_corner_is_learned_by_region() -> None:
    # Towards one corner on cells bring 0.5 thresholds in a tick rather than 1.4: they spike every
    # second or third tick. The tables of those regions know.
    x = np.linspace(0, 1, 150)
    gain = 1 - 0.65 * np.clip(1.5 - 2 * np.hypot(x[:, None], x[None, :]), 0, 1)
    scene = _scene(gain=gain)
    detector = _learned(scene)
    by_region = _errors(scene, detector)
    pooled = detector._counts.sum(axis=0, keepdims=True)
    detector._counts = np.repeat(pooled, len(detector._counts), axis=0)
    detector._tables = None
    assert by_region < 0.5 * _errors(scene, detector)


def test_soft_values_are_as_sure_as_they_should_be() -> None:
    # Of values about a size, a share of 1 / (1 + e^size) is wrong; pixels of one cell share their
    # neighbours' light, which the sum takes for independent: within a factor.
    scene = _scene(slope=1.0, gain=np.full((150, 150), 0.5))  # dim, so that many are in doubt
    detector = _learned(scene)
    soft = detector.soft(scene.words, 0, TRAINING, SYMBOLS - TRAINING)
    wrong = (soft > 0) != scene.bits[TRAINING:]
    chosen = (np.abs(soft) > 0.5) & (np.abs(soft) < 3)
    assert chosen.sum() > 50
    assert 0.05 < wrong[chosen].mean() < 0.6
    assert wrong[np.abs(soft) > 15].mean() < 1e-3


def test_what_is_lit_of_a_symbol_is_its_length() -> None:
    # Its own part of the ticks it owns, and its part of the next one's first tick.
    for ticks in (1, 2, 6):
        part = lit(ticks)
        own, left = part[:, :, 1].sum(axis=1), part[:, 0, 2]
        assert own + left == pytest.approx(ticks)
        assert (part[:, :, 3] == 1).all() and (part[:, :, 0] == 0).all()


@pytest.mark.slow
def test_forward_backward_learns_light_and_reset_by_itself() -> None:
    scene = _scene(first=5.02, reset="residual", background=0.1)
    detector = ForwardBackward(scene.layout, scene.registration, scene.timing)
    detector.learn(scene.words, 0, scene.bits[:TRAINING], 0)
    law = detector.pixel
    assert law.reset == "residual"
    # the blur takes some light from on cells to off ones and leaves their difference smaller
    assert law.off == pytest.approx(0.1, abs=0.06) and law.on == pytest.approx(1.5, rel=0.2)
    few = detector.soft(scene.words, 0, TRAINING, 2)
    wrong = ((few > 0) != scene.bits[TRAINING : TRAINING + 2]).mean()
    assert wrong < _errors(scene, _learned(scene, "threshold")) / 10


def test_what_cannot_be_is_refused(scene: Scene) -> None:
    fresh = make_detector("joint", scene.layout, scene.registration, scene.timing)
    with pytest.raises(ValueError, match="must have learned"):
        fresh.soft(scene.words, 0, 0, 1)
    with pytest.raises(ValueError, match="known must be of"):
        fresh.learn(scene.words, 0, np.zeros((2, 3), np.bool_), 0)
    with pytest.raises(ValueError, match="detector must be one of"):
        make_detector("best", scene.layout, scene.registration, scene.timing)  # type: ignore[arg-type]


def test_the_plain_way_decides_the_same(scene: Scene) -> None:
    detector = _learned(scene)
    ours = detector.soft(scene.words, 0, TRAINING, 5)
    plain = soft_by_numpy(detector, scene.words, 0, TRAINING, 5)
    assert np.abs(ours - plain).max() < 0.3  # ln(1 + e^-x) taken as linear


def test_a_context_that_was_not_met_is_as_those_that_were() -> None:
    """A cell off for a while spikes as seldom as one off for a tick, though no known symbol was."""
    from link.detect.counting import CONTEXT, PART

    counts = np.zeros((1, PHASES, 1, 16, 4, 1 << (PART + CONTEXT)), np.int32)
    for context in (0b01, 0b10, 0b11):  # never 00
        counts[0, 7, 0, 15, 1, context] = 500  # the bit before off, its own on but not yet
    counts[0, 7, 0, 15, 0, 0b00] = 500
    single = tables(counts, 1)[1]
    off_to_on = single[0, 7, 0, 15, 0b00, :, 1]
    assert abs(off_to_on[0]) < 0.05  # no spike says next to nothing


def test_pilots_outside_the_words_are_refused(scene: Scene) -> None:
    detector = Joint(scene.layout, scene.registration, scene.timing)
    with pytest.raises(ValueError, match="at least one whole symbol must be in the words"):
        detector.learn_pilots(scene.words, 0, 10_000, 4)


@pytest.mark.parametrize("first", [4.97, 5.0, 5.03])
def test_symbols_that_begin_with_a_tick_may_drift_without_another_class(first: float) -> None:
    """1000 ticks at 3e-5: such a drift is within the error of an estimated period."""
    layout = Layout(Mode(128, 128, 2, 1, "scrambled", 32))
    registration = Registration(homography(layout, (150, 150), 0.995, 0.3, (0.3, -0.4), 0.0),
                                np.zeros((0, 3)), 0.35)  # fmt: skip
    for drift in (-3e-5, 3e-5):
        moving = Joint(layout, registration, Timing(first, 1 + drift, 0.0, 150))
        classes = {_begin(moving._time, n, 75) for n in range(1000)}
        assert {(tick, phase) for tick, phase in classes if phase} == set(), classes
