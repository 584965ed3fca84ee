"""Bytes cross a link of light, for Python."""

from __future__ import annotations

import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cosim import InputError
from scenarios.python.finished import Run
from scenarios.python.running import run, source_file
from scenarios.python.words import in_python

__all__ = ["send"]


@in_python
def send(
    data: bytes | str | os.PathLike[str], *, out: str | os.PathLike[str] | None = None,
    tolerance: float | None = None, seed: int | None = None, device: str | None = None,
    resume: bool = False, progress: bool | None = None, **settings: Any,
) -> Run:  # fmt: skip
    """Sends bytes from a panel to a spike camera, as `viform run light-link` does.

    Args:
        data: the bytes, one or more, or the path of a file.
        out: folder to create, with bytes beside it in OUT.bin; runs/light-link-N if None.
        tolerance: allowed error, half-widths of the bit error rate's interval; that of the scenario
            if None.
        seed: of all random effects; that of the scenario if None.
        device: number or part of the name of an OpenCL device, or "numba".
        resume: whether the interrupted run in `out` goes on, with the same arguments; a complete
            one is returned.
        progress: whether progress is shown on standard error; None for on a terminal and in a
            notebook.
        **settings: keys of the scenario, such as **{"link.distance": "4 m"}.

    Returns:
        The run; `received` has what arrived.

    Raises:
        InputError: the input cannot be used.
    """
    with TemporaryDirectory(prefix="viform-") as folder:
        if isinstance(data, bytes):
            _check_bytes(len(data), "none")
            path = source_file(out, folder, ".bin", resume=resume)
            path.write_bytes(data)
        else:
            path = Path(data)
            if path.is_file():
                _check_bytes(path.stat().st_size, f"the empty file {path}")
        own = {"link.file": path}
        return run(
            "light-link", out=out, tolerance=tolerance, seed=seed, device=device,
            resume=resume, progress=progress, **(own | settings),
        )  # fmt: skip


def _check_bytes(size: int, given: str) -> None:
    """Raises InputError for nothing to send: the search for a mode and the lock of the clock, a
    minute or more, would have no use."""
    if size == 0:
        raise InputError("data", "one byte or more", given, "give bytes, or the path of a file")
