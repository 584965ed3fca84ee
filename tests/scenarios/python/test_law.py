"""An error of the run and an error in law: what each promises, held against streams of a camera and
against renewal theory.

Theory is that of `tests/sensor/latched/fast/test_bank_statistics.py`: intervals of charge are
Gamma(Q) and a run starts at a random instant, so light of any course has the counts of its charge.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

import viform
from cosim.plan.error import Law
from sensor.latched.bounds import LatchedBounds
from sensor.latched.check.plan_check import PlanCheck
from sensor.latched.core import Filmed
from tests.sensor.latched.fast.test_bank_statistics import (
    FAR,
    below,
    count_law,
    latched_law,
    moments,
    p_value,
)

SIZE = 64, 128
RATE = 2000.0
CYCLES = 20
"""Cycles of the latch clock, of 40 kHz, in a frame."""
F_NUMBER = 12.69135627
"""f-number at which white fires once a cycle, where the illuminance is 100 lux an electron of the
threshold."""


def film(
    q: float, white: float, course: npt.NDArray[np.float64], *, tolerance: float = 1e-3,
    draws: str = "bank", seed: int = 1, check: bool = False, size: tuple[int, int] = SIZE,
) -> Filmed:  # fmt: skip
    """A film of even light. white: spikes a cycle; course: of the frames, 0 to 1."""
    frames = np.broadcast_to(course.astype(np.float32)[:, None, None], (course.size, *size))
    height, width = size
    # A lens is chosen for at most one spike a cycle; beyond that its f-number is given.
    lens = {} if white <= 1 else {"lens.f_number": F_NUMBER / np.sqrt(white)}
    with viform.Camera(
        width=width, height=height, threshold=f"{q} e", tolerance=tolerance, draws=draws, seed=seed,
        illuminance=f"{100 * q} lux", **lens,
    ) as camera:  # fmt: skip
        seen = camera.film(frames, frame_rate=RATE, white_rate=None if lens else white, check=check)
    assert seen.white_rate == pytest.approx(white, rel=1e-4)
    return seen


def fired(seen: viform.Viform) -> npt.NDArray[np.uint8]:
    """(pixels, cycles) of 0 and 1."""
    flat = np.ascontiguousarray(seen.words.reshape(len(seen.words), -1).T).view(np.uint8)
    return np.unpackbits(flat, axis=1, bitorder="little")[:, : seen.cycles]


def stated(seen: Filmed) -> LatchedBounds:
    assert seen.error is not None
    return seen.error


def law_of(seen: Filmed) -> Law:
    law = stated(seen).law
    assert law is not None
    return law


@cache
def issue(tolerance: float, draws: str = "bank") -> Filmed:
    """Even light of 50 ms on 128 x 64 pixels, of 60 e and .31 spikes a cycle."""
    check = tolerance > 0 and draws == "bank"
    return film(60, 0.31, np.ones(100), tolerance=tolerance, draws=draws, check=check)


def rms(one: npt.NDArray[np.float64], other: npt.NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean((one - other) ** 2)) / other.mean())


def counts(seen: Filmed, window: slice = slice(None)) -> npt.NDArray[np.float64]:
    return fired(seen)[:, window].sum(axis=1, dtype=np.float64)


def test_other_noise_is_an_error_in_law_and_its_spikes_are_others() -> None:
    fast, full = issue(1e-3), issue(0.0)
    error = stated(fast)
    assert error.of == "law" and error.measured is not None
    # Two runs of one noise would agree within the limit that is stated; these do not.
    differ = rms(counts(fast), counts(full))
    assert (
        differ > 10 * error.measured.high
        and rms(counts(fast, slice(980, 1021)), counts(full, slice(980, 1021)))
        > 100 * error.measured.high
    )
    assert error.measured.low + error.left_out["a draw for each spike"] / 2 > 0
    assert error.measured.value >= error.left_out["a draw for each spike"] / 2
    assert error.measured.high <= error.tolerance


def test_the_law_of_other_noise_is_within_the_stated_limits() -> None:
    fast, full = fired(issue(1e-3)), fired(issue(0.0))
    law = law_of(issue(1e-3))
    one, other = (each.sum(axis=1, dtype=float) for each in (fast, full))
    mean = one.mean() / other.mean() - 1
    assert law.mean.ci[0] < mean < law.mean.ci[1] and abs(law.mean.value) < 1e-3
    # Windows apart; the scatter of a variance of n counts is its sqrt(2 / n).
    windows = [each[:, :1968].reshape(-1, 48, 41).sum(axis=2) for each in (fast, full)]
    many = windows[0].size
    variance = windows[0].var() / windows[1].var() - 1
    chance = FAR * np.sqrt(4 / many)
    assert law.variance.ci[0] - chance < variance < law.variance.ci[1] + chance
    intervals = [np.diff(np.flatnonzero(each)) for each in (fast, full)]
    shares = [np.bincount(each, minlength=40)[:40] / each.size for each in intervals]
    assert np.abs(shares[0] - shares[1]).sum() / 2 < law.interval_tv.ci[1]
    for figure in vars(law).values():
        assert figure.ci[0] <= figure.value <= figure.ci[1]


@pytest.mark.parametrize("draws", ["each", "bank"])
def test_the_draws_of_full_physics_are_kept_where_they_are_asked_for(draws: str) -> None:
    kept = issue(1e-3, draws)
    error, same = stated(kept), rms(counts(kept), counts(issue(0.0)))
    assert (error.of == "run") == (draws == "each") == (error.law is None)
    assert ("a draw for each spike" in error.left_out) == (draws == "bank")
    assert (same < 1e-4) == (draws == "each")


def test_patches_are_filmed_with_the_camera_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    filmed: dict[str, list[npt.NDArray[np.uint8]]] = {}
    numbers: list[npt.NDArray[np.uint32]] = []
    before = PlanCheck.filmed

    def watched(
        self: PlanCheck, name: str, words: npt.NDArray[np.uint32], start: int, cycles: int
    ) -> None:
        before(self, name, words, start, cycles)
        numbers[:] = [self.plane.numbers]
        flat = np.ascontiguousarray(words.T).view(np.uint8)
        spikes = np.unpackbits(flat, axis=1, bitorder="little")[:, :cycles]
        filmed.setdefault(name, []).append(spikes)

    monkeypatch.setattr(PlanCheck, "filmed", watched)
    seen = film(300, 0.4, np.linspace(1, 0.2, 12), check=True)
    run = fired(seen)[numbers[0]]
    assert stated(seen).of == "law" and numbers[0].size >= 512
    assert np.array_equal(np.concatenate(filmed["bank"], axis=1), run)
    # The camera with the draws of full physics, for pairs, is another one.
    assert (np.concatenate(filmed["run"], axis=1) != run).mean() > 0.05


@dataclass(frozen=True)
class Setting:
    """A threshold in electrons, spikes a cycle of white, a length in cycles, and whether light
    moves."""

    q: float
    rate: float
    cycles: int
    moving: bool = False

    @property
    def course(self) -> npt.NDArray[np.float64]:
        frames = self.cycles // CYCLES
        moved = 0.55 + 0.45 * np.cos(np.arange(frames) * 1.7)
        return moved if self.moving else np.ones(frames)

    @property
    def mean(self) -> float:
        """Mean rate: light is linear between frames, and that of the last frame stays."""
        light = np.append(self.course, self.course[-1])
        return self.rate * float((light[1:] + light[:-1]).mean() / 2)


SETTINGS = [
    Setting(20, 0.3, 400), Setting(60, 0.02, 4000), Setting(60, 0.31, 640),
    Setting(300, 0.6, 640, moving=True), Setting(1000, 0.0731, 800),
    Setting(10_000, 0.31, 640), Setting(100_000, 0.2973, 640, moving=True),
    Setting(100, 1.3, 400),
]  # fmt: skip


@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_streams_have_the_law_of_renewal_theory(setting: Setting) -> None:
    q, mean = float(setting.q), setting.mean
    seen = film(q, setting.rate, setting.course, tolerance=1e-2)
    # A law that is too wide has no bank.
    assert stated(seen).of == ("run" if q == 20 else "law")
    spikes = fired(seen)
    found = spikes.sum(axis=1, dtype=np.int64)
    n = found.size
    # Two spikes of a cycle are one bit: a cycle of light x has one with E[min(X, x)] / Q.
    if setting.rate > 1:
        x = np.array(q * (seen.white_rate or 0))
        expected = float((x - below(q, x)) / q) * setting.cycles
        assert abs(found.mean() - expected) < FAR * found.std() / np.sqrt(n)
        return
    k, law = count_law(q, mean, setting.cycles)
    expected, variance = moments(k, law)
    assert abs(found.mean() - expected) < FAR * np.sqrt(variance / n)
    fourth = float(((k - expected) ** 4 * law).sum())
    assert abs(found.var() - variance) < FAR * np.sqrt((fourth - variance**2) / n)
    assert p_value(found, k, law) > 1e-4
    rows = (found - found.mean()).reshape(-1, SIZE[1]) / found.std()
    for lag in range(1, 17):
        pairs = rows[:, lag:] * rows[:, :-lag]
        assert abs(pairs.mean()) < FAR / np.sqrt(pairs.size), lag
    sums = rows.reshape(-1, 16).sum(axis=1)
    assert abs(sums.var() / 16 - 1) < FAR * np.sqrt(2 / sums.size)
    if not setting.moving:
        _intervals(spikes, q, setting.rate)


def _intervals(spikes: npt.NDArray[np.uint8], q: float, rate: float) -> None:
    """Two successive latched intervals of pixels that fire in one cycle, for cycles so far apart
    that no interval counts twice."""
    both: list[npt.NDArray[np.int64]] = []
    reach = int(2 * (1 + 9 / np.sqrt(q)) / rate) + 3
    for start in range(reach, spikes.shape[1] - reach, reach):
        after = spikes[spikes[:, start] == 1, start + 1 : start + 1 + reach]
        first = after.argmax(axis=1)
        after = np.where(np.arange(reach) > first[:, None], after, 0)
        both.append(np.stack([first + 1, after.argmax(axis=1) - first]))
    one, two = np.concatenate(both, axis=1)
    k, law = latched_law(q, rate)
    expected, variance = moments(k, law)
    assert abs(one.mean() - expected) < FAR * np.sqrt(variance / one.size)
    assert p_value(one, k, law) > 1e-4
    together = moments(*latched_law(2 * q, rate / 2))[1]
    correlation = np.mean((one - expected) * (two - expected)) / variance
    assert abs(correlation - (together / 2 / variance - 1)) < FAR * 1.5 / np.sqrt(one.size)


@pytest.mark.parametrize("many", [4, pytest.param(1000, marks=pytest.mark.slow)])
def test_stated_limits_hold_in_random_scenes(many: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The change of the law by the bank is known, so the limits of what a check has measured either
    include it or not: one in a thousand may not."""
    computed: list[Law | None] = []

    def law(check: PlanCheck) -> Law | None:
        computed[:] = [check._law]
        return check.patches_law()  # before what is computed is added

    monkeypatch.setattr(PlanCheck, "law", law)
    rng = np.random.default_rng(5)
    missed = dict.fromkeys(vars(law_of(issue(1e-3))), 0)
    thresholds = (60.0, 300.0, 5000.0) if many < 10 else (50.0, 60.0, 100.0, 300.0, 5000.0, 1e5)
    tried = 0
    while tried < many:
        q, white = float(rng.choice(thresholds)), float(np.exp(rng.uniform(-3, -0.4)))
        setting = Setting(q, white, CYCLES * int(rng.integers(8, 16)), bool(rng.integers(2)))
        seen = film(
            q, white, setting.course, seed=int(rng.integers(2**32)), check=True, size=(48, 48)
        )
        error = stated(seen)
        if error.of == "run":  # the reference has all tiles
            continue
        tried += 1
        assert error.measured is not None and error.measured.high <= error.tolerance
        law = law_of(seen)
        for name, figure in vars(law).items():
            known = vars(computed[0])[name].value
            missed[name] += not figure.ci[0] <= known <= figure.ci[1]
        # All pixels of the chip, against theory, within the limits that are stated of a part.
        found = fired(seen).sum(axis=1, dtype=np.int64)
        mean, variance = moments(*count_law(q, setting.mean, seen.cycles))
        chance = FAR * np.sqrt(variance / found.size) / mean
        change = found.mean() / mean - 1
        assert law.mean.ci[0] - chance < change < law.mean.ci[1] + chance, setting
    assert max(missed.values()) <= max(many // 200, 1), missed
