"""A loss of power: what a checkpoint and a result build on is on the disk before them, and a run
whose recording is lost or damaged all the same begins again."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cosim import Interrupted
from cosim.files import Recorder
from cosim.run import chain
from cosim.run.progress import QuietProgress
from tests.recorded.recording import left_behind
from tests.survival.disk import watched

SETS = (
    "scene.at=1.26 ms", "duration=6.25 ms", "image.at=[60]", "sensor.width=64", "sensor.height=48",
)  # fmt: skip
"""250 cycles: four chunks, the last of which is not full."""
BARRIERS = ("checkpoint.npz", "result.json")


def at_barrier(name: str) -> bool:
    return name in BARRIERS


def interrupt(film: Any, folder: Path, at: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs until Ctrl-C in the block that begins at cycle `at`."""
    step = Recorder.step

    def signalled(self: Recorder, data: Any, block: Any) -> Any:
        if block.start == at:
            os.kill(os.getpid(), signal.SIGINT)
        return step(self, data, block)

    with monkeypatch.context() as patched:
        patched.setattr(Recorder, "step", signalled)
        with pytest.raises(Interrupted):
            film("step", folder, *SETS)
    assert (folder / "checkpoint.npz").exists()


@pytest.fixture(scope="module")
def untouched(film: Any, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a run leaves that nothing happened to."""
    _, folder = film("step", tmp_path_factory.mktemp("untouched") / "run", *SETS)
    return left_behind(folder)


def save_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Has runs write a checkpoint after every block."""
    run_blocks, often = chain.run_blocks, {"every_s": 0.0}
    monkeypatch.setattr(chain, "run_blocks", lambda *a, **k: run_blocks(*a, **{**k, **often}))


@pytest.mark.parametrize("store", ["raw", "none"])
def test_everything_is_on_the_disk_before_a_checkpoint_and_a_result(
    film: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, store: str
) -> None:
    folder = tmp_path / "run"
    monkeypatch.setattr("cosim.files.direct._LEAST", 1)
    save_often(monkeypatch)
    with watched(folder, at_barrier) as disk:
        film("step", folder, *SETS, store=store)
    names = [name for name in disk.named if at_barrier(name)]
    assert names[-1] == "result.json" and len(names) > 2
    left_out = "stream.zarr" if store == "none" else "nothing"
    assert [risk for risk in disk.unsafe["checkpoint.npz"] if "stream.zarr" in risk] == []
    assert [risk for risk in disk.unsafe["result.json"] if left_out not in risk] == []
    assert all(disk.synced_since.values())


def test_a_checkpoint_within_a_chunk_builds_on_all_of_it(
    film: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with watched(tmp_path / "run", at_barrier) as disk:
        interrupt(film, tmp_path / "run", 192, monkeypatch)
    assert disk.unsafe == {"checkpoint.npz": []} and all(disk.synced_since.values())


def lose(chunk: Path) -> None:
    chunk.unlink()


def flip(chunk: Path) -> None:
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)


@pytest.mark.parametrize("harm", [lose, flip])
def test_a_lost_or_damaged_recording_begins_again_to_the_same_bytes(
    film: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, untouched: dict[str, Any],
    harm: Callable[[Path], None],
) -> None:  # fmt: skip
    folder = tmp_path / "run"
    interrupt(film, folder, 128, monkeypatch)
    harm(folder / "stream.zarr/words/c/1/0/0")
    notes = QuietProgress()
    film("step", folder, *SETS, resume=True, progress=notes)
    (note,) = [note for note in notes.notes if "begins again" in note]
    assert note.startswith(f"{folder / 'stream.zarr'} must be as the run wrote it, not ")
    assert left_behind(folder) == untouched


@pytest.mark.parametrize("chunk", [0, 1, 2])
def test_a_lost_chunk_costs_the_cycles_since_the_checkpoint_before(
    film: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, untouched: dict[str, Any],
    chunk: int,
) -> None:  # fmt: skip
    """Checkpoints at cycles 128 and 192: only the last chunk is not a part of both."""
    folder = tmp_path / "run"
    with monkeypatch.context() as patched:
        save_often(patched)
        interrupt(film, folder, 128, patched)
    lose(folder / f"stream.zarr/words/c/{chunk}/0/0")
    notes, steps = QuietProgress(), []
    step = Recorder.step
    with monkeypatch.context() as patched:
        patched.setattr(
            Recorder, "step", lambda self, *a: steps.append(a[1].start) or step(self, *a)
        )
        film("step", folder, *SETS, resume=True, progress=notes)
    (note,) = [note for note in notes.notes if "must be as the run wrote it" in note]
    back = 128 if chunk == 2 else 0
    assert steps[0] == back
    end = "goes back to cycle 128, its checkpoint before" if back else "begins again"
    assert end in note
    assert left_behind(folder) == untouched
    assert not [*folder.glob("checkpoint*")]


def test_litter_of_killed_runs_goes(
    film: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, untouched: dict[str, Any]
) -> None:
    folder = tmp_path / "run"
    interrupt(film, folder, 64, monkeypatch)
    for name in (".report.html.1.part", ".checkpoint.npz.1.part", "images/.a.png.1.part",
                 "stream.zarr/words/c/1/0/0.12ab.partial"):  # fmt: skip
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(b"half")
    film("step", folder, *SETS, resume=True)
    assert left_behind(folder) == untouched
    assert not [*folder.rglob("*.part*"), *folder.glob("checkpoint*")]
