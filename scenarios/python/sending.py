"""Bytes cross a link of light, for Python."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, overload

from cosim import InputError
from link.core import Crossed
from link.setting import read_payload
from scenarios.python.finished import Run
from scenarios.python.link import Link
from scenarios.python.running import joined, refuse_of_run, run, source_file
from scenarios.python.words import in_python


@overload
def send(
    data: bytes | str | os.PathLike[str], *, out: None = None, tolerance: float | None = None,
    seed: int | None = None, device: str | None = None, resume: bool = False,
    report: str = "page", progress: bool | None = None, **settings: Any,
) -> Crossed: ...  # fmt: skip
@overload
def send(
    data: bytes | str | os.PathLike[str], *, out: str | os.PathLike[str],
    tolerance: float | None = None, seed: int | None = None, device: str | None = None,
    resume: bool = False, report: str = "page",
    progress: bool | None = None, **settings: Any,
) -> Run: ...  # fmt: skip
@in_python
def send(
    data: bytes | str | os.PathLike[str], *, out: str | os.PathLike[str] | None = None,
    tolerance: float | None = None, seed: int | None = None, device: str | None = None,
    resume: bool = False, report: str = "page",
    progress: bool | None = None, **settings: Any,
) -> Crossed | Run:  # fmt: skip
    """Sends bytes from a panel to a spike camera, as `viform run light-link` does. Without `out`
    they stay in memory, see `Link`.

    Args:
        data: the bytes, one or more, or the path of a file.
        out: folder to create, with bytes beside it in OUT.bin; nothing is written if None.
        tolerance: allowed error, half-widths of the bit error rate's interval; that of the scenario
            if None.
        seed: seed of all random effects; that of the scenario if None.
        device: number or part of the name of an OpenCL device, or "numba".
        resume: whether the interrupted run in `out` goes on, with the same arguments; a complete
            one is returned.
        report: what the run in `out` makes: page, or none for the result and the streams alone.
        progress: whether progress is shown on standard error; None for on a terminal and in a
            notebook. Without `out`, none is shown.
        **settings: keys of the scenario, such as **{"link.distance": "4 m"}; without `out` those of
            [link] and [sensor].

    Returns:
        What arrived, as of `Link.send`; with `out` the run, whose `received` has it by name.

    Raises:
        InputError: the input cannot be used.
    """
    if out is None:
        refuse_of_run(resume, report)
        payload = data if isinstance(data, bytes) else read_payload(Path(data)).data
        _check_bytes(len(payload), "none")
        with Link.of(settings, len(payload), tolerance, seed, device) as link:
            return link.send(payload)
    given = joined({"link.file": None}, settings)
    if isinstance(data, bytes):
        _check_bytes(len(data), "none")
        path = source_file(out, "", ".bin", resume=resume)
        path.write_bytes(data)
    else:
        path = Path(data)
        if path.is_file():
            _check_bytes(path.stat().st_size, f"the empty file {path}")
    given["link.file"] = path
    return run(
        "light-link", out=out, tolerance=tolerance, seed=seed, device=device, resume=resume,
        report=report, progress=progress, **given,
    )  # fmt: skip


def _check_bytes(size: int, given: str) -> None:
    """Raises InputError for nothing to send: the search for a mode and the lock of the clock, a
    minute or more, would have no use."""
    if size == 0:
        raise InputError("data", "one byte or more", given, "give bytes, or the path of a file")
