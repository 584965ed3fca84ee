"""Memory of results that is used again."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.compute.outputs import Outputs


def address(array: np.ndarray) -> int:
    return int(array.__array_interface__["data"][0])


def test_memory_is_handed_out_again_when_nothing_refers_to_it() -> None:
    outputs = Outputs(np.uint32)
    first = outputs.take((4, 1000))
    assert (first.shape, first.dtype, first.flags.c_contiguous) == ((4, 1000), np.uint32, True)
    place = address(first)
    del first
    assert address(outputs.take((2, 500))) == place


def test_memory_is_kept_for_an_array_and_for_views_of_it() -> None:
    outputs = Outputs(np.uint32)
    first = outputs.take((4, 1000))
    first[:] = 7
    view = first.reshape(8, 500)[3:5, ::2]
    second = outputs.take((4, 1000))
    second[:] = 1
    assert (first == 7).all()
    del first
    third = outputs.take((4, 1000))
    third[:] = 2
    assert (view == 7).all() and (second == 1).all()


def test_many_arrays_may_be_held_and_few_memories_are_kept() -> None:
    outputs = Outputs(np.uint32)
    held = [outputs.take((100,)) for _ in range(10)]
    for n, array in enumerate(held):
        array[:] = n
    assert [int(array[0]) for array in held] == list(range(10))
    assert len({address(array) for array in held}) == 10
    del held, array
    assert len({address(outputs.take((100,))) for _ in range(5)}) == 1


def test_a_larger_array_has_new_memory() -> None:
    outputs = Outputs(np.uint8)
    small = outputs.take((10,))
    small[:] = 5
    del small
    assert outputs.take((1000, 3)).shape == (1000, 3)
    assert outputs.take((0, 7)).size == 0


def test_of_large_memories_one_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cosim.compute.outputs._LARGEST", 1000)
    outputs = Outputs(np.uint32)
    held = [outputs.take((1000,)) for _ in range(3)]
    last = address(held[-1])
    del held
    assert len(outputs._memories) == 1 and address(outputs.take((1000,))) == last
