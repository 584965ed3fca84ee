"""EMCCD pixels against closed forms: signal, noise, dark current, smear, wells, gain steps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from imagers.emccd.pixels import (
    SUMMARY_PEAK,
    EmccdExposed,
    EmccdPixels,
    HighVoltage,
    chip,
    columns_filled,
    electrons_to_fill,
    spill_lines,
)
from imagers.emccd.pixels.chip import dark_current
from imagers.emccd.pixels.wells import spill_columns
from sensor.frame_pixels import Exposed

SIGMAS = float(stats.norm.isf(0.5e-6))
EVEN = {"prnu": 0.0, "dsnu": 0.0}
LIT = slice(chip.DARK_COLUMNS, -chip.DARK_COLUMNS)


def rows_of(
    lux_seconds: float | np.ndarray, rows: int = 16, first: int = 100, frame: int = 0,
    seconds: float = 2e-3, waiting: float = 0.0,
) -> Exposed:  # fmt: skip
    light = np.broadcast_to(np.asarray(lux_seconds, float), (rows, chip.COLUMNS)).copy()
    return Exposed(light, np.full(rows, seconds), np.full(rows, waiting), first, frame)


def values(pixels: EmccdPixels, rows: Exposed, *kept: str) -> np.ndarray:
    names = frozenset(kept) if kept else frozenset(pixels.effects)
    return pixels.convert(rows, 1, names).astype(float)


@pytest.mark.parametrize(
    ("gain", "electrons", "tier"),
    [(1.0, 0.0, "fast"), (1.0, 3e4, "fast"), (30.0, 400.0, "fast"), (1000.0, 5.0, "fast"),
     (15.0, 20.0, "exact")],
)  # fmt: skip
def test_mean_and_variance(gain: float, electrons: float, tier: str) -> None:
    """With every effect; without pattern, so that pixels stand for frames."""
    pixels = EmccdPixels(gain=gain, tier=tier, **EVEN)  # type: ignore[arg-type]
    lux_seconds = electrons / pixels.responsivity
    rows, frames = (8, 10) if tier == "fast" else (4, 1)
    found = np.concatenate(
        [values(pixels, rows_of(lux_seconds, rows, frame=f))[:, LIT] for f in range(frames)]
    ).ravel()
    mean, variance = pixels.mean_variance(lux_seconds, 2e-3)
    n = found.size
    assert abs(found.mean() - mean) < SIGMAS * math.sqrt(variance / n) + 1e-3
    fourth = ((found - mean) ** 4).mean()
    wide = SIGMAS * math.sqrt((fourth - variance**2) / n)
    # Rounding to whole DN adds 1/12 DN^2 to all but the narrowest spread, which is 2.4 DN here.
    assert abs(found.var() - variance) < wide + 1e-3


def test_responsivity_and_step() -> None:
    """4.09e15 photons / (s m2 lx) x (16 um)^2 x .93, and the register's well at full scale."""
    pixels = EmccdPixels()
    assert pixels.responsivity == pytest.approx(4.09e15 * 256e-12 * 0.93, rel=2e-3)
    full = rows_of(200e3 / pixels.responsivity)
    assert values(replace(pixels, gain=10.0), full, "none")[:, LIT].min() == 65535
    assert EmccdPixels(gain=31.0).effective_read_noise < 1


def test_dark_reference_sees_no_light() -> None:
    pixels = EmccdPixels()
    whole = values(pixels, rows_of(1e-2, 528, 0), "none")
    assert (whole[8:-8, LIT] > 9000 / pixels.step).all()
    whole[8:-8, LIT] = 500
    assert (whole == 500).all()


def test_dark_current_of_the_data_sheet() -> None:
    zero = chip.ZERO_CELSIUS
    for celsius, printed, half in ((0, 33.5, 0.05), (-10, 8.5, 0.05), (-20, 1.93, 0.005)):
        assert dark_current(zero + celsius) == pytest.approx(printed, abs=half)
    assert dark_current(zero + 20) == pytest.approx(400.0)
    # 1.14e6 is the sheet's rounded factor: within 2 % of one at 20 degC.
    assert 1.14e6 * 293.15**3 * math.exp(-9080 / 293.15) == pytest.approx(1, abs=0.02)


def test_dark_signal_gathers_in_exposure_and_storage() -> None:
    pixels = EmccdPixels(gain=1000.0, kelvin=273.15, **EVEN)
    dark = dark_current(273.15)
    still = values(pixels, rows_of(0, seconds=0.02, waiting=0.03), "dark current")
    assert still == pytest.approx(500 + np.rint(dark * 0.05 * 1000 / pixels.step))
    drawn = values(pixels, rows_of(0, 64, 0, 0, 0.5, 0.5), "dark current", "dark shot noise")
    electrons = (drawn - 500) * pixels.step / 1000
    wide = SIGMAS * math.sqrt(dark / drawn.size)
    assert abs(electrons.mean() - dark) < wide
    assert abs(electrons.var() / dark - 1) < SIGMAS * math.sqrt((2 + 1 / dark) / drawn.size)


def test_fixed_pattern_has_its_spread_and_stays() -> None:
    pixels = EmccdPixels(gain=100.0, pattern_seed=7)
    light = values(pixels, rows_of(4000 / pixels.responsivity), "PRNU")[:, LIT] - 500
    n = light.size
    assert light.std() / light.mean() == pytest.approx(0.01, rel=SIGMAS / math.sqrt(2 * n))
    dark = values(pixels, rows_of(0, seconds=100.0), "dark current", "DSNU") - 500
    assert dark.std() / dark.mean() == pytest.approx(0.15, rel=SIGMAS / math.sqrt(2 * dark.size))
    again = values(pixels, rows_of(4000 / pixels.responsivity, frame=9), "PRNU")
    assert (again[:, LIT] - 500 == light).all()
    other = replace(pixels, pattern_seed=8)
    assert (values(other, rows_of(4000 / pixels.responsivity), "PRNU")[:, LIT] - 500 != light).any()


def test_smear_is_every_other_row_for_one_shift() -> None:
    """One bright row: each other row of its column, dark reference rows too, gets its light for
    one row shift, however long the exposure."""
    pixels = EmccdPixels(gain=100.0)
    light = np.zeros((528, chip.COLUMNS))
    light[300, 200] = 1e5 / pixels.responsivity
    for seconds in (1e-5, 1e-2):
        rows = EmccdExposed(
            light, np.full(528, seconds), np.zeros(528), 0, 0, row_shift=3e-9
        )  # fmt: skip
        got = values(pixels, rows, "smear")
        streak = 500 + 1e5 * 3e-9 / seconds * 100 / pixels.step
        assert (np.delete(got[:, 200], 300) == np.rint(streak)).all()
        assert (np.delete(got, 200, axis=1) == 500).all()


def test_shortest_exposure_is_mostly_smear() -> None:
    """At 10 us and 1 us a row an even picture's smear is 51 times its light."""
    pixels = EmccdPixels(**EVEN)
    light = 200 / pixels.responsivity
    with_it = values(pixels, rows_of(light, 528, 0, seconds=1e-5), "smear")[100, LIT].mean() - 500
    assert with_it * pixels.step == pytest.approx(200 * (1 + 511 * 1e-6 / 1e-5), rel=2e-3)


def test_image_well_spills_up_and_down() -> None:
    """A pixel of eleven wells fills five places above and five below; off the edge it is lost."""
    charge = np.full((40, 3), 10.0)
    charge[20, 1] = 1100.0
    before = charge.sum()
    spill_columns(charge, 100.0)
    assert charge.sum() == before
    assert charge.max() == 100.0
    full = np.flatnonzero(charge[:, 1] == 100)
    # Each side takes 500 in places that hold 90 more: 5 full and one of 50 over its 10.
    assert list(full) == list(range(15, 26))
    assert charge[14, 1] == charge[26, 1] == 60.0
    assert (charge[:, [0, 2]] == 10).all()
    edge = np.zeros((6, 1))
    edge[0] = 500.0
    spill_columns(edge, 100.0)
    assert list(edge[:, 0]) == [100, 100, 100, 0, 0, 0]


def test_register_spills_along_the_line() -> None:
    charge = np.zeros((3, 10))
    charge[0, 7] = 650.0
    left = spill_lines(charge, 100.0, gap=2)
    # Three places of its own line, two cells of the gap, then the next line's head.
    assert list(charge[0]) == [0] * 7 + [100] * 3
    assert list(charge[1]) == [100, 50] + [0] * 8
    assert left == 0
    assert charge.sum() == 650 - 200


def test_gain_200_fills_forty_two_columns() -> None:
    """The document's figure 4c: at gain 200 the line's first 42 columns turn white, 12 of the dark
    reference and 30 of the image. A picture whose right half is lit does so at 5 094 e- a pixel,
    27 % over the 4 000 e- that fill the register's well; to 4 625 e- the dark reference absorbs it.
    """
    lit = chip.IMAGE_COLUMNS // 2
    wanted = electrons_to_fill(42, lit, 200.0)
    assert wanted == pytest.approx(4000 * (1 + 70 / 256))
    assert electrons_to_fill(12, lit, 200.0) == pytest.approx(4000 * (1 + 40 / 256))
    pixels = EmccdPixels(gain=200.0)
    picture = np.zeros((40, chip.COLUMNS))
    first = chip.COLUMNS - chip.DARK_COLUMNS - lit

    def filled(electrons: float, *kept: str) -> np.ndarray:
        picture[:, first:] = pixels.lux_seconds(electrons, 2e-3)
        got = values(pixels, rows_of(picture, 40), *kept)
        electrons_out = (got - pixels.offset) * pixels.step
        return np.array([columns_filled(line) for line in electrons_out[1:]])

    assert (filled(wanted + 0.1, "smear", "register overflow") == 42).all()
    # With everything: a line's excess has a spread of half a column.
    noisy = filled(wanted)
    assert abs(noisy - 42).max() <= 3
    assert abs(noisy.mean() - 42) < 1
    assert (filled(electrons_to_fill(12, lit, 200.0) - 40) <= 12).all()
    assert (filled(3900.0) == 0).all()
    # Left out, the well clips and nothing is spilled.
    everything = set(pixels.effects)
    assert (filled(wanted, *(everything - {"register overflow"})) == 0).all()


def test_window_begins_with_a_clear_register() -> None:
    """A window's rows are the whole array's where nothing overflows, and take no charge of rows
    that are dumped where something does."""
    pixels = EmccdPixels(gain=100.0)
    light = np.full((528, chip.COLUMNS), 100 / pixels.responsivity)
    rows = rows_of(light, 528, 0)
    whole = values(pixels, rows)
    part = EmccdExposed(light, rows.seconds, rows.waiting, 0, 0, read=(101, 128))
    assert (values(pixels, part) == whole[101:229]).all()
    light[:101] = 9000 / pixels.responsivity
    dumped = EmccdExposed(light, rows.seconds, rows.waiting, 0, 0, read=(101, 4))
    assert values(pixels, dumped, "register overflow")[0, 0] == 500
    taken = EmccdExposed(light, rows.seconds, rows.waiting, 0, 0, read=(100, 5))
    assert values(pixels, taken, "register overflow")[1, 0] > 60000


def test_frames_follow_their_own_gain_and_temperature() -> None:
    pixels = EmccdPixels()
    light = np.full((16, chip.COLUMNS), 50 / pixels.responsivity)
    rows = EmccdExposed(
        light, np.full(16, 0.01), np.zeros(16), 100, 0, gain=200.0, kelvin=293.15
    )  # fmt: skip
    whole = replace(pixels, gain=200.0, kelvin=293.15)
    assert (values(pixels, rows) == values(whole, rows_of(light, 16, seconds=0.01))).all()


def test_draws_do_not_change_with_what_is_left_out_nor_with_the_cut() -> None:
    pixels = EmccdPixels(gain=1.0, **EVEN)
    rows = rows_of(5000 / pixels.responsivity, 32, seconds=100.0)
    both = values(pixels, rows, "shot noise", "dark current")
    one = values(pixels, rows, "shot noise")
    assert (abs(both - one - dark_current(pixels.kelvin) * 100 / pixels.step) <= 1).all()
    upper = values(pixels, rows_of(5000 / pixels.responsivity, 16, seconds=100.0))
    assert (values(pixels, rows)[:16] == upper).all()


def test_gain_steps() -> None:
    """256 steps, 1 (within 1 %) to 1000, rising; the parallel resistor softens the steps."""
    voltage = HighVoltage()
    table = voltage.table()
    assert (voltage.volts(0), voltage.volts(255)) == (37.0, 45.0)
    assert table[0] == pytest.approx(1.0, rel=0.0101)
    assert table[255] == pytest.approx(1000.0, rel=1e-9)
    assert (np.diff(table) > 0).all()
    steps = np.log(table[1:] / table[:-1])
    bare = HighVoltage(parallel=0.0).table()
    assert steps.max() < 0.5 * np.log(bare[1:] / bare[:-1]).max()
    assert steps.max() < 0.05
    nearest = voltage.gain(voltage.step_for(200.0))
    assert abs(math.log(nearest / 200)) <= steps.max() / 2


def test_voltage_ranges_that_contradict() -> None:
    """The text's 45 V and the summary's 50 V give the same ends, other gains between."""
    text, summary = HighVoltage(), HighVoltage(peak=SUMMARY_PEAK)
    assert summary.volts(255) == 50.0
    assert summary.table() == pytest.approx(text.table(), rel=1e-9)
    assert summary.gain_at(45.0) < 10
    assert text.gain_at(41.0) == pytest.approx(summary.gain_at(43.5))
    assert 1.0 < text.gain_at(37.0) < 1.0101 and text.gain_at(45.0) == pytest.approx(1000.0)
    # A stage's probability is the exponential; ln g follows it in the middle of the range.
    ratio = math.log(text.gain_at(43.0)) / math.log(text.gain_at(42.0))
    assert ratio == pytest.approx(math.exp(1 / text.softness), rel=2e-3)


def test_gain_rises_on_cooling() -> None:
    voltage = HighVoltage()
    gains = [voltage.gain(200, chip.ZERO_CELSIUS + c) for c in (20, 0, -10, -30)]
    assert gains == sorted(gains)
    p = [g ** (1 / chip.STAGES) - 1 for g in gains]
    assert p[3] / p[2] == pytest.approx(math.exp(20 * voltage.cooling))


def test_what_cannot_be() -> None:
    with pytest.raises(ValueError, match="rows must lie within"):
        EmccdPixels().convert(rows_of(0, 16, 520), 1, frozenset())
    outside = EmccdExposed(np.zeros((4, 536)), np.ones(4), np.ones(4), 0, 0, read=(2, 3))
    with pytest.raises(ValueError, match="window must lie within"):
        EmccdPixels().convert(outside, 1, frozenset())
    with pytest.raises(ValueError, match="gain step must be 0 to 255"):
        HighVoltage().volts(256)
    with pytest.raises(ValueError, match="gain must be 1 or more"):
        EmccdPixels(gain=0.5)
    with pytest.raises(ValueError, match="must fit into a line"):
        electrons_to_fill(42, 500, 200.0)
