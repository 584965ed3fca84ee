"""The data of figures: what was drawn, no more and no less."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from cosim.report.drawn import LARGEST, Data, drawn
from cosim.report.figures import subplots


def test_one_curve_is_a_table_of_its_points():
    figure, ax = subplots(figsize=(3, 2))
    ax.plot([1, 2, 3], [4.0, np.nan, 6.0], label="light")
    ax.set_xlabel("time, s")
    ax.set_ylabel("light, lux")
    ax.axhline(5)  # a guide
    ax.fill_between([1, 2], [0, 1])
    data = drawn(figure)
    assert data.head == ("time, s", "light, lux")
    assert data.csv() == ('"time, s","light, lux"\r\n1,4\r\n2,\r\n3,6\r\n', 1)


def test_curves_bars_and_panels_have_names():
    figure, (left, right) = subplots(1, 2, figsize=(5, 2))
    left.errorbar([1, 2], [10, 20], [[1, 2], [3, 4]], fmt="o", label="measured", capsize=2)
    left.plot([1, 2], [11, 19], label="_theory")
    left.set_title("Left")
    right.barh([0, 1], [5.0, 7.0])
    right.set_yticks([0, 1], ["raw", "coded"])
    right.set_title("Right")
    data = drawn(figure)
    assert data.head == ("panel", "curve", "x", "y", "low", "high")
    assert data.rows == [
        ("Left", "measured", 1, 10, 9, 13),
        ("Left", "measured", 2, 20, 18, 24),
        ("Left", "theory", 1, 11, None, None),
        ("Left", "theory", 2, 19, None, None),
        ("Right", "raw", 5, 0, None, None),
        ("Right", "coded", 7, 1, None, None),
    ]


def test_a_bar_of_an_unknown_value_or_error_has_no_ends():
    figure, ax = subplots(figsize=(3, 2))
    ax.errorbar([1, 2, 3], [10, np.nan, 30], [1, np.nan, np.nan], label="measured")
    assert [row[2:] for row in drawn(figure).rows] == [(9, 11), (None, None), (None, None)]


def test_steps_dots_and_small_maps():
    figure, (a, b, c) = subplots(3, 1, figsize=(3, 6))
    a.stairs([3, 4], [0, 1, 2], label="count")
    b.scatter([1.5], [2.5], label="dots")
    c.imshow([[1.0, 2.0], [3.0, np.nan]])
    rows = drawn(figure).rows
    assert [row[1:4] for row in rows[:3]] == [("count", 0, 3), ("count", 1, 4), ("dots", 1.5, 2.5)]
    assert [row[1:3] for row in rows[3:]] == [
        ("row 0", 0),
        ("row 0", 1),
        ("row 1", 0),
        ("row 1", 1),
    ]
    assert [row[3] for row in rows[3:6]] == [1, 2, 3] and np.isnan(rows[6][3])


def test_a_large_map_is_a_picture():
    figure, ax = subplots(figsize=(3, 2))
    ax.imshow(np.zeros((200, 200)))
    assert drawn(figure).rows == []


def test_long_curves_are_thinned_each_on_its_own():
    rows = [(name, float(n), n / 7) for name in ("a", "b") for n in range(4000)]
    text, every = Data(("curve", "x", "y"), rows).csv()
    assert every > 1 and len(text) < 1.2 * LARGEST
    kept = list(csv.reader(io.StringIO(text)))[1:]
    for name in ("a", "b"):
        mine = [float(x) for curve, x, _ in kept if curve == name]
        assert mine == list(range(0, 4000, every))


@pytest.mark.parametrize("text", ['a "quoted" name', "one, two", "line\nbreak"])
def test_names_survive_the_format(text):
    written, _ = Data(("name", "x"), [(text, 1.5)]).csv()
    assert list(csv.reader(io.StringIO(written))) == [["name", "x"], [text, "1.5"]]
