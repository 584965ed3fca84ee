"""Runs of every kind under a limit of the address space: done, or one line that says what is
needed, before anything is written. Workers without shared memory."""

from __future__ import annotations

import resource
from functools import partial
from pathlib import Path

import pytest

from tests.survival.commands import RUNS
from tests.survival.forked import Command, call
from tests.survival.small_disk import mount_private, resize

GIB = 1 << 30
SHARED = Path("/dev/shm")
LIMITS = (0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 3.0)
"""Limits behind the marker, GiB."""


def limit(gib: float) -> None:
    most = int(gib * GIB)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def outcome(kind: str, gib: float, place: Path) -> tuple[int | None, list[str]]:
    """Exit code and lines of a run."""
    words = ("run", *RUNS[kind], "--out", str(place / "run"))
    code = Command(words, place / "log", partial(limit, gib)).wait()
    return code, (place / "log").read_text().splitlines()


def check(kind: str, gib: float, place: Path) -> None:
    code, lines = outcome(kind, gib, place)
    assert code in (0, 2), lines
    assert not any("Traceback" in line or "OpenCL device" in line for line in lines), lines
    if code == 2:
        assert "memory" in lines[-1] or "address space" in lines[-1], lines
        assert all(line.startswith("viform: ") for line in lines), lines
        assert not (place / "run" / "result.json").exists()


@pytest.mark.parametrize("kind", ["latched", "emccd"])
def test_too_little_is_said_before_the_run(kind: str, tmp_path: Path) -> None:
    code, lines = outcome(kind, 1.0, tmp_path)
    (line,) = lines
    assert code == 2 and line.startswith(
        "viform: the limit of the address space (ulimit -v) must be "
    )
    assert line.endswith("or close other programs") and not (tmp_path / "run").exists()


def without_shared_memory() -> list[object]:
    """Results of two workers."""
    from cosim.run.workers import workers_for

    mount_private(SHARED, 4096)
    resize(SHARED, 4096, read_only=True)
    with pytest.raises(OSError):
        (SHARED / "file").touch()
    with workers_for(2, None) as pool:
        return sorted(pool.run(abs, {0: (-3,), 1: (-4,)}))


def test_workers_need_no_shared_memory(tmp_path: Path) -> None:
    """/dev/shm holds the semaphores of `multiprocessing`, and cannot be written in some
    containers."""
    assert call(without_shared_memory, tmp_path) == [[0, 3], [1, 4]]


@pytest.mark.slow
@pytest.mark.parametrize("kind", RUNS)
@pytest.mark.parametrize("gib", LIMITS)
def test_any_limit(kind: str, gib: float, tmp_path: Path) -> None:
    check(kind, gib, tmp_path)
