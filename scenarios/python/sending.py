"""Bytes cross a link of light, for Python."""

from __future__ import annotations

import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scenarios.python.finished import Run
from scenarios.python.running import run, source_file
from scenarios.python.words import in_python

__all__ = ["send"]


@in_python
def send(
    data: bytes | str | os.PathLike[str], *, out: str | os.PathLike[str] | None = None,
    tolerance: float | None = None, seed: int | None = None, device: str | None = None,
    **settings: Any,
) -> Run:  # fmt: skip
    """Sends bytes from a panel to a spike camera, as `viform run light-link` does.

    Args:
        data: the bytes, or the path of a file.
        out: folder to create, with bytes beside it in OUT.bin; runs/light-link-N if None.
        tolerance: allowed error, half-widths of the bit error rate's interval; that of the scenario
            if None.
        seed: of all random effects; that of the scenario if None.
        device: part of an OpenCL device's name, or "numba".
        **settings: keys of the scenario, such as **{"link.distance": "4 m"}.

    Returns:
        The run; `received` has what arrived.

    Raises:
        InputError: the input cannot be used.
    """
    with TemporaryDirectory(prefix="viform-") as folder:
        path = source_file(out, folder, ".bin") if isinstance(data, bytes) else Path(data)
        if isinstance(data, bytes):
            path.write_bytes(data)
        own = {"link.file": path}
        return run(
            "light-link", out=out, tolerance=tolerance, seed=seed, device=device,
            **(own | settings),
        )  # fmt: skip
