"""A stream on a panel of another size: which pixel shows which."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from display import fit_words

sizes = st.tuples(st.integers(1, 9), st.integers(1, 9))


def numbered(shape: tuple[int, int]) -> np.ndarray:  # type: ignore[type-arg]
    """Two words of each pixel, that tell which it is; none is 0."""
    number = np.arange(1, shape[0] * shape[1] + 1, dtype=np.uint32).reshape(shape)
    return np.stack([number, number * np.uint32(1000)])


def test_words_of_the_same_size_come_back_themselves() -> None:
    words = numbered((3, 4))
    for fit in ("exact", "nearest", "centre"):
        assert fit_words(fit, (3, 4), (3, 4))(words) is words  # type: ignore[arg-type]


def test_exact_refuses_another_size_and_names_both() -> None:
    with pytest.raises(ValueError, match=r"\(3, 4\) pixels, not \(4, 3\)"):
        fit_words("exact", (3, 4), (4, 3))


@given(sizes, sizes)
def test_nearest_shows_the_pixel_whose_middle_is_nearest(
    stream: tuple[int, int], panel: tuple[int, int]
) -> None:
    words = numbered(stream)
    shown = fit_words("nearest", stream, panel)(words)
    assert shown.shape == (2, *panel) and shown.flags.c_contiguous
    for y in range(panel[0]):
        for x in range(panel[1]):
            at = (y + 0.5) * stream[0] / panel[0], (x + 0.5) * stream[1] / panel[1]
            far = [
                np.abs(np.arange(n) + 0.5 - middle) for n, middle in zip(stream, at, strict=True)
            ]
            row, column = divmod(int(shown[0, y, x]) - 1, stream[1])
            assert far[0][row] <= far[0].min() + 1e-9 and far[1][column] <= far[1].min() + 1e-9


@given(sizes, sizes)
def test_centre_keeps_the_middle_and_frames_it_by_dark(
    stream: tuple[int, int], panel: tuple[int, int]
) -> None:
    words = numbered(stream)
    shown = fit_words("centre", stream, panel)(words)
    assert shown.shape == (2, *panel) and shown.flags.c_contiguous
    cut = [min(a, b) for a, b in zip(stream, panel, strict=True)]
    assert np.count_nonzero(shown[0]) == cut[0] * cut[1]
    back = fit_words("centre", panel, stream)(shown)  # the middle comes back where it was
    kept = back != 0
    assert kept.sum() == 2 * cut[0] * cut[1] and (back[kept] == words[kept]).all()
