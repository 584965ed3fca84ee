"""Stages at the same time: the order, the memory, errors, and stops."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Interrupted
from cosim.run.loop import Checkpoint, run_blocks
from cosim.stage import Block

CYCLES = 64 * 40 + 7


class Source:
    """Numbers; counts the blocks that are under way."""

    def __init__(self) -> None:
        self.made = 0

    def step(self, data: Any, block: Block) -> np.ndarray:
        self.made += 1
        return np.arange(block.start, block.stop)


class Sum:
    """A running sum, which depends on the order. Its time differs from block to block."""

    def __init__(self, wait: float = 0.0) -> None:
        self.total, self._wait = 0, wait

    def step(self, data: np.ndarray, block: Block) -> np.ndarray:
        time.sleep(self._wait * (block.start // 64 % 3))
        out = np.cumsum(data) * 3 + self.total
        self.total = int(out[-1]) % 1_000_003
        return out

    def state(self) -> dict[str, np.ndarray]:
        return {"total": np.array(self.total)}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        self.total = int(state["total"])


class Sink:
    """Remembers everything, and the threads that it was called in."""

    def __init__(self, one_thread: bool = False) -> None:
        self.got: list[np.ndarray] = []
        self.threads: set[int] = set()
        self.one_thread = one_thread

    def step(self, data: np.ndarray, block: Block) -> None:
        self.got.append(data)
        self.threads.add(threading.get_ident())


def chain(wait: float = 0.0, one_thread: bool = False) -> dict[str, Any]:
    return {"source": Source(), "a": Sum(wait), "b": Sum(wait), "sink": Sink(one_thread)}


def test_the_results_are_those_of_one_stage_after_another() -> None:
    once, together = chain(), chain(0.001)
    run_blocks(once, CYCLES)
    done: list[int] = []
    spent = run_blocks(together, CYCLES, parallel=True, progress=done.append)
    assert np.array_equal(np.concatenate(once["sink"].got), np.concatenate(together["sink"].got))
    assert done == [*range(0, CYCLES, 64), CYCLES]
    assert spent.keys() == together.keys() and spent["a"] > 0.01


def test_stages_overlap() -> None:
    """Both stages must be in a step at once, or none of them ends."""
    meeting = threading.Barrier(2, timeout=20)

    class Meet(Sum):
        def step(self, data: Any, block: Block) -> Any:
            if block.start:  # the second stage is one block behind
                meeting.wait()
            return data

    class MeetLater(Meet):
        def step(self, data: Any, block: Block) -> Any:
            if block.stop < 64 * 4:
                meeting.wait()
            return data

    stages = {"source": Source(), "a": Meet(), "b": MeetLater(), "sink": Sink()}
    run_blocks(stages, 64 * 4, parallel=True)
    assert len(stages["sink"].got) == 4


def test_few_blocks_are_under_way() -> None:
    stages = chain()
    source, most = stages["source"], 0

    class Slow(Sink):
        def step(self, data: np.ndarray, block: Block) -> None:
            nonlocal most
            time.sleep(0.002)
            super().step(data, block)
            most = max(most, source.made - len(self.got))

    run_blocks({**stages, "sink": Slow()}, CYCLES, parallel=True)
    assert most <= 2 * len(stages)


def test_a_stage_of_one_thread_stays_in_the_thread_of_the_caller() -> None:
    stages = chain(one_thread=True)
    run_blocks(stages, CYCLES, parallel=True)
    assert stages["sink"].threads == {threading.get_ident()}


@pytest.mark.parametrize("where", ["source", "a", "b", "sink"])
def test_an_error_of_a_stage_ends_the_run(where: str) -> None:
    stages = chain()

    class Bad:
        def step(self, data: Any, block: Block) -> Any:
            if block.start >= 640:
                raise ValueError("a stage has failed")
            return stages[where].step(data, block)

    before = threading.active_count()
    with pytest.raises(ValueError, match="a stage has failed"):
        run_blocks({**stages, where: Bad()}, CYCLES, parallel=True)
    assert threading.active_count() == before


def test_a_stopped_run_goes_on_to_the_same_end(tmp_path: Path) -> None:
    """The checkpoint is taken when no block is under way."""
    whole = chain()
    run_blocks(whole, CYCLES)
    import signal

    stages, checkpoint = chain(0.0005), Checkpoint(tmp_path / "c.npz", "run")

    def stop(done: int) -> None:
        if done == 640:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(Interrupted):
        run_blocks(stages, CYCLES, checkpoint=checkpoint, progress=stop, parallel=True)
    again = chain()
    begin = checkpoint.load(again)
    assert 640 <= begin <= 640 + 64 * 12
    run_blocks(again, CYCLES, begin=begin, parallel=True)
    first = np.concatenate(stages["sink"].got)
    assert len(first) == begin
    joined = np.concatenate([first, *again["sink"].got])
    assert np.array_equal(joined, np.concatenate(whole["sink"].got))


def test_checkpoints_in_between_do_not_change_the_results(tmp_path: Path) -> None:
    whole, often = chain(), chain()
    run_blocks(whole, CYCLES)
    checkpoint = Checkpoint(tmp_path / "c.npz", "run")
    run_blocks(often, CYCLES, checkpoint=checkpoint, every_s=-1, parallel=True)
    assert np.array_equal(np.concatenate(whole["sink"].got), np.concatenate(often["sink"].got))
    assert checkpoint.load(chain()) == CYCLES
