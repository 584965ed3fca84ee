"""Switching logic that couples onto the sampled pixels, against closed forms.

The work cycles are counted by an n-bit binary or Gray counter. In binary, 2^b divides the count in
one of 2^b steps, and bit b toggles then: a step toggles j bits with probability 2^-j, and n bits
with 2^-(n - 1), a geometric law cut at n.
"""

from __future__ import annotations

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.clock import PS
from imagers.adaptive.device.imager import AdaptiveExposure
from imagers.adaptive.device.signals import Coupling, row_kicks, signals_of, toggles
from imagers.adaptive.device.timing import Timing, frames_of
from imagers.adaptive.pixels import AdaptivePixels, CmosExposed, CmosSetting
from imagers.common.scenery import Still
from imagers.run.check import cut_rows
from tests.imagers.adaptive.counter_sequencer import CounterSequencer
from tests.imagers.adaptive.test_sequencer import SMALL, USUAL, small_exposures

BITS = 8
RAMP = Timing(256, 256, line=39 * 20, frame=10_000 * 20, timer_bits=BITS)
"""39 work cycles a line, an odd number: the 256 rows meet every count of 8 bits once."""
PIXELS = AdaptivePixels((256, 256), CmosSetting(gain=16.0))
CHARGE, CYCLE, IDLE = 200.0, 1e-6, 0.5e-6
CODES = st.sampled_from(["gray", "binary"])


def law(bits: int) -> tuple[float, float]:
    """Mean and variance of the bits that a step of a binary counter toggles, over all steps:
    E[x] = sum P(x >= j), E[x^2] = sum (2j - 1) P(x >= j) with P(x >= j) = 2^-(j - 1)."""
    cut = 2.0 ** (1 - bits)
    return 2 - cut, 2 - (2 * bits - 1) * cut - cut**2


def filtered(bits: int, x: float) -> tuple[float, float]:
    """The same of sum x^k n(i - k), k >= 0, over all steps i. Bit b adds x^(i mod 2^b) / (1 -
    x^(2^b)), with the mean 2^-b / (1 - x); of bits b <= c the product has the mean
    2^-c (1 + x^(2^b)) / ((1 - x^2)(1 - x^(2^b)))."""
    mean = law(bits)[0] / (1 - x)
    square = 0.0
    for b in range(bits):
        y = x ** (1 << b)
        weight = 2.0**-b + 2 * sum(2.0**-c for c in range(b + 1, bits))
        square += weight * (1 + y) / ((1 - x**2) * (1 - y))
    return mean, square - mean**2


def added(coupling: Coupling, *, noisy: bool = False) -> np.ndarray:
    """(rows,) mean change of the second frame's rows by a coupling, e. The columns of the scene
    divide one DN evenly, so a row without noise is known to 1/256 DN."""
    exposure = 30  # T: every reset is 30 us before a sample
    dn = 100 + (np.arange(256) + 0.5) / 256
    lux = np.tile(
        dn * PIXELS.setting.step / PIXELS.setting.sensitivity / (exposure * CYCLE), (256, 1)
    )
    values = []
    for each in (None, coupling):
        imager = AdaptiveExposure(PIXELS, RAMP, coupling=each)
        imager.write("adaptive_automatic", 0)
        imager.write("adaptive_user", exposure)
        kept = PIXELS.everything if noisy else frozenset[str]()
        frames = list(imager.film(Still(lux), 3 * PS // 100, seed=5, kept=kept))
        values.append(frames[1].values.astype(np.float64))
    return (values[1] - values[0]).mean(axis=1) * PIXELS.setting.step


@settings(max_examples=15, deadline=None)
@given(small_exposures, CODES, st.booleans(), st.sampled_from([3.0, 100.0]))
def test_kicks_are_those_of_the_sequencer_clock_by_clock(exposures, code, idle, tau) -> None:
    frames = frames_of(SMALL, exposures)
    ticks = list(CounterSequencer(SMALL, exposures, code).run())
    expected = {}
    for before, tick in pairwise(ticks):
        names = ("timer", "columns", "row", "reset1", "reset2")
        bits = sum((before.codes[n] ^ tick.codes[n]).bit_count() for n in names)
        expected |= {tick.clock: bits} if bits else {}
    clocks, bits = toggles(SMALL, frames, 0, len(ticks), code)
    made = np.bincount(clocks, bits)
    assert {int(c): int(made[c]) for c in np.nonzero(made)[0]} == expected

    coupling = Coupling(7.0, tau / SMALL.clock.hz, code, idle)
    late = 0 if idle else SMALL.cycle - SMALL.work
    for number, frame in enumerate(frames):
        sums = [
            sum(n * math.exp((c + late - s) / tau) for c, n in expected.items() if c + late < s)
            for s in map(frame.sample, range(SMALL.rows))
        ]
        kicks = row_kicks(SMALL, frames, number, coupling)
        assert kicks == pytest.approx(7 * np.array(sums), rel=1e-9)


def test_a_whole_turn_of_a_counter_obeys_the_law_and_gray_steps_are_one() -> None:
    for n in (1, 2, 5, 8, 12):
        timing = Timing(2, 2, line=100, frame=220, timer_bits=n)
        for code, (mean, variance) in {"gray": (1.0, 0.0), "binary": law(n)}.items():
            _, bits = toggles(timing, [], 20, 20 * (1 << n) + 20, code)
            assert bits.size == 1 << n
            assert (bits.mean(), bits.var()) == pytest.approx((mean, variance), abs=1e-12)


@pytest.mark.parametrize("idle", [True, False])
def test_gray_code_adds_a_geometric_series_to_every_row(idle: bool) -> None:
    tau = 0.7e-6
    delay = CYCLE if idle else CYCLE - IDLE
    series = CHARGE * math.exp(-delay / tau) / (1 - math.exp(-CYCLE / tau))
    rows = added(Coupling(CHARGE, tau, "gray", idle))
    assert rows == pytest.approx(np.full(256, series), abs=PIXELS.setting.step / 256)
    noisy = added(Coupling(CHARGE, tau, "gray", idle), noisy=True)  # the same draws in both runs
    assert noisy.mean() == pytest.approx(series, abs=5 * 0.5 * PIXELS.setting.step / 256)


@pytest.mark.parametrize("idle", [True, False])
def test_binary_code_adds_a_pattern_of_rows_with_the_variance_of_the_law(idle: bool) -> None:
    tau, fine = 0.7e-6, PIXELS.setting.step / 256
    first = CHARGE * math.exp(-(CYCLE if idle else CYCLE - IDLE) / tau)
    mean, variance = filtered(BITS, math.exp(-CYCLE / tau))
    rows = added(Coupling(CHARGE, tau, "binary", idle))
    assert rows.mean() == pytest.approx(first * mean, abs=fine)
    assert rows.std() == pytest.approx(first * math.sqrt(variance), abs=fine)
    assert filtered(BITS, 0.0) == pytest.approx(law(BITS))


def test_a_carry_of_n_bits_kicks_n_times() -> None:
    tau = 0.1e-6
    charge = CHARGE * math.exp((CYCLE - IDLE) / tau)
    rows = added(Coupling(charge, tau, "binary", idle=False)) / CHARGE
    assert rows == pytest.approx(np.rint(rows), abs=1e-3)
    count = np.bincount(np.rint(rows).astype(int))
    assert count.tolist() == [0, 128, 64, 32, 16, 8, 4, 2, 2]


def test_idle_phases_attenuate_every_kick_by_their_length() -> None:
    frames = frames_of(USUAL, [20 << 12, 20 << 9, 20 << 13, 20])
    for tau in (0.2e-6, 5e-6):
        for number in range(4):
            on, off = (
                row_kicks(USUAL, frames, number, Coupling(3.0, tau, "binary", idle))
                for idle in (True, False)
            )
            assert on == pytest.approx(off * math.exp(-IDLE / tau), rel=1e-9)


def test_no_charge_is_no_coupling_and_parts_of_a_frame_are_kicked_alike() -> None:
    assert not added(Coupling(0.0, 1e-6, "binary"), noisy=True).any()
    rng = np.random.default_rng(4)
    rows = CmosExposed(
        rng.uniform(0, 1e-2, (256, 256)), np.full(256, 1e-3), np.zeros(256), 0, 3,
        rng.uniform(0, 500, 256),
    )  # fmt: skip
    at = slice(70, 90)
    whole, part = (PIXELS.convert(r, 1, PIXELS.everything) for r in (rows, cut_rows(rows, at)))
    assert (whole[at] == part).all()


def test_the_trace_holds_the_code_that_toggles() -> None:
    frames = frames_of(SMALL, [20, 40])
    codes = {
        code: [v for _, name, v in signals_of(SMALL, frames, code) if name == "row"]
        for code in ("gray", "binary")
    }
    assert codes["binary"] == [1, 2, 3, 4, 5, 0] * 2 and codes["gray"] != codes["binary"]


def test_a_run_says_what_the_logic_adds_and_what_code_and_phases_win(tmp_path, viform) -> None:
    folder = tmp_path / "run"
    done = viform(
        "run", "adaptive-exposure", "--set", "duration=60 ms", "--set", "imager.rows=32",
        "--set", "imager.columns=32", "--set", "imager.coupling.charge=100 e",
        "--set", "imager.coupling.code=binary", "--out", str(folder), "--json",
    )  # fmt: skip
    metrics = json.loads(done.out)["metrics"]
    mean, noise, rows = (metrics[f"coupling_{n}"]["value"] for n in ("mean", "noise", "rows"))
    assert 0 < rows <= noise and metrics["coupling_noise"]["unit"] == "e"
    page = (folder / "report.html").read_text()
    for code in ("binary code, idle phase (this run)", "gray code, no idle phase"):
        assert code in page
    assert f"<td>{mean:.3g} e</td><td>{noise:.3g} e</td><td>{rows:.3g} e</td>" in page
