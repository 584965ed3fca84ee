"""The folder of a batch, in which a document states it and is written first, and its jobs, in this
process or on workers.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from cosim import InputError
from cosim.compute.pocl_files import keep_sums
from cosim.files.atomic import NO_ROOM, atomic_write
from cosim.run.folder import room_for
from cosim.run.result import dumps
from cosim.run.workers import workers_for

Job = tuple[int, tuple[Any, ...]]
Result = tuple[int, Any]


def begin_batch(what: str, folder: Path, stated: dict[str, Any], inner: str, resume: bool) -> bool:
    """Creates the folder, with WHAT.json and an empty folder for the results, or checks that it
    holds this batch.

    Args:
        what: kind of the batch, such as "sweep".
        folder: folder of the batch.
        stated: the batch as it was asked for.
        inner: name of the folder for the results.
        resume: whether the batch may be there.

    Returns:
        Whether it was there.

    Raises:
        InputError: the folder holds another batch or other files.
    """
    there = folder / f"{what}.json"
    if resume and there.exists():
        if read_document(there, what) != stated:
            raise InputError(
                "--resume", f"the {what} that {folder} holds", "another one",
                "give the same arguments, or another --out",
            )  # fmt: skip
        return True
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(
            "--resume", f"given with a {what}", f"{folder}, which is none", "change --out"
        )
    with room_for(f"the {what}", folder):
        (folder / inner).mkdir(parents=True, exist_ok=True)
        write_document(there, stated)
    return False


def write_document(path: Path, document: dict[str, Any]) -> None:
    """Writes a document as JSON; it appears whole or not at all."""
    with atomic_write(path) as part:
        part.write_text(dumps(document), encoding="utf-8")


def read_document(path: Path, what: str) -> Any:
    """A document of the batch. Raises InputError if it is damaged. what: kind of the batch."""
    try:
        return json.loads(path.read_bytes())
    except (OSError, ValueError) as exc:
        raise InputError(
            path.name, f"the file that the {what} wrote", f"a damaged file ({path})",
            "remove it (of one result, to make that again), and resume",
        ) from exc  # fmt: skip


def run_jobs(
    job: Callable[..., Any], jobs: Sequence[Job], workers: int, scheduler: str | None
) -> Iterator[Result]:
    """Yields (number, what `job` returned, or the InputError that it raised) of each job, in the
    order in which they end.

    Args:
        job: a function of a module.
        jobs: number and arguments of each job.
        workers, scheduler: see `workers_for`.

    Raises:
        InputError: the scheduler does not answer.
        OSError: the disk is full, which is no fault of one job.
    """
    with workers_for(workers, scheduler) as pool:
        yield from pool.run(_run, {number: (job, given) for number, given in jobs})


def _run(job: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    try:
        return job(*arguments)
    except InputError as exc:
        cause = exc.__cause__
        if isinstance(cause, OSError) and cause.errno in NO_ROOM:
            raise OSError(cause.errno, cause.strerror, cause.filename) from exc
        return exc
    finally:
        keep_sums()  # a worker is killed when its tasks are done
