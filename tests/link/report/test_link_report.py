"""What a link's report says of its errors, and the axis that they are drawn on."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from cv2 import imread

from link.evaluation.errors import count_errors
from link.evaluation.record import Theory
from link.layout import Layout
from link.mode import Mode
from link.report.errors import end_text, theory_text
from link.report.figures import lowest_rate
from link.report.signal_figures import view_figure

LAYOUT = Layout(Mode(128, 128, 8, 2, "8b10b", 32))


def _errors(wrong: dict[int, int], last: int):
    """Of symbols 48 to 57, so many wrong in some of them."""

    def decided(symbol: int, count: int) -> np.ndarray:
        return np.arange(LAYOUT.cells)[None, :] < wrong.get(symbol, 0)

    def sent(symbol: int, count: int) -> np.ndarray:
        return np.zeros((count, LAYOUT.cells), np.bool_)

    return count_errors(sent, decided, LAYOUT, range(48, 58), last)


def test_errors_of_the_transmissions_last_symbol_are_told_apart():
    errors = _errors({50: 2, 57: 5}, 57)
    assert (errors.wrong, errors.at_end) == (7, 5)
    told = end_text(errors)
    assert told.startswith(" 5 of the wrong bits")
    assert f"{2 / (9 * LAYOUT.cells):.2g} are wrong" in told
    for other in (_errors({50: 2}, 57), _errors({50: 2, 57: 5}, 59), _errors({}, 57)):
        assert other.at_end == 0
        assert not end_text(other)


def test_theory_is_stated_with_its_limits_and_with_what_it_takes_as_known():
    drawn, coarse = Theory(None, 2.2e-4, None, (1.8e-4, 3.2e-4)), Theory(None, 2.2e-4, None)
    for ticks, learns in ((1, True), (2, False)):
        said = theory_text(drawn, ticks)
        assert "0.00018 to 0.00032" in said and ("learns these laws" in said) is learns
        assert "coarse estimate" in theory_text(coarse, ticks)


def test_the_axis_of_error_rates_begins_below_all_that_is_drawn():
    assert lowest_rate([8.7e-5, 1.9e-5, 2.4e-9], 854_400) < 2.4e-9
    assert lowest_rate([0.0, 1e-5, None], 10**6) < 1e-6
    assert lowest_rate([1e-3, 0.0, 1e-200], 10**6) == 1e-18


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("shape", [(3, 400), (250, 3)])
def test_the_view_of_a_narrow_camera_has_room(tmp_path, shape):
    corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    link = SimpleNamespace(image=np.zeros(shape), truth=corners, outline=corners)
    view_figure(link, tmp_path / "view.png")
    height, width = imread(tmp_path / "view.png").shape[:2]
    assert height < 3 * width
