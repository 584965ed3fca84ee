"""The cooling loop: heat flow against closed form, the loop against its linear model, extremes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from cosim.clock import PS
from imagers.emccd.device.cold_plant import Plant, Temperatures, Thermistor
from imagers.emccd.device.cooling import Cooler, CoolingFault, PidSettings, run_cooling

ZERO = 273.15
TARGET = ZERO - 10


def air(celsius: float):  # type: ignore[no-untyped-def]
    return lambda _: ZERO + celsius


@pytest.mark.parametrize("amps", [0.0, 0.7, 1.6])
def test_heat_flow_is_the_matrix_exponential(amps: float) -> None:
    """Constant current: T(t) = T_end + exp(A t) (T_0 - T_end), and T_end is `steady`."""
    plant, ambient = Plant(), ZERO + 25
    a, _ = plant.linear(amps, ambient)
    end = np.array(plant.steady(amps, ambient))
    state = Temperatures(300.0, 290.0)
    for _ in range(200):
        state = plant.advance(state, amps, ambient, 0.5)
    closed = end + expm(a * 100) @ (np.array([300.0, 290.0]) - end)
    assert np.array(state) == pytest.approx(closed, abs=1e-6)


def test_heat_is_balanced_where_it_is_steady() -> None:
    """What the sink gives to the air is what chip, air and current bring in."""
    plant, ambient, amps = Plant(), ZERO + 25, 1.1
    chip, sink = plant.steady(amps, ambient)
    electric = amps * (plant.seebeck * (sink - chip) + amps * plant.resistance)
    load = plant.chip_power + (ambient - chip) / plant.chip_to_air
    assert (sink - ambient) / plant.sink_to_air == pytest.approx(electric + load)
    idle = Plant(chip_power=0.0)
    assert idle.steady(0.0, ambient) == pytest.approx((ambient, ambient))


def test_strongest_current() -> None:
    """Less and more than it both leave the chip warmer; the drive's top stays below it."""
    plant = Plant()
    for celsius in (0, 25, 40):
        best = plant.strongest(ZERO + celsius, 4.0)
        chip = [plant.steady(best + d, ZERO + celsius).chip for d in (-0.2, 0.0, 0.2)]
        assert chip[1] < min(chip[0], chip[2])
        assert Cooler().settings.amps < best


def test_thermistor() -> None:
    t = Thermistor()
    assert t.ohms(298.15) == 10_000
    assert t.ohms(TARGET) == pytest.approx(10_000 * math.exp(3950 * (1 / TARGET - 1 / 298.15)))
    for celsius in (-40, -10, 25, 60):
        kelvin = ZERO + celsius
        step = abs(1 / t.slope(kelvin))
        assert abs(t.kelvin(t.code(kelvin)) - kelvin) <= 0.51 * step
        ends = (t.code(kelvin - 0.5), t.code(kelvin + 0.5))
        assert ends[1] - ends[0] == pytest.approx(t.slope(kelvin), abs=1.1)


def test_reaches_ten_below_zero() -> None:
    """From 25 degC: within .05 K in five minutes, never .1 K too cold, and it stays."""
    cooler = Cooler()
    run = run_cooling(cooler, 900)
    settled = run.settled(TARGET, 0.05)
    assert settled is not None and settled < 300
    assert run.chip.min() > TARGET - 0.1
    assert abs(run.chip[-200:] - TARGET).max() < 0.01
    assert run.amps.max() <= cooler.settings.amps
    # Where it ends is where the plant must be held.
    run = run_cooling(cooler, 3000)
    assert run.amps[-200:].mean() == pytest.approx(
        Plant().holding(TARGET, ZERO + 25, 1.6), rel=2e-3
    )


def test_step_of_air_follows_the_linear_loop() -> None:
    """Air 1 K warmer: the chip's course is the linear model's (plant linearised where it rests,
    sampled exactly; real-valued PID), to two codes of the thermistor and a tenth of the peak.
    A finer converter, its gains scaled, keeps codes small beside the course."""
    plant, t = Plant(), Thermistor(bits=18)
    before, after = ZERO + 10, ZERO + 11
    s = PidSettings(proportional=1688, integral=21, derivative=6750)
    cooler = Cooler(
        ambient=lambda s: after if s >= 2000 else before, noise=0.0, thermistor=t, settings=s
    )
    run_cooling(cooler, 2000)
    run = run_cooling(cooler, 400)
    # Linear model about the new holding current, started from the old one's temperatures.
    hold = plant.holding(TARGET, after, s.amps)
    old = plant.holding(TARGET, before, s.amps)
    rest = np.array(plant.steady(hold, after))
    h = s.sample / PS
    a, b = plant.linear(hold, after)
    up = plant.linear(hold + 1e-4, after)
    force = (up[0] - a) @ rest / 1e-4 + (up[1] - b) / 1e-4
    whole = expm(np.block([[a, force[:, None]], [np.zeros((1, 3))]]) * h)
    ad, bd = whole[:2, :2], whole[:2, 2]
    codes = t.slope(TARGET)
    drive = s.amps / s.top / 4096
    x = np.array(plant.steady(old, before)) - rest
    total, last, course = (old - hold), 0.0, []
    for _ in range(run.chip.size):
        error = -codes * x[0]
        total += s.integral * error * drive
        u = s.proportional * error * drive + total + s.derivative * (error - last) * drive
        last = error
        x = ad @ x + bd * u
        course.append(x[0])
    linear = np.array(course)
    peak = abs(linear).max()
    assert peak > 20 / abs(codes)
    assert abs(run.chip - TARGET - linear).max() < 2 / abs(codes) + 0.1 * peak
    # And its poles are inside the unit circle.
    k = -codes * drive
    closed = np.zeros((4, 4))
    closed[:2, :2] = ad
    closed[:2, 0] += bd * k * (s.proportional + s.integral + s.derivative)
    closed[:2, 2] = bd
    closed[:2, 3] = -bd * s.derivative * drive
    closed[2] = [s.integral * k, 0, 1, 0]
    closed[3] = [-codes, 0, 0, 0]
    assert abs(np.linalg.eigvals(closed)).max() < 1


@pytest.mark.parametrize("celsius", [0.0, 15.0, 35.0])
def test_other_airs(celsius: float) -> None:
    run = run_cooling(Cooler(ambient=air(celsius)), 1500)
    assert run.settled(TARGET, 0.1) is not None
    assert abs(run.chip[-100:] - TARGET).max() < 0.02


def test_too_hot_saturates_and_comes_back_without_windup() -> None:
    """Air of 70 degC for half an hour: the drive stands at its top; back at 25 degC the chip is at
    -10 degC again in the time that heat needs. Without anti-windup it ends far too cold."""
    with pytest.raises(ValueError, match="ambient must let"):
        Plant().holding(TARGET, ZERO + 70, 1.6)

    def day(s: float) -> float:
        return ZERO + (70 if 600 <= s < 2400 else 25)

    ends = {}
    for guarded in (True, False):
        cooler = Cooler(ambient=day, anti_windup=guarded)
        run_cooling(cooler, 2400)
        assert cooler.amps == cooler.settings.amps
        assert cooler.kelvin > ZERO
        ends[guarded] = run_cooling(cooler, 1200)
    assert ends[True].settled(TARGET, 0.1) is not None
    assert ends[True].settled(TARGET, 0.1) < 2400 + 600  # type: ignore[operator]
    assert ends[True].chip.min() > TARGET - 0.5
    assert ends[False].chip.min() < TARGET - 3
    assert ends[False].settled(TARGET, 0.1) is None


def test_too_cold_air_turns_the_drive_off() -> None:
    """The element only cools: at -30 degC the drive is 0, and nothing has wound up."""
    cooler = Cooler(ambient=lambda s: ZERO + (-30 if s < 1800 else 25))
    run = run_cooling(cooler, 1800)
    assert run.amps[-1] == 0
    assert run.chip[-1] == pytest.approx(Plant().steady(0.0, ZERO - 30).chip, abs=0.2)
    run = run_cooling(cooler, 900)
    assert run.chip.max() < TARGET + 1


@pytest.mark.parametrize("fault", [CoolingFault.OPEN, CoolingFault.SHORT])
def test_broken_thermistor_turns_the_drive_off_by_name(fault: CoolingFault) -> None:
    """An open one reads as very cold, a shorted one as very hot: either way the drive stops within
    a sample and stays off until reset, though the fault lasted a second."""
    cooler = Cooler(broken=lambda s: fault if 400 <= s < 401 else CoolingFault.NONE)
    run = run_cooling(cooler, 420)
    at = int(np.searchsorted(run.seconds, 400.0, side="right"))
    assert run.faults[at - 1] is CoolingFault.NONE and run.amps[at - 1] > 0.5
    assert all(f is fault for f in run.faults[at:])
    assert (run.amps[at:] == 0).all()
    assert cooler.fault.value == f"thermistor {fault.name.lower()}"
    cooler.pid.reset()
    run = run_cooling(cooler, 400)
    assert cooler.fault is CoolingFault.NONE
    assert run.settled(TARGET, 0.1) is not None


def test_registers_are_integers_and_time_is_its_own() -> None:
    """The controller has no float, and cutting time makes no difference."""
    one, two = Cooler(), Cooler()
    one.advance(100 * PS)
    for n in range(101):
        two.advance(n * PS + PS // 3)
    assert one.samples == 200
    two.advance(100 * PS)
    assert one.state == two.state
    assert all(type(v) is int for v in (one.pid.drive, one.pid.total, one.pid.before))


def test_what_cannot_be() -> None:
    with pytest.raises(ValueError, match="target must be"):
        Cooler(target=100.0)
    with pytest.raises(ValueError, match="must be positive"):
        Plant(sink_to_air=0.0)
    with pytest.raises(ValueError, match="ambient must let"):
        Plant().holding(TARGET, ZERO + 70, 1.6)
    with pytest.raises(ValueError, match="sink runs away"):
        Plant(sink_to_air=50.0).steady(6.0, ZERO + 25)
