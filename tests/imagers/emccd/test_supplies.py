"""The supplies: instants against closed forms, interlocks against the voltages alone, failures."""

import random

import pytest

from imagers.emccd.device.imager import Emccd
from imagers.emccd.device.supplies import (
    ORDER,
    RAILS,
    Supplies,
    breaches,
    broken_interlock,
)
from tests.imagers.emccd.test_sine_drive import film


@pytest.mark.parametrize(("ramp", "delay"), [(None, None), (2e-3, 0.0), (None, 3e-4), (4e-4, 1e-3)])
def test_up_and_down_take_delays_and_ramps(ramp, delay):
    """Up: each delay and 0.95 of each ramp. Down: the same, without the first rail's delay."""
    supplies = Supplies(ramp=ramp, delay=delay)
    rails = [
        (RAILS[n].ramp if ramp is None else ramp, RAILS[n].delay if delay is None else delay)
        for n in ORDER
    ]
    wanted = sum(0.95 * r + d for r, d in rails)
    course = supplies.run(off=0.06)
    assert course.good == pytest.approx(wanted, abs=2e-5 * len(rails))
    assert course.dark == pytest.approx(0.06 + wanted - rails[0][1], abs=2e-5 * len(rails))
    assert supplies.switch_time == pytest.approx(wanted)
    assert course.fault is None and not breaches(course)
    ups = [next(n for n, v in enumerate(course.volts[name]) if v > 0) for name in ORDER]
    assert ups == sorted(ups)


def test_an_order_breaks_an_interlock_exactly_where_the_voltages_do():
    rng, seen = random.Random(5), set()
    orders = [rng.sample(ORDER, len(ORDER)) for _ in range(40)]
    for _ in range(200):  # and safe ones, which are rare
        if broken_interlock(order := rng.sample(ORDER, len(ORDER))) is None:
            orders.append(order)
    swapped = list(ORDER)
    swapped[4], swapped[5] = swapped[5], swapped[4]
    for order in (*orders, swapped):
        course = Supplies(tuple(order), ramp=1e-4, delay=1e-4).run(off=4e-3)
        safe = broken_interlock(order) is None
        seen.add(safe)
        assert safe == (not breaches(course)) and course.good is not None
    assert seen == {True, False}


@pytest.mark.parametrize("failed", [ORDER[0], "substrate", ORDER[-1]])
def test_a_rail_that_fails_takes_all_down_in_reverse(failed):
    course = Supplies(failed=failed).run()
    assert course.good is None and course.fault == failed and not breaches(course)
    assert course.dark is not None
    for later in ORDER[ORDER.index(failed) :]:
        assert max(course.volts[later]) == 0
    down = [max(n for n, v in enumerate(course.volts[name]) if v > 0)
            for name in ORDER[: ORDER.index(failed)]]  # fmt: skip
    assert down == sorted(down, reverse=True)


def test_a_camera_films_while_its_supplies_are_good():
    """The first transfer begins at the edge after; what is not read at the switch-off is lost."""
    camera = Emccd(powered=(5 * 10**9 + 1, 12 * 10**9))
    camera.write("rows", 4)
    camera.write("gain", 218, at=10**9)
    frames = film(camera, 40 * 10**9)
    assert frames[0].begin[0] == 5 * 10**9 + 100_000 + 528_000_000
    assert frames[0].state["gain"] == camera.drive.voltage.gain(218)
    assert frames[-1].ready <= 12 * 10**9 and len(frames) == 1
    assert film(Emccd(powered=(0, 0)), 40 * 10**9) == []
