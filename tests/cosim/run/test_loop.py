"""The run loop: blocks in order, and equal results for an interrupted and resumed run."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import BLOCK, Block, Checkpoint, InputError, Interrupted, run_blocks
from cosim.stage import Stateful, blocks

CYCLES = 300


class Numbers:
    """First stage: the numbers of the cycles of a block."""

    def step(self, data: None, block: Block) -> np.ndarray:
        assert data is None
        return np.arange(block.start, block.stop)


class Mixer:
    """Second stage: a state that depends on all cycles and their order."""

    def __init__(self) -> None:
        self.mixed = np.uint64(1)
        self.seen: list[int] = []

    def step(self, data: np.ndarray, block: Block) -> np.ndarray:
        for number in data:
            self.mixed = np.uint64((int(self.mixed) * 6364136223846793005 + int(number)) % 2**64)
        self.seen += data.tolist()
        return data

    def state(self) -> dict[str, np.ndarray]:
        return {"mixed": np.array(self.mixed), "seen": np.array(self.seen, np.int64)}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        self.mixed, self.seen = np.uint64(state["mixed"]), state["seen"].tolist()


def chain() -> dict[str, object]:
    return {"numbers": Numbers(), "mixer": Mixer()}


def uninterrupted() -> Mixer:
    stages = chain()
    run_blocks(stages, CYCLES)
    return stages["mixer"]


@pytest.mark.parametrize(
    ("cycles", "size", "start", "expected"),
    [
        (128, 64, 0, [(0, 64), (64, 64)]),
        (130, 64, 0, [(0, 64), (64, 64), (128, 2)]),
        (130, 64, 64, [(64, 64), (128, 2)]),
        (130, 64, 100, [(100, 30)]),
        (10, 64, 0, [(0, 10)]),
        (64, 64, 64, []),
        (0, 64, 0, []),
        (3, 1, 0, [(0, 1), (1, 1), (2, 1)]),
    ],
)
def test_blocks_fill_the_run(cycles: int, size: int, start: int, expected) -> None:
    made = list(blocks(cycles, size, start))
    assert [(b.start, b.cycles) for b in made] == expected
    assert [b.stop for b in made[:-1]] == [b.start for b in made[1:]]


def test_every_cycle_goes_through_every_stage_once_in_order() -> None:
    stages, done = chain(), []
    spent = run_blocks(stages, CYCLES, progress=done.append)
    assert stages["mixer"].seen == list(range(CYCLES))
    assert done == [0, 64, 128, 192, 256, 300]
    assert BLOCK == 64
    assert spent.keys() == stages.keys()
    assert all(seconds >= 0 for seconds in spent.values())


def test_only_stages_that_remember_are_stateful() -> None:
    assert isinstance(Mixer(), Stateful)
    assert not isinstance(Numbers(), Stateful)


def test_a_checkpoint_gives_back_what_it_was_given(tmp_path: Path) -> None:
    checkpoint = Checkpoint(tmp_path / "checkpoint.npz", "this run")
    stages, fresh = chain(), chain()
    assert checkpoint.load(fresh) == 0
    run_blocks(stages, CYCLES)
    checkpoint.save(CYCLES, stages)
    assert [p.name for p in tmp_path.iterdir()] == ["checkpoint.npz"]
    assert checkpoint.load(fresh) == CYCLES
    assert fresh["mixer"].seen == list(range(CYCLES))
    assert fresh["mixer"].mixed == stages["mixer"].mixed


def test_a_checkpoint_that_cannot_be_written_leaves_the_one_before(tmp_path: Path) -> None:
    class Full(Mixer):
        def state(self) -> dict[str, np.ndarray]:
            return super().state() | {"zz": np.array([object()])}  # numpy refuses to write it

    checkpoint, again = Checkpoint(tmp_path / "checkpoint.npz", "this run"), chain()
    checkpoint.save(64, chain())
    with pytest.raises(ValueError, match="Object arrays cannot be saved"):
        checkpoint.save(128, {"mixer": Full()})
    assert checkpoint.load(again) == 64


def test_a_checkpoint_is_saved_as_time_goes_by(tmp_path: Path) -> None:
    checkpoint = Checkpoint(tmp_path / "checkpoint.npz", "this run")
    run_blocks(chain(), CYCLES, checkpoint=checkpoint, every_s=-1)
    assert checkpoint.load(chain()) == CYCLES
    other = Checkpoint(tmp_path / "other.npz", "this run")
    run_blocks(chain(), CYCLES, checkpoint=other, every_s=1e9)
    assert not other.path.exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("at", [0, 64, 192])
def test_an_interrupted_run_goes_on_to_the_same_end(
    tmp_path: Path, number: signal.Signals, at: int
) -> None:
    checkpoint = Checkpoint(tmp_path / "checkpoint.npz", "this run")
    handlers = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)

    def ask(done: int) -> None:
        if done == at + 64:
            os.kill(os.getpid(), number)

    with pytest.raises(Interrupted) as stopped:
        run_blocks(chain(), CYCLES, checkpoint=checkpoint, progress=ask, remedy="say --resume")
    assert (stopped.value.done, stopped.value.total) == (at + 64, CYCLES)
    assert str(stopped.value) == f"interrupted after {at + 64} of {CYCLES} cycles; say --resume"
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers

    stages, done = chain(), []
    begin = checkpoint.load(stages)
    run_blocks(stages, CYCLES, checkpoint=checkpoint, begin=begin, progress=done.append)
    assert done[0] == at + 64
    assert stages["mixer"].seen == list(range(CYCLES))
    assert stages["mixer"].mixed == uninterrupted().mixed


def test_an_interruption_inside_a_block_waits_for_its_end() -> None:
    class Asking(Mixer):
        def step(self, data: np.ndarray, block: Block) -> np.ndarray:
            if block.start == 64:
                os.kill(os.getpid(), signal.SIGINT)
            return super().step(data, block)

    stages = {"numbers": Numbers(), "mixer": Asking()}
    with pytest.raises(Interrupted):
        run_blocks(stages, CYCLES)
    assert stages["mixer"].seen == list(range(128))


def test_an_interruption_in_the_last_block_is_one_as_well() -> None:
    stages = chain()
    ask = {CYCLES: lambda: os.kill(os.getpid(), signal.SIGINT)}
    with pytest.raises(Interrupted):
        run_blocks(stages, CYCLES, progress=lambda done: ask.get(done, int)())
    assert stages["mixer"].seen == list(range(CYCLES))


def test_a_run_that_is_not_gone_on_with_starts_afresh(tmp_path: Path) -> None:
    checkpoint = Checkpoint(tmp_path / "checkpoint.npz", "this run")
    run_blocks(chain(), 128, checkpoint=checkpoint, every_s=-1)
    stages, done = chain(), []
    run_blocks(stages, CYCLES, checkpoint=checkpoint, progress=done.append)
    assert done[0] == 0
    assert stages["mixer"].seen == list(range(CYCLES))


def test_a_fault_in_a_stage_leaves_the_last_checkpoint(tmp_path: Path) -> None:
    class Faulty(Mixer):
        def step(self, data: np.ndarray, block: Block) -> np.ndarray:
            if block.start == 192:
                raise RuntimeError("a fault of ours")
            return super().step(data, block)

    checkpoint = Checkpoint(tmp_path / "checkpoint.npz", "this run")
    stages = {"numbers": Numbers(), "mixer": Faulty()}
    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(RuntimeError, match="a fault of ours"):
        run_blocks(stages, CYCLES, checkpoint=checkpoint, every_s=-1)
    assert signal.getsignal(signal.SIGINT) is handler
    again = chain()
    run_blocks(again, CYCLES, checkpoint=checkpoint, begin=checkpoint.load(again))
    assert again["mixer"].mixed == uninterrupted().mixed


def test_a_run_beside_the_main_thread_works_without_signals() -> None:
    stages = chain()
    thread = threading.Thread(target=run_blocks, args=(stages, CYCLES))
    thread.start()
    thread.join()
    assert stages["mixer"].seen == list(range(CYCLES))


def test_the_checkpoint_of_another_run_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    Checkpoint(path, "seed 1").save(64, chain())
    with pytest.raises(InputError) as refused:
        Checkpoint(path, "seed 2").load(chain())
    assert str(refused.value) == (
        "the checkpoint must be one of this same scenario, not one of another; "
        f"remove {path} to start afresh, or give the run another --out"
    )


@settings(max_examples=100)
@given(st.data())
def test_a_damaged_checkpoint_is_refused_or_harmless(
    tmp_path_factory, damage, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("loop") / "checkpoint.npz"
    checkpoint, stages = Checkpoint(path, "this run"), chain()
    run_blocks(stages, 100, checkpoint=checkpoint, every_s=-1)
    path.write_bytes(damage(data, path.read_bytes()))
    again = chain()
    try:
        cycle = checkpoint.load(again)
    except InputError as exc:
        assert "the checkpoint must be one" in str(exc)
        return
    assert (cycle, again["mixer"].mixed) == (100, stages["mixer"].mixed)
    assert again["mixer"].seen == stages["mixer"].seen


@pytest.mark.parametrize("content", [None, b"", b"\x00" * 100, b"PK\x05\x06" + bytes(18)])
def test_what_is_no_checkpoint_is_refused(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "checkpoint.npz"
    path.mkdir() if content is None else path.write_bytes(content)
    with pytest.raises(InputError, match="one that this run wrote, not a damaged file; remove"):
        Checkpoint(path, "this run").load(chain())


def test_a_gate_ends_the_run_and_is_asked_before_each_block() -> None:
    asked, seen = [], []

    class Seen:
        def step(self, data: object, block: Block) -> None:
            seen.append(block.start)

    def gate(block: Block, stopping: object) -> bool:
        asked.append(block.start)
        return block.start < 128

    for parallel in (False, True):
        run_blocks({"seen": Seen()}, 640, gate=gate, parallel=parallel)
        assert (asked, seen) == ([0, 64, 128], [0, 64])
        asked.clear(), seen.clear()


def test_a_gate_that_waits_ends_when_the_user_asks_to_stop(tmp_path: Path) -> None:
    """All blocks before it have passed all stages, and the checkpoint is there."""

    def gate(block: Block, stopping: Callable[[], bool]) -> bool:
        if block.start == 128:
            signal.raise_signal(signal.SIGINT)
            assert stopping()
        return block.start < 128

    checkpoint = Checkpoint(tmp_path / "c.npz", "x")
    with pytest.raises(Interrupted, match="after 128 of 640 cycles"):
        run_blocks({}, 640, gate=gate, checkpoint=checkpoint)
    assert checkpoint.load({}) == 128
