"""The choice of a mode: what a pilot's errors foretell, and which modes are tried at all."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import binom

from cosim.run.progress import QuietProgress
from link.coding import Blocks
from link.layout import TRAINING, Layout
from link.line_codes import encode_line
from link.mode import PARITIES, RATES, Mode
from link.setup.choosing import Trial, choose, foresee, longest_run
from link.setup.modes import _Forecast
from link.theory import ldpc_word_error
from tests.link.coding.ldpc_channel import capacity

SIZE, HZ = 4_000_000, 40e3


def _mode(cell: int = 2, ticks: int = 2, line: str = "8b10b", parity: int = 32) -> Mode:
    return Mode(960, 960, cell, ticks, line, parity)  # type: ignore[arg-type]


def _modes() -> list[Mode]:
    return [
        _mode(cell, ticks, line, parity)
        for cell in (1, 2, 3, 4)
        for ticks in (1, 2, 3)
        for line in ("manchester", "4b6b", "8b10b")
        for parity in (16, 32, 64, 128)
    ]


def test_without_errors_goodput_is_the_file_over_its_time() -> None:
    # 2 x 2 cells, two ticks: 4 MB at 10 bits a byte and 255 bytes for 223, less frames' heads.
    mode = _mode()
    frames, overhead, goodput = foresee(mode, 0.0, SIZE, HZ)
    form = Blocks(Layout(mode))
    needed = math.ceil(SIZE / form.symbol_bytes) + 2
    symbols = TRAINING + math.ceil(needed / form.frames) * 10
    assert frames == 0.0
    assert overhead == pytest.approx(2 / (needed - 2))
    assert goodput == pytest.approx(8 * SIZE / (symbols * 2 / HZ))
    assert goodput > 1e9


def test_lost_words_lose_frames_and_frames_cost_time() -> None:
    mode, words = _mode(), float(binom.sf(16, 255, 0.04))
    frames, overhead, goodput = foresee(mode, words, SIZE, HZ)
    form = Blocks(Layout(mode))
    assert frames == pytest.approx(1 - (1 - words) ** form.frame_words)
    needed = math.ceil(SIZE / form.symbol_bytes)
    sent = round(needed * (1 + overhead))
    # enough of them arrive, but for one file in a million; one fewer would not do
    assert binom.cdf(needed + 1, sent, 1 - frames) <= 1e-6
    assert binom.cdf(needed + 1, sent - 1, 1 - frames) > 1e-6
    assert goodput < foresee(mode, 0.0, SIZE, HZ)[2]
    assert foresee(mode, 0.99, SIZE, HZ)[1:] == (math.inf, 0.0)


def test_runs_are_those_of_the_table() -> None:
    # Q = 100: b = .05 -> 11 ticks, .10 -> 5, .15 -> 3, .20 -> 2.
    seen = []
    lines = [_mode(4, 1, line) for line in ("none", "8b10b", "4b6b", "manchester")]
    assert [longest_run(m) for m in lines] == [math.inf, 5, 4, 2]
    for background in (0.05, 0.10, 0.15, 0.20):
        choice = choose(
            lambda _: Trial(100_000, 0, 10_000, 0), lines, size=10**5, hz=HZ, threshold=100.0,
            background=background,
        )  # fmt: skip
        left = [row.mode.line for row in choice.rows if "too long" not in row.why]
        seen.append(set(left))
    assert seen == [
        {"8b10b", "4b6b", "manchester"}, {"8b10b", "4b6b", "manchester"}, {"manchester"},
        {"manchester"},
    ]  # fmt: skip


class _Link:
    """A link whose bits err by cell and ticks alone, one after another."""

    def __init__(self, rates: dict[tuple[int, int], float]) -> None:
        self.rates, self.tried = rates, list[Mode]()

    def __call__(self, mode: Mode) -> Trial:
        self.tried.append(mode)
        p = self.rates[mode.cell, mode.ticks]
        span = {"manchester": 2, "4b6b": 6, "8b10b": 10}[mode.line]
        value = 1 - (1 - p) ** span
        return Trial(10**6, round(p * 10**6), 10**5, round(value * 10**5))


def test_the_fastest_mode_that_holds_is_chosen_with_few_trials() -> None:
    rates = {(c, t): 0.3 if c == 1 else 1e-4 for c in (1, 2, 3, 4) for t in (1, 2, 3)}
    rates[2, 1] = 0.05
    rates[3, 1] = 0.05
    link = _Link(rates)
    choice = choose(link, _modes(), size=SIZE, hz=HZ)
    assert choice.holds
    assert (choice.mode.cell, choice.mode.ticks, choice.mode.line) == (2, 2, "8b10b")
    assert choice.mode.parity == 16
    assert len(link.tried) <= 10
    assert len(choice.rows) == len(_modes())
    tried = [row for row in choice.rows if row.goodput is not None]
    assert max(row.goodput or 0 for row in tried) >= max(
        row.ceiling for row in choice.rows if row.why == "slower than the best"
    )
    assert any("failed" in row.why for row in choice.rows)


def test_more_errors_are_answered_by_more_parity() -> None:
    chosen = []
    for p in (1e-5, 2e-3, 5e-3, 2e-2):
        link = _Link({(2, 2): p})
        modes = [_mode(parity=parity) for parity in (16, 32, 64, 128)]
        choice = choose(link, modes, size=SIZE, hz=HZ)
        assert len(link.tried) == 1  # parity does not change a pilot
        chosen.append((choice.mode.parity, choice.holds))
    assert chosen == [(16, True), (32, True), (64, True), (128, False)]


def test_pilots_without_an_error_are_not_taken_for_perfect() -> None:
    # 200 values without an error: up to 3.7 % may be wrong, which 16 bytes of parity do not mend.
    few = choose(lambda _: Trial(2000, 0, 200, 0), [_mode(parity=16)], size=SIZE, hz=HZ)
    many = choose(lambda _: Trial(10**6, 0, 10**5, 0), [_mode(parity=16)], size=SIZE, hz=HZ)
    assert not few.holds and many.holds
    with pytest.raises(ValueError, match="at least one mode"):
        choose(lambda _: Trial(1, 0, 1, 0), [], size=SIZE, hz=HZ)


def test_a_trial_counts_bits_and_the_values_behind_them() -> None:
    mode = _mode(line="manchester")
    rng = np.random.Generator(np.random.Philox(key=3))
    values = rng.integers(0, 2, (4, 50), np.uint8)
    sent = encode_line("manchester", values)
    soft = np.where(sent, np.float32(4), np.float32(-4))
    assert Trial.of(mode, sent, soft) == Trial(400, 0, 200, 0)
    soft[3, 7] *= -0.1  # unsure and wrong: its pair mends it
    assert Trial.of(mode, sent, soft) == Trial(400, 1, 200, 0)
    soft[2:4, 9] *= -1
    assert Trial.of(mode, sent, soft) == Trial(400, 3, 200, 1)
    # a symbol that belongs to no whole group counts as bits alone
    assert Trial.of(mode, sent[:7], soft[:7]) == Trial(350, 3, 150, 1)


def _scrambled(rates: tuple[float, ...] = RATES, cell: int = 2, ticks: int = 1) -> list[Mode]:
    """Modes of both codes with scrambled symbols."""
    hard = [Mode(960, 960, cell, ticks, "scrambled", parity) for parity in PARITIES]
    return hard + [Mode(960, 960, cell, ticks, "scrambled", None, rate) for rate in rates]


def _noise(sigma: float) -> Trial:
    """A pilot of signs in white noise."""
    mode, rng = _scrambled()[-1], np.random.Generator(np.random.Philox(key=4))
    sent = rng.integers(0, 2, (40, 20_000), np.uint8).astype(np.bool_)
    seen = np.where(sent, 1.0, -1.0) + sigma * rng.standard_normal(sent.shape)
    return Trial.of(mode, sent, (2 * seen / sigma**2).astype(np.float32))


def test_information_of_the_pilot_chooses_the_rate() -> None:
    """The highest rate whose words arrive, in noise that would cost Reed-Solomon more."""
    size = 20 * SIZE  # or some of them would take as many blocks
    for sigma in (0.3, 0.4, 0.5, 0.55):
        got = _noise(sigma)
        assert got.information == pytest.approx(capacity(sigma), abs=4e-3)
        choice = choose(lambda _, got=got: got, _scrambled(), size=size, hz=HZ)  # type: ignore[misc]
        assert choice.holds and choice.mode.rate is not None
        above = [rate for rate in RATES if rate > choice.mode.rate]
        assert ldpc_word_error(choice.mode.rate, capacity(sigma)) < 1e-4
        assert all(ldpc_word_error(rate, capacity(sigma)) > 1e-9 for rate in above[1:])
        (row,) = (row for row in choice.rows if row.mode == choice.mode)
        assert row.byte is None and row.information is not None
        assert capacity(sigma) - 0.02 < row.information < capacity(sigma)
        hard = choose(lambda _, got=got: got, _scrambled(()), size=size, hz=HZ)  # type: ignore[misc]
        best = max(r.goodput or 0.0 for r in hard.rows)
        assert (row.goodput or 0.0) > best
    worst = _noise(1.0)
    choice = choose(lambda _: worst, _scrambled(), size=SIZE, hz=HZ)
    assert not choice.holds and choice.mode.parity == 128  # the surest of both codes


def test_runs_of_scrambled_symbols_are_what_the_pilot_shows() -> None:
    """Brighter stray light excludes line codes with long runs, but scrambled symbols only where an
    ON tick does not fill the threshold."""
    modes = [*_scrambled(), _mode(4, 1, "8b10b"), _mode(4, 1, "manchester")]
    for on, left in ((1.4, {"scrambled", "manchester"}), (0.9, {"manchester"})):
        choice = choose(
            lambda _: Trial(100_000, 0, 10_000, 0, 0.99), modes, size=10**5, hz=HZ,
            threshold=100.0, background=0.15, on=on,
        )  # fmt: skip
        assert {row.mode.line for row in choice.rows if "too long" not in row.why} == left


def test_pilots_that_take_long_say_once_how_long(monkeypatch):
    """By the second pilot: the first one compiles."""
    moments = iter([0.0, 50.0, 54.0, 60.0])
    monkeypatch.setattr("link.setup.modes.time.monotonic", lambda: next(moments))
    progress = QuietProgress()
    forecast = _Forecast(progress, "forward-backward")
    for left in (21, 20, 19):
        forecast.film(left)
    (note,) = progress.notes
    assert note.startswith("the pilots take up to 80 s with the detector forward-backward; give")
