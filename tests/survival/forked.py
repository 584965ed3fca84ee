"""Commands of `viform` in processes of their own, without the time that imports take."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.survival.small_disk import NoMounts

_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(["tests.survival.warm"])


class Command:
    """A running command.

    Args:
        words: after `viform`.
        log: file that receives standard output and standard error.
        prepare: called in the process before the command; a function of a module.

    Attributes:
        seconds: duration up to the last `wait`.
    """

    def __init__(
        self, words: tuple[str, ...], log: Path, prepare: Callable[[], None] | None = None
    ) -> None:
        self._begun = time.monotonic()
        self.seconds = 0.0
        self._process = _CONTEXT.Process(target=_run, args=(words, log, prepare))
        self._process.start()

    def wait(self, seconds: float | None = None) -> int | None:
        """The exit code; None if the command still runs after that time."""
        self._process.join(seconds)
        self.seconds = time.monotonic() - self._begun
        return self._process.exitcode

    def kill(self) -> None:
        """Ends the process by SIGKILL, at whatever it is doing."""
        assert self._process.pid is not None
        os.kill(self._process.pid, signal.SIGKILL)
        self._process.join()


def _run(words: tuple[str, ...], log: Path, prepare: Callable[[], None] | None) -> None:
    with log.open("wb") as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
    assert "scenarios.run" in sys.modules, "the server has not imported tests.survival.warm whole"
    if prepare is not None:
        prepare()
    from scenarios.cli.entry import main

    sys.argv = ["viform", *words]
    main()


def call(function: Callable[[], Any], place: Path) -> Any:
    """Calls a function in a process of its own; returns its result by way of JSON.

    A test is skipped where the system permits no mounts.

    Args:
        function: of a module, or a partial of one.
        place: folder for its result.
    """
    out = place / "result.out"
    process = _CONTEXT.Process(target=_call, args=(function, out))
    process.start()
    process.join()
    assert out.exists(), f"{function} ended with {process.exitcode}"
    document = json.loads(out.read_text())
    out.unlink()
    if "refused" in document:
        pytest.skip(f"needs mounts: {document['refused']}")
    if "error" in document:
        raise AssertionError(document["error"])
    return document["value"]


def _call(function: Callable[[], Any], out: Path) -> None:
    try:
        document = {"value": function()}
    except NoMounts as exc:
        document = {"refused": str(exc)}
    except BaseException:
        document = {"error": traceback.format_exc()}
    out.write_text(json.dumps(document))


def copied(function: Callable[[], Any]) -> str:
    """What a function returns or raises, as text, in a copy of this process that `fork` makes.

    The copy is ended after a minute, and the text is then empty.
    """
    reader, writer = os.pipe()
    copy = os.fork()
    if copy == 0:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(60)
        try:
            text = str(function())
        except BaseException as exc:
            text = f"{type(exc).__name__}: {exc}"
        os.write(writer, text.encode())
        os._exit(0)
    os.close(writer)
    with open(reader, "rb") as file:
        text = file.read().decode()
    os.waitpid(copy, 0)
    return text
