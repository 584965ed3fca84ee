"""Wrong bits: the first one, and the location that all share."""

import numpy as np
import pytest

from rtl_model.bringup.bench.wrong_bits import compare
from rtl_model.bringup.stages.prbs import which_bits
from rtl_model.bringup.stages.threshold import count_spikes
from rtl_model.cycle import Settings, planes
from rtl_model.geometry import Geometry

SHAPE = (6, 8, 70)
TRUE = np.random.Generator(np.random.Philox(5)).random(SHAPE) < 0.5


def spoilt(place, value=None):
    captured = TRUE.copy()
    captured[place] = ~captured[place] if value is None else value
    return compare(captured, TRUE, 32)


def test_equal_planes_have_no_wrong_bit():
    assert compare(TRUE.copy(), TRUE, 32) is None


@pytest.mark.parametrize(
    ("place", "value", "shape", "where", "stuck"),
    [
        ((slice(None), 3, 7), True, "pixel", "3, 7", 1),
        ((slice(None), 3, 7), None, "pixel", "3, 7", None),
        ((slice(None), slice(None), 41), False, "column", "41", 0),
        ((slice(None), 2), True, "row", "2", 1),
        ((slice(None), slice(None), slice(5, None, 32)), None, "lane", "5", None),
        ((4,), None, "frame", "4", None),
        (([0, 3], [1, 2], [9, 60]), None, "scattered", "", None),
    ],
)
def test_the_shape_is_found(place, value, shape, where, stuck):
    wrong = spoilt(place, value)
    assert (wrong.shape, wrong.place, wrong.stuck) == (shape, where, stuck)
    assert wrong.remedy


def test_the_first_wrong_bit_is_named():
    wrong = spoilt((slice(2, None), 3, 7))
    assert (wrong.frame, wrong.row, wrong.column, wrong.bits) == (2, 3, 7, 4)
    assert "the first in frame 2, row 3, column 7" in wrong.text


@pytest.mark.parametrize("rule", [0, 1, 2])
@pytest.mark.parametrize("select", [0, 1])
def test_the_closed_form_is_the_models(rule, select):
    size = Geometry(1, 32)
    for level in (0, 3, 15):
        for electrons in (0, 1, 97, 200, 255):
            captured = planes(
                size, Settings(level, select, rule, None, None, 1, electrons), None, 90
            )
            assert captured[:, 0, 0].sum() == count_spikes(90, electrons << select, level, rule)


def test_which_bits_of_a_word():
    assert which_bits([1 << 9, 1 << 9]) == "all in bit 9 of the word, byte 2 on the line"
    assert which_bits([1 << 9, 1 << 15]) == "all in byte 2 of the word as it is sent"
    assert which_bits([1, 1 << 31]) == "in 2 bits of the word"
