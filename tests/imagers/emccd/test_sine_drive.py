"""The high-voltage drive: its loop against matrix powers and formulas, its phase against integrals;
the potentiometer's word bit by bit; what a camera makes of both."""

import math

import numpy as np
import pytest

from cosim import InputError
from imagers.common.scenery import Still
from imagers.emccd.device.imager import Emccd
from imagers.emccd.device.sine_drive import (
    DriveSettings,
    Potentiometer,
    RunningDrive,
    SineDrive,
    word_clocks,
    word_edges,
)
from imagers.emccd.electronics import ageing_codes
from imagers.emccd.pixels import HighVoltage
from tests.imagers.vcd import read_vcd

T = 1e-7
LAST = 255


def drive(celsius=25.0, **changed):
    return SineDrive(settings=DriveSettings(**changed), celsius=celsius)


@pytest.mark.parametrize("celsius", [25.0, 60.0])
def test_a_small_step_is_the_matrix_power(celsius):
    """While every crest charges the detector the loop is linear: x_n = x + M^n (x_0 - x)."""
    d = drive(celsius)
    s, strength = d.settings, 1 - 2e-3 * (celsius - 25)
    gain = 201 * 45 / d.voltage.volts(LAST - 1) - 1
    slow = 1 - math.exp(-T / (s.response * 201))
    tank = 1 - math.exp(-T / (s.quality / (math.pi * 1e7)))
    decay = math.exp(-T / s.droop)
    rest = s.attack / (1 - (1 - s.attack) * decay)
    first = np.array([[1 - slow, 0, -slow * gain / rest], [0, 1, 0], [0, 0, 1]])
    second = np.array([[1, 0, 0], [tank * strength, 1 - tank, 0], [0, 0, 1]])
    third = np.array([[1, 0, 0], [0, 1, 0], [0, s.attack, (1 - s.attack) * decay]])
    step = third @ second @ first
    start, end = np.array(d.resting(LAST)), np.array(d.resting(LAST - 1))
    course = d.course(LAST, LAST - 1, 500)
    for n in (1, 2, 17, 500):
        wanted = end + np.linalg.matrix_power(step, n) @ (start - end)
        assert course[n - 1] == pytest.approx(wanted, abs=1e-10)
    assert sorted(abs(d.poles(LAST - 1))) == pytest.approx(sorted(abs(np.linalg.eigvals(step))))


@pytest.mark.parametrize("loop_gain", [20.0, 200.0])
def test_it_settles_as_a_first_order_and_ends_at_the_formula(loop_gain):
    """t = t_c ln(dV / within), and a weaker transformer moves the peak by x / (1 + L (1 + x))."""
    d = drive(loop_gain=loop_gain)
    within = 0.01 / d.voltage.slope(45.0)
    assert d.settled(0, LAST, 0.01) == pytest.approx(20e-6 * math.log(8 / within), rel=0.06)
    assert d.settled(0, LAST, 0.01) == pytest.approx(d.settling(37.0, LAST, within), rel=0.01)
    for celsius in (-25.0, 75.0):
        x = -2e-3 * (celsius - 25)
        warm = drive(celsius, loop_gain=loop_gain)
        peak = warm.course(0, LAST, 10_000)[-1, 1]
        assert peak / 45 - 1 == pytest.approx(x / (1 + loop_gain * (1 + x)), rel=1e-6)
        assert warm.steady(LAST) == pytest.approx(peak, abs=1e-9)
    assert drive().steady(LAST) == 45.0


def test_an_amplifier_at_its_top_is_where_the_peak_ends():
    d = drive(75.0, drift=-0.01)  # half the strength, 45 V would take 90 V
    assert d.steady(LAST) == pytest.approx(0.5 * 1.5 * 45)
    assert d.course(0, LAST, 20_000)[-1, 1] == pytest.approx(d.steady(LAST), rel=1e-3)


@pytest.mark.parametrize("hertz", [1e3, 1e4, 1e5])
def test_ripple_is_the_transfer_function(hertz):
    d = drive(ripple=1e-5, ripple_frequency=hertz)
    periods = int(2e-3 / T) + round(1e7 / hertz)
    tail = d.course(LAST, LAST, periods, ripple=True)[-round(1e7 / hertz) :, 1]
    turns = np.exp(-2j * np.pi * np.arange(tail.size) / tail.size)
    assert 2 * abs((tail * turns).mean()) == pytest.approx(d.ripple(LAST), rel=1e-3)
    if hertz == 1e3:  # the loop takes most of a slow one: 1/|1 + 1/(j w t)|
        turn = 2 * math.pi * hertz * 20e-6
        wanted = 1e-5 * 45 * turn / math.hypot(1, turn)
        assert d.ripple(LAST) == pytest.approx(wanted, rel=0.02)


def test_a_detector_that_droops_slowly_holds_an_old_peak():
    """While no crest reaches it, it falls as exp(-t/t_d), whatever the peak does."""
    d = drive(droop=5e-3)
    y, peak, held = d.course(LAST, 0, 2000).T
    blind = slice(100, 2000)
    assert (peak[blind] < held[blind]).all() and y[1500] == 0 and peak[1500] < 1
    fall = held[100] * np.exp(-np.arange(1900) * T / 5e-3)
    assert held[blind] == pytest.approx(fall, rel=1e-9)
    assert drive().course(LAST, 0, 20_000)[:, 1].min() > 36.9


def test_the_transfer_sees_the_mean_of_the_sine():
    d = drive(phase=12.0, trough=3.0, transfer=30e-9)
    time = (np.arange(100_000) + 0.5) / 100_000 * 30e-9 - 15e-9
    sine = 3 + 42 * (1 + np.cos(2 * np.pi * 1e7 * time - math.radians(12))) / 2
    assert d.transfer_mean(45.0) == pytest.approx(sine.mean(), rel=1e-8)
    assert drive().gain(LAST) == HighVoltage().gain(LAST)
    small = drive(phase=0.5, transfer=0.0)  # ln g falls by slope A/4 phase^2
    lost = math.log(small.gain(LAST) / HighVoltage().gain(LAST))
    wanted = -HighVoltage().slope(45.0) * 45 / 4 * math.radians(0.5) ** 2
    assert lost == pytest.approx(wanted, rel=1e-3)
    slopes = [math.log(HighVoltage().gain_at(43 + h)) for h in (-1e-5, 1e-5)]
    assert HighVoltage().slope(43.0) == pytest.approx((slopes[1] - slopes[0]) / 2e-5, rel=1e-6)


def test_a_running_drive_is_the_course_and_rests_exactly():
    d = drive()
    running = RunningDrive(d, 0)
    running.set(1000, LAST)
    course = d.course(0, LAST, 3000)[:, 1]
    assert running.mean_peak(1500, 2500) == pytest.approx(course[500:1500].mean(), abs=1e-9)
    assert running.mean_peak(30_000, 10_000_000) == 45.0
    cold = RunningDrive(d, LAST, 50, cold=True)
    assert cold.mean_peak(50, 60) < 1 and cold.mean_peak(100_000, 100_001) == 45.0


@pytest.mark.parametrize(
    ("changed", "says"),
    [({"response": 1e-6, "quality": 200.0, "attack": 0.01}, "settles"), ({"drift": 0.1}, "tenth")],
)
def test_a_loop_that_cannot_work_is_refused(changed, says):
    with pytest.raises(InputError, match=says):
        drive(10.0, **changed)


@pytest.mark.parametrize("code", [0, 1, 0x80, 0xA5, 255])
def test_the_word_on_the_wires_bit_by_bit(code):
    """Sampled here at every rise of the clock: 0x11, then the code, the highest bit first, with
    data that stands half a period before and after."""
    edges = list(word_edges(100, code))
    assert [edge for edge, _, _ in edges] == sorted(edge for edge, _, _ in edges)
    assert edges[0] == (100, "spi_select", 0)
    assert edges[-1] == (100 + word_clocks(), "spi_select", 1)
    data = [(edge, value) for edge, name, value in edges if name == "spi_data"]
    rises = [edge for edge, name, value in edges if name == "spi_clock" and value]
    bits = [[v for e, v in data if e <= rise][-1] for rise in rises]
    assert bits == [int(b) for b in f"{0x11:08b}{code:08b}"]
    assert np.diff(rises).tolist() == [10] * 15
    assert min(abs(e - rise) for e, _ in data for rise in rises) == 5


def test_words_of_another_length_or_command_move_nothing():
    whole = list(word_edges(0, 77))
    clocks = [n for n, (_, name, _) in enumerate(whole) if name == "spi_clock"]
    short = [each for n, each in enumerate(whole) if n not in clocks[-2:]]
    other = [(e, n, 0 if n == "spi_data" and e < 80 else v) for e, n, v in whole]
    chip = Potentiometer()
    assert chip.wiper == 0x80
    for wrong in (short, other):
        for _, signal, value in wrong:
            chip.change(signal, value)
    assert (chip.wiper, chip.words, chip.refused) == (0x80, 0, 2)
    for _, signal, value in whole:
        chip.change(signal, value)
    assert (chip.wiper, chip.words) == (77, 1)


def test_ageing_in_codes():
    """The curve moves by its volts, and the calibration finds the code of the moved voltage: the
    potentiometer's x = s/(1 + rho - rho s) of the share s of the range."""
    new, aged = HighVoltage(), HighVoltage(ageing=0.2)
    assert aged.gain_at(44.2) == pytest.approx(new.gain_at(44.0), rel=1e-12)
    step = aged.step_for(200.0)
    share = (new.volts(new.step_for(200.0)) + 0.2 - 37) / 8
    assert step == round(255 * share / (4 - 3 * share))
    assert aged.gain(step) == pytest.approx(200.0, rel=0.03)
    assert ageing_codes(aged, step) == step - new.step_for(200.0) == 22
    assert ageing_codes(new, 100) == 0


def film(camera, until):
    scene = Still(np.zeros((528, 536)))
    return list(camera.film(scene, until, seed=1, kept=frozenset()))


def test_a_camera_sends_a_word_where_the_step_changes_and_waits_for_the_loop(tmp_path):
    """With a loop of 1 ms a frame has the mean of a transient; with that of 20 us it has none."""
    gains = {}
    for response in (20e-6, 1e-3):
        camera = Emccd(drive=drive(response=response))
        camera.write("rows", 4)
        camera.write("exposure", 1)
        camera.write("gain", 218, at=10**9)
        frames = film(camera, 30 * 10**9)
        gains[response] = [frame.state["gain"] for frame in frames]
        assert camera.potentiometer.words == 2 and camera.potentiometer.wiper == 218
        changed = next(n for n, f in enumerate(frames) if f.state["gain_step"])
        begin = int(frames[changed].begin[0]) // 100_000 - 5280
        slow = drive(response=response).course(0, 218, 40_000)[:, 1]
        read = slice(5280 + 100 + 5280 + 10 + 80 - word_clocks(), None)
        wanted = slow[read][: 4 * 562].mean()
        assert frames[changed].state["peak"] == pytest.approx(wanted, abs=1e-6)
        assert begin >= 10_000
    quick, late = gains.values()
    assert set(quick) == {HighVoltage().gain(0), HighVoltage().gain(218)}
    assert HighVoltage().gain(0) < late[1] < 150 < late[-1] == HighVoltage().gain(218)

    camera = Emccd()
    camera.write("rows", 1)
    camera.write("gain", 90)
    path = tmp_path / "a.vcd"
    list(camera.film(Still(np.zeros((528, 536))), 4 * 10**9, seed=1, kept=frozenset(), trace=path))
    found = read_vcd(path.read_text())
    chip = Potentiometer()
    names = ("spi_data", "spi_clock", "spi_select")
    changes = [(ps, n, name, v) for n, name in enumerate(names) for ps, v in found[name][1]]
    for _, _, name, value in sorted(changes, key=lambda change: change[:2]):
        chip.change(name, value)
    assert (chip.wiper, chip.words) == (90, 1)


def test_a_phase_error_reaches_the_frame():
    camera = Emccd(drive=drive(phase=5.0))
    camera.write("rows", 1)
    camera.write("gain", LAST)
    (frame, *_) = film(camera, 4 * 10**9)
    assert frame.state["gain"] == drive(phase=5.0).gain(LAST) < 0.7 * HighVoltage().gain(LAST)
