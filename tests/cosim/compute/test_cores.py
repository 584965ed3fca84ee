"""Work beside the caller, and by rows."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from cosim.compute import cores
from cosim.compute.cores import beside, by_rows


def test_work_beside_gives_its_result_or_raises() -> None:
    def fail() -> None:
        raise KeyError("no such plane")

    assert [end() for end in [beside(lambda n=n: n * n) for n in range(50)]] == [
        n * n for n in range(50)
    ]
    end = beside(fail)
    with pytest.raises(KeyError, match="no such plane"):
        end()


def test_work_that_has_not_begun_is_done_by_the_caller() -> None:
    held, main = threading.Event(), threading.get_ident()
    busy = [beside(held.wait) for _ in range(max(cores.cores() - 1, 1))]
    waiting = beside(threading.get_ident)
    assert waiting() == main
    held.set()
    for end in busy:
        end()


def test_one_core_has_nothing_beside(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores, "cores", lambda: 1)
    assert beside(threading.get_ident)() == threading.get_ident()


@pytest.mark.parametrize("least", [0, 1 << 13])
def test_rows_are_each_given_once(least: int) -> None:
    out, seen = np.zeros(101), []

    def fill(first: int, stop: int, values: np.ndarray) -> None:
        values[first:stop] += np.arange(first, stop)
        seen.append((first, stop))

    by_rows(fill, 101, out, least=least)
    np.testing.assert_array_equal(out, np.arange(101))
    assert len(seen) == (1 if least else cores._threads())


def test_fewer_rows_than_cores_are_no_empty_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores, "_threads", lambda: 8)
    seen: list[tuple[int, int]] = []
    by_rows(lambda first, stop: seen.append((first, stop)), 3)
    assert sorted(seen) == [(0, 1), (1, 2), (2, 3)]


def test_threads_are_as_few_as_the_user_wants(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cores, "cores", lambda: 8)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    for wanted, count in (("3", 3), ("99", 8), ("0", 8), ("all", 8)):
        monkeypatch.setenv("NUMBA_NUM_THREADS", wanted)
        assert cores._threads() == count
    monkeypatch.setenv("OMP_NUM_THREADS", "1")  # that of a worker
    assert cores._threads() == 1
