"""A checkpoint whose arrays are not those that a run wrote: nothing is restored from it."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cosim import Checkpoint, InputError
from cosim.archive import load_arrays

State = dict[str, np.ndarray]


class Holder:
    """A stage with arrays of many types and forms; it notes what it restores."""

    def __init__(self) -> None:
        self.restored: list[State] = []

    def step(self, data: object, block: object) -> None: ...

    def state(self) -> State:
        return {
            "deficit": np.arange(-20, 20), "bits": np.ones((3, 4), bool),
            "turned": np.arange(12.0).reshape(3, 4).T, "every": np.arange(10, dtype=np.uint8)[::2],
            "count": np.array(7), "none": np.zeros((0, 5), np.float32),
        }  # fmt: skip

    def restore(self, state: State) -> None:
        self.restored.append(state)


@pytest.fixture
def checkpoint(tmp_path: Path) -> Checkpoint:
    checkpoint = Checkpoint(tmp_path / "checkpoint.npz", "this run")
    checkpoint.save(64, {"holder": Holder()})
    return checkpoint


def damaged(arrays: State) -> Iterator[tuple[str, State]]:
    """The arrays with one that is cut, longer, gone, of another name, shape or type, or with a bit
    that is another; the archive around them is sound."""
    for name, array in arrays.items():
        others = {n: a for n, a in arrays.items() if n != name}
        rng = random.Random(name)
        yield f"{name} gone", others
        yield f"{name} under another name", {**others, name + "1": array}
        yield f"{name} longer", {**others, name: np.append(array, array)}
        yield f"{name} in other brackets", {**others, name: array[None]}
        if array.size:
            yield f"{name} cut", {**others, name: array.reshape(-1)[: array.size // 2]}
            data = bytearray(array.tobytes())
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            if array.dtype.kind != "U":  # a text of another form may not be one
                flipped = np.frombuffer(bytes(data), array.dtype).reshape(array.shape)
                yield f"{name} flipped", {**others, name: flipped}
        if array.dtype.kind in "iu":
            yield f"{name} of another type", {**others, name: array.astype(np.float64)}
    yield "another array", {**arrays, "holder/more": np.zeros(3)}
    yield "none", {"cycle": np.array(64)}


def test_no_array_is_restored_unless_all_are_as_they_were_written(checkpoint: Checkpoint) -> None:
    for what, arrays in damaged(load_arrays(checkpoint.path)):
        np.savez(checkpoint.path, **arrays)
        holder = Holder()
        with pytest.raises(InputError) as refused:
            checkpoint.load({"holder": holder})
        assert str(refused.value) == (
            "the checkpoint must be one that this run wrote, not a damaged file; "
            f"remove {checkpoint.path} to start afresh, or give the run another --out"
        ), what
        assert holder.restored == [], what


def test_a_sound_checkpoint_is_restored(checkpoint: Checkpoint) -> None:
    holder = Holder()
    assert checkpoint.load({"holder": holder}, 64) == 64
    (restored,) = holder.restored
    assert restored.keys() == holder.state().keys()
    for name, array in holder.state().items():
        np.testing.assert_array_equal(restored[name], array)
        assert restored[name].dtype == array.dtype


def test_a_checkpoint_beyond_the_end_of_its_run_is_refused(checkpoint: Checkpoint) -> None:
    with pytest.raises(InputError, match="must be at most at cycle 63, not one at cycle 64"):
        checkpoint.load({"holder": Holder()}, 63)


@pytest.mark.parametrize("error", [ValueError, TypeError, IndexError, KeyError])
def test_a_state_of_another_form_is_one_line(
    checkpoint: Checkpoint, error: type[Exception]
) -> None:
    """As a run of a changed program of the same version may leave it."""

    class Changed(Holder):
        def restore(self, state: State) -> None:
            raise error("it has 3 rows")

    with pytest.raises(InputError, match=r"the checkpoint must be one with .*holder.*remove"):
        checkpoint.load({"holder": Changed()})


def test_a_run_that_cannot_load_its_checkpoint_leaves_it(checkpoint: Checkpoint) -> None:
    before = checkpoint.path.read_bytes()
    with pytest.raises(InputError):
        Checkpoint(checkpoint.path, "another run").load({"holder": Holder()})
    assert checkpoint.path.read_bytes() == before
