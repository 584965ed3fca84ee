"""Rare events in a tile: the number that the bounds take."""

import numpy as np
from scipy.special import pdtr

from cosim.plan.effects import Summary
from cosim.plan.tiles import TILE
from sensor.latched.effects.windows import rare_error


def test_a_number_of_rare_events_is_the_least_that_is_hardly_exceeded() -> None:
    """Also where the number is not read from the table, above a mean of 4096."""
    tiles = 2000
    events = np.geomspace(1e-11, 40, tiles)  # of one pixel
    light = np.ones(tiles)
    scene = Summary(light, light, threshold=1.0, window=1, cycles=100)
    error = rare_error(scene, events, shares=(1.0,))
    number, mean = np.rint((error * TILE) ** 2), events * TILE**2
    chance = 1e-4 / tiles
    assert (pdtr(number, mean) >= 1 - chance * (1 + 1e-6)).all()
    some = number > 0
    assert some.any() and not some.all()
    assert (pdtr(number - 1, mean)[some] < 1 - chance * (1 - 1e-6)).all()
