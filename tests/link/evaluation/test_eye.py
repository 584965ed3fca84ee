"""The eye diagram of streams whose eye is known in closed form."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from scipy.stats import binom

from cosim import Clock, Viform
from link.evaluation.eye import RARE, Eye, open_eye
from link.mode import Mode
from link.sending import FileTransmission, PlaneStream
from link.timing import Registration, Timing

CLOCK = Clock(40_000)
MODE = Mode(128, 128, 2, 2, "8b10b", 32)
TICKS, PIXELS = 2, 4
SENT = FileTransmission(MODE, hashlib.shake_256(b"eye").digest(1500), "a.bin")


def eye_of(stream: Viform | PlaneStream, first: float = 0.0, slope: float = 0.0) -> Eye:
    """A camera whose pixels are the panel's: every tick of a cell is what the cell shows."""
    height, width = stream.shape
    timing = Timing(first, TICKS, slope, height)
    there = Registration(np.eye(3), np.zeros((0, 3)))
    eye = open_eye(stream, SENT.layout, there, timing, SENT.bits, SENT.symbols)
    assert eye is not None and (height, width) == (MODE.height, MODE.width)
    return eye


@pytest.fixture(scope="module")
def clean() -> Eye:
    return eye_of(PlaneStream(SENT, CLOCK))


def test_without_noise_it_is_the_triangle_of_a_sliding_mean(clean: Eye) -> None:
    # A neighbour of the other kind enters the window in proportion to how far it has slid.
    off = np.abs(clean.x) / TICKS
    assert clean.low == pytest.approx(1 - off, abs=1e-6)
    assert clean.high == pytest.approx(off, abs=1e-6)
    assert (clean.height, clean.level) == pytest.approx((1.0, 0.5))
    assert clean.width == pytest.approx(TICKS, abs=2 * (clean.x[1] - clean.x[0]))
    assert clean.sampled == pytest.approx((0.0, 0.0))


def test_every_trace_crosses_every_instant(clean: Eye) -> None:
    assert (clean.density.sum(axis=0) == clean.traces).all() and clean.traces > 3000
    middle = clean.density[:, clean.x.size // 2]
    assert middle[0] + middle[-1] == clean.traces  # all off or all on at the instant of sampling
    assert middle[-1] / clean.traces == pytest.approx(0.5, abs=0.02)  # 8B10B is balanced


@pytest.mark.parametrize(("phase", "nearest"), [(0.25, -0.25), (-0.4, 0.4)])
def test_the_camera_s_ticks_lie_where_the_phase_says(phase: float, nearest: float) -> None:
    eye = eye_of(PlaneStream(SENT, CLOCK), first=phase)
    assert eye.sampled == pytest.approx((nearest, nearest))
    assert eye.height == pytest.approx(1.0)
    opened = eye.x[eye.low > eye.high]
    assert (opened[0] + opened[-1]) / 2 == pytest.approx(-phase, abs=0.05)


def test_rows_of_other_phases_fill_the_time_between_ticks() -> None:
    eye = eye_of(PlaneStream(SENT, CLOCK), slope=0.3)
    assert eye.sampled[1] - eye.sampled[0] == pytest.approx(0.9 * 0.3, abs=0.03)


def test_noise_closes_it_as_the_binomial_law_says() -> None:
    # Every pixel errs in a share of its ticks: sums of PIXELS x TICKS of them.
    share, n = 0.1, PIXELS * TICKS
    words = SENT.words(0, SENT.planes)
    rng = np.random.Generator(np.random.Philox(key=3))
    planes = rng.random((SENT.planes, MODE.height, MODE.width)) < share
    flips = Viform.from_planes(planes, CLOCK).words
    eye = eye_of(Viform(words ^ flips, SENT.planes, CLOCK))
    low, high = binom.ppf(RARE, n, 1 - share) / n, binom.ppf(1 - RARE, n, share) / n
    # Shares are told in classes of 1/16, so pixels wholly within a cell weigh up to 1/15 apart.
    assert (eye.height, eye.level) == pytest.approx((low - high, (low + high) / 2), abs=0.02)
    assert 0 < eye.width < TICKS
    closed = rng.random(planes.shape) < 0.4
    flips = Viform.from_planes(closed, CLOCK).words
    shut = eye_of(Viform(words ^ flips, SENT.planes, CLOCK))
    assert shut.height < 0 and shut.width == 0


@pytest.mark.parametrize("cycles", [1, 60, 96, 103])
def test_a_stream_without_a_symbol_and_its_neighbours_has_none(cycles: int) -> None:
    short = Viform(SENT.words(0, cycles), cycles, CLOCK)
    there = Registration(np.eye(3), np.zeros((0, 3)))
    timing = Timing(0.0, TICKS, 0.0, MODE.height)
    assert open_eye(short, SENT.layout, there, timing, SENT.bits, SENT.symbols) is None
