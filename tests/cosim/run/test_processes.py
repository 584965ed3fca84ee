"""Worker processes of this machine: who can reach them, and what is left of those that are lost."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from cosim import InputError
from cosim.run.workers import workers_for

NAMES = ("errno", "os", "pathlib", "signal", "sys", "tempfile", "time")


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of temporary files, which is empty at the end."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    yield tmp_path
    assert [*tmp_path.iterdir()] == []


def task(text: str) -> tuple[str, dict[str, Any]]:
    """A task for `eval`: workers cannot import this file."""
    return f"[{', '.join(f'{name} := __import__({name!r})' for name in NAMES)}, {text}][-1]", {}


def sockets(process: psutil.Process) -> set[tuple[Any, ...]]:
    found = process.net_connections("all")
    return {(each.family, each.type, each.laddr, each.raddr) for each in found}


def test_nobody_else_can_reach_a_worker(place: Path) -> None:
    """A task is a pickle, which may run any code: no socket of a worker or of this process listens
    or has a name, and nobody else may enter the folder of temporary files."""
    here, before = psutil.Process(), sockets(psutil.Process())
    others = {child.pid for child in here.children()}
    sleep = task("tempfile.mkdtemp() and time.sleep(0.1)")
    with workers_for(2, None) as pool:
        for _ in pool.run(eval, dict.fromkeys(range(4), sleep)):
            workers = [child for child in here.children() if child.pid not in others]
            opened = [sockets(here) - before, *map(sockets, workers)]
            assert [each for found in opened for each in found if each[2] or each[3]] == []
            assert len(workers) == 2 and all(opened[1:])
            (folder,) = place.iterdir()
            assert folder.stat().st_mode & 0o777 == 0o700 and [*folder.iterdir()]
    assert not any(worker.is_running() for worker in workers)


def test_results_errors_and_losses(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lost worker costs no result, and what a task raises comes back; a pool that has raised, or
    of which the caller has taken enough, goes on with other tasks."""
    monkeypatch.setattr("cosim.run.processes.RETRIES", 1)
    mark = place / "lost"
    dies = "mark.exists() or (mark.touch(), os.kill(os.getpid(), signal.SIGKILL))"
    once = task(f"mark := pathlib.Path({str(mark)!r}), {dies}")
    full = task("(_ for _ in ()).throw(OSError(errno.ENOSPC, 'full'))")
    never, endless = task("sys.exit(3)"), task("time.sleep(600)")
    stranger = task(
        "(_ for _ in ()).throw(type('Stranger', (Exception,), {'__module__': 'here'})('who'))"
    )
    with workers_for(2, None) as pool:
        assert dict(pool.run(eval, {1: once, 2: task("2"), 3: task("bytes(1 << 24)")})) == {
            1: True, 2: 2, 3: bytes(1 << 24),
        }  # fmt: skip
        mark.unlink()
        with pytest.raises(OSError, match="full") as raised:
            dict(pool.run(eval, {1: full}))
        assert raised.value.errno == errno.ENOSPC
        assert "in a worker:\nTraceback" in raised.value.__notes__[0]
        with pytest.raises(RuntimeError, match=r"(?s)Traceback.*Stranger: who"):
            dict(pool.run(eval, {1: stranger}))
        assert next(iter(pool.run(eval, {1: endless, 2: task("4")}))) == (2, 4)
        with pytest.raises(
            InputError, match=r"of which 2 ended \(exit code 3\) with the same task"
        ):
            dict(pool.run(eval, {1: never}))


def test_workers_that_cannot_start_are_one_line(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    refusals = {
        "/bin/false": r"not with /bin/false, which ended with exit code 1",
        "/nowhere/python": r"not 2 \(No such file or directory at number 1\); give fewer",
    }
    for program, line in refusals.items():
        monkeypatch.setattr(sys, "executable", program)
        with pytest.raises(InputError, match=line), workers_for(2, None) as pool:
            dict(pool.run(eval, {1: task("1"), 2: task("2")}))


def test_workers_end_with_a_process_that_is_killed(place: Path) -> None:
    """Also while they work. The process is a script without a main guard."""
    script = place / "script.py"
    script.write_text(
        "import time\nfrom cosim.run.workers import workers_for\n"
        "tasks = dict.fromkeys(range(2), (\"__import__('os').getpid()\", {}))\n"
        "with workers_for(2, None) as pool:\n"
        "    for _, pid in pool.run(eval, tasks):\n"
        "        print(pid)\n"
        "    dict(pool.run(time.sleep, dict.fromkeys(range(2), (600,))))\n"
    )
    with subprocess.Popen(
        [sys.executable, "-u", script], stdout=subprocess.PIPE, text=True,
        env=os.environ | {"TMPDIR": str(place), "PYTHONPATH": os.pathsep.join(sys.path)},
    ) as process:  # fmt: skip
        assert process.stdout is not None
        workers = [psutil.Process(int(process.stdout.readline())) for _ in range(2)]
        process.send_signal(signal.SIGKILL)
        gone, left = psutil.wait_procs(workers, timeout=60)
    assert len({each.pid for each in gone}) >= 1 and left == []
    script.unlink()
