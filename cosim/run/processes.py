"""Worker processes of this machine.

A worker speaks with this process through a pair of connected sockets without a name. Nothing
listens, so that no other program can give it a task: a task is a pickle, which may run any code.
When this process ends, however that comes, the pair is closed, and the worker ends.

The start of a worker does not run the user's script again, so that the script needs no main guard.
"""

from __future__ import annotations

import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from queue import SimpleQueue
from shutil import rmtree
from tempfile import TemporaryDirectory
from typing import Any, Final

from cosim.compute.cache_folder import cache_folder, prepare_caches
from cosim.compute.forks import python_child
from cosim.errors import InputError, ViformError

RETRIES: Final = 3
"""Times that a task is run again after a worker was lost."""
_START: Final = (
    "import viform; from cosim.run.processes import _serve; _serve(int(sys.argv[1]), sys.argv[2])"
)
"""Program of a worker. Its arguments: its end of the pair, and the folder of temporary files. It
imports viform first, as a user's program does."""
_ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
"""Environment of a worker, unless the user has set it: the workers share the cores."""


class _Lost(Exception):
    """A worker has ended. The text says how."""


class _Worker:
    """A worker, seen from this process. Raises OSError if it cannot be started.

    Args:
        folder: folder of temporary files.

    Attributes:
        pair: this end of the pair.
        key: key of its task, None without one.
    """

    def __init__(self, folder: str, cache: str) -> None:
        self.key: int | None = None
        self._ready = False
        ours, theirs = socket.socketpair()
        with theirs:
            self.pair = Connection(ours.detach())
            # A process group of its own: Ctrl-C on a terminal is for this process alone.
            self._process = subprocess.Popen(
                python_child(_START, str(theirs.fileno()), folder),
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, process_group=0,
                pass_fds=[theirs.fileno()],
                env=_ONE_THREAD | os.environ | {"TMPDIR": folder, "VIFORM_CACHE": cache},
            )  # fmt: skip

    def begin(self, key: int, task: tuple[Any, ...]) -> None:
        """Gives it a task: a function and its arguments. Its loss is raised by `result`."""
        self.key = key
        with suppress(ConnectionError):
            self.pair.send(task)

    def result(self) -> list[Any]:
        """What it says, when `pair` can be read: [the result of its task], or nothing as it has
        started. Raises _Lost, or what the task has raised."""
        try:
            done, value = self.pair.recv()
        except (EOFError, OSError):  # OSError: within a message
            code = self._process.wait()
            if not self._ready and code >= 0:
                raise InputError(
                    "--workers", "given where Python can start processes",
                    f"with {sys.executable}, which ended with exit code {code}",
                    "leave it out",
                ) from None  # fmt: skip
            told = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            raise _Lost(told) from None
        if not self._ready:
            self._ready = True
            return []
        self.key = None
        if not done:
            raise value
        return [value]

    def end(self) -> None:
        """Ends it and the processes that it has started."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self.pair.close()


class Processes:
    """Worker processes, within its context. See `Workers`.

    Args:
        count: processes, at most: no more are started than there are tasks.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._workers: list[_Worker] = []

    def __enter__(self) -> Processes:
        # The caches of compiled kernels are not temporary files, whose folder the workers replace.
        self._cache = str(cache_folder())
        self._folder = TemporaryDirectory(prefix="viform-workers-", ignore_cleanup_errors=True)
        return self

    def __exit__(self, *error: object) -> None:
        try:
            while self._workers:
                self._workers.pop().end()
        finally:
            self._folder.cleanup()

    def run(
        self, function: Callable[..., Any], tasks: Mapping[int, tuple[Any, ...]]
    ) -> Iterator[tuple[int, Any]]:
        """See `Workers`. Raises InputError if a task has lost its worker too often, or if none can
        be started."""
        left = deque(tasks)
        lost: Counter[int] = Counter()
        for _ in range(min(self.count, len(left)) - len(self._workers)):
            self._start()
        try:
            while left or any(worker.key is not None for worker in self._workers):
                for worker in self._workers:
                    if worker.key is None and left:
                        begun = left.popleft()
                        worker.begin(begun, (function, tasks[begun]))
                busy = {worker.pair: worker for worker in self._workers if worker.key is not None}
                for pair in wait(list(busy)):
                    worker = busy[pair]  # type: ignore[index]
                    key = worker.key
                    assert key is not None
                    try:
                        found = worker.result()
                    except _Lost as exc:
                        lost[key] += 1
                        if lost[key] > RETRIES:
                            raise self._too_often(lost[key], exc) from None
                        self._replace(worker)
                        left.appendleft(key)
                        continue
                    yield from ((key, value) for value in found)
        finally:  # also if the caller takes no more: nobody waits for what is running
            for worker in [each for each in self._workers if each.key is not None]:
                self._workers.remove(worker)
                worker.end()

    def _start(self) -> None:
        try:
            self._workers.append(_Worker(self._folder.name, self._cache))
        except OSError as exc:
            raise InputError(
                "--workers", "no more than the processes that this machine can start",
                f"{self.count} ({exc.strerror} at number {len(self._workers) + 1})",
                "give fewer, or leave it out",
            ) from exc  # fmt: skip

    def _replace(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.end()
        self._start()

    def _too_often(self, times: int, how: _Lost) -> InputError:
        return InputError(
            "--workers", "few enough for the memory of this machine",
            f"{self.count}, of which {times} ended ({how}) with the same task",
            "give fewer, or make the input smaller",
        )  # fmt: skip


def _serve(handle: int, folder: str) -> None:
    """Runs the tasks that come from the pair, until its other end is closed.

    Args:
        handle: descriptor of the pair.
        folder: folder of temporary files.
    """
    with suppress(OSError):
        prepare_caches()  # before numba is imported
    pair, tasks = Connection(handle), SimpleQueue[bytes]()

    def read() -> None:
        with suppress(EOFError, OSError):
            while True:
                tasks.put(pair.recv_bytes())
        rmtree(folder, ignore_errors=True)  # the other process may have been killed
        os.killpg(0, signal.SIGKILL)

    threading.Thread(target=read, daemon=True).start()
    pair.send((True, None))
    while True:
        task = tasks.get()
        try:
            function, given = pickle.loads(task)
            said = pickle.dumps((True, function(*given)), pickle.HIGHEST_PROTOCOL)
        except Exception as exc:
            said = pickle.dumps((False, _portable(exc)))
        with suppress(ConnectionError):  # `read` has seen it, and ends this process
            pair.send_bytes(said)


def _portable(error: Exception) -> Exception:
    """The error, or its traceback as text if it cannot be pickled."""
    text = "".join(traceback.format_exception(error))
    if not isinstance(error, ViformError):
        error.add_note(f"in a worker:\n{text}")
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(text)
    return error
