"""Absolute intensities: checks of their content, their image and their file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import Clock, InputError, Intensities, intensity_image, join_intensities, last_reports
from cosim.files.intensities import read_intensities, write_intensities

CLOCK = Clock(2997, 100)


def made(**changed: object) -> Intensities:
    values: dict[str, object] = {
        "row": np.array([0, 1, 0, 1], np.uint16),
        "column": np.array([1, 0, 1, 2], np.uint16),
        "time": np.array([3, 3, 7, 40], np.int64),
        "value": np.array([5.0, 2.5, 6.0, 0.0]),
        "shape": (2, 3),
        "ticks": 50,
        "clock": CLOCK,
    }
    return Intensities(**{**values, **changed})  # type: ignore[arg-type]


def part(first: int, stop: int) -> Intensities:
    """The reports of ticks first .. stop - 1."""
    whole = made()
    own = (whole.time >= first) & (whole.time < stop)
    fields = {n: getattr(whole, n)[own] for n in ("row", "column", "time", "value")}
    return made(**fields, start=first, ticks=stop - first)


def test_an_image_is_the_last_value_of_every_pixel() -> None:
    nan = np.nan
    for tick, image in (
        (2, [[nan, nan, nan], [nan, nan, nan]]),
        (3, [[nan, 5, nan], [2.5, nan, nan]]),
        (39, [[nan, 6, nan], [2.5, nan, nan]]),
        (49, [[nan, 6, nan], [2.5, nan, 0]]),
    ):
        np.testing.assert_array_equal(intensity_image(made(), tick), image)
    for tick in (-1, 50):
        with pytest.raises(ValueError, match="0 to 49"):
            intensity_image(made(), tick)


def test_an_image_of_many_reports_is_what_a_loop_finds() -> None:
    rng = np.random.default_rng(3)
    there = rng.random((60, 5, 7)) < 0.2
    time, row, column = np.nonzero(there)
    value = rng.random(len(time))
    reports = Intensities(
        row.astype(np.uint16), column.astype(np.uint16), time, value, (5, 7), 60, CLOCK
    )
    image, place = np.full((5, 7), np.nan), np.full((5, 7), -1)
    for n, (t, r, c, v) in enumerate(zip(time, row, column, value, strict=True)):
        image[r, c], place[r, c] = v, n
        if t == 30:
            np.testing.assert_array_equal(
                intensity_image(reports, 30)[there[30]], value[time == 30]
            )
    np.testing.assert_array_equal(intensity_image(reports, 59), image)
    np.testing.assert_array_equal(last_reports(reports, 59), place)
    assert (last_reports(reports, 0)[~there[0]] == -1).all()


def test_parts_join() -> None:
    for cut in (1, 3, 4, 41):
        assert join_intensities([part(0, cut), part(cut, 50)]) == made()
    shared = [part(0, 4), made(start=3, ticks=47, **{
        n: getattr(made(), n)[2:] for n in ("row", "column", "time", "value")
    })]  # fmt: skip
    assert join_intensities(shared) == made()
    for bad in ([part(0, 4), part(5, 50)], [part(0, 6), part(4, 50)], []):
        with pytest.raises(ValueError, match="part"):
            join_intensities(bad)
    with pytest.raises(ValueError, match="one shape and clock"):
        join_intensities([part(0, 41), made(start=41, ticks=9, clock=Clock(1), **{
            n: getattr(made(), n)[4:] for n in ("row", "column", "time", "value")
        })])  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"row": np.array([0, 2, 0, 1], np.uint16)}, "2 rows"),
        ({"column": np.array([0, 0, 1, 3], np.uint16)}, "3 columns"),
        ({"time": np.array([3, 2, 7, 40])}, "rise"),
        ({"time": np.array([3, 3, 7, 50])}, "49"),
        ({"row": np.array([1, 0, 0, 1], np.uint16)}, "in order"),
        ({"time": np.array([3, 7, 7, 7]), "row": np.array([0, 0, 0, 1], np.uint16),
          "column": np.array([1, 1, 1, 2], np.uint16)}, "one a pixel"),
        ({"value": np.array([1.0, -1.0, 1.0, 1.0])}, "finite and 0"),
        ({"value": np.array([1.0, np.nan, 1.0, 1.0])}, "finite and 0"),
        ({"value": np.array([1.0, np.inf, 1.0, 1.0])}, "finite and 0"),
        ({"value": np.ones(4, np.float32)}, r"\(4,\) float64"),
        ({"value": np.ones(3)}, r"\(4,\) float64"),
        ({"ticks": 0}, "1 or more"),
        ({"shape": (0, 3)}, "1 or more"),
    ],
)  # fmt: skip
def test_refuses(changed: dict[str, object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        made(**changed)


def test_equal_by_content() -> None:
    assert made() == made()
    assert made() != made(start=-1)
    assert made() != made(value=np.array([5.0, 2.5, 6.0, 1.0]))
    assert made() != "reports"


def test_a_file_loses_nothing(tmp_path: Path) -> None:
    for reports in (made(), made(start=-7), part(0, 2)):
        write_intensities(reports, tmp_path / "a.npz")
        assert read_intensities(tmp_path / "a.npz") == reports
    with np.load(tmp_path / "a.npz") as file:
        assert [int(x) for x in file["clock"]] == [2997, 100]


@pytest.mark.parametrize(
    ("change", "given"),
    [
        ({"value": None}, "one without 'value'"),
        ({"clock": np.array([1, 0])}, "one where clock frequency"),
        ({"clock": np.array(1)}, "one where"),
        ({"ticks": np.array(2.5)}, "one where"),
        ({"ticks": np.array(1)}, "one where times must rise"),
        ({"shape": np.array([2, 3, 4])}, "one where"),
        ({"value": np.full(4, -1.0)}, "one where values"),
        ({"row": np.zeros((2, 2), np.uint16)}, "one where row"),
        ({"time": np.array(3)}, "one where"),
    ],
)
def test_other_archives_are_refused(tmp_path: Path, change, given: str) -> None:
    path = tmp_path / "a.npz"
    write_intensities(made(), path)
    with np.load(path) as file:
        arrays = {**file, **change}
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(InputError) as refused:
        read_intensities(path)
    assert str(refused.value).startswith(f"{path} must be an .npz of `row`")
    assert f", not {given}" in str(refused.value)


@settings(max_examples=100)
@given(st.data())
def test_damage_is_refused_or_harmless(tmp_path_factory, damage, data: st.DataObject) -> None:
    path = tmp_path_factory.mktemp("reports") / "a.npz"
    write_intensities(made(), path)
    path.write_bytes(damage(data, path.read_bytes()))
    try:
        again = read_intensities(path)
    except InputError:
        return
    assert again == made()


@given(st.binary(max_size=300))
def test_random_bytes_are_refused(tmp_path_factory, content: bytes) -> None:
    path = tmp_path_factory.mktemp("reports") / "a.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"must be an \.npz"):
        read_intensities(path)
