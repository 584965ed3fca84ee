"""The rows of a code of words: data over wall time on all cores, and over processor time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

from cosim.run.timing import Row, least_of

AIM: Final = 8e9
"""Data that the link should carry, bit/s."""


def code_rows(
    name: str, what: str, call: Callable[[], Any], bits: int, aim: float, turns: int,
    plain: tuple[Callable[[], Any], float] | None = None,
) -> list[Row]:  # fmt: skip
    """Rows of a call: over all cores, and per core, from processor time.

    Args:
        name, what: name of the rows, and their tier.
        call: what is timed.
        bits: data bits of a call.
        aim: bit/s that are real time.
        turns: timed calls.
        plain: the plain way, and the share of the call's bits that it takes; None without one.
    """
    calls = [call] if plain is None else [call, plain[0]]
    wall, *rest = least_of(calls, turns)
    begin = time.process_time()
    for _ in range(turns):
        call()
    each = (time.process_time() - begin) / turns
    ratio = None if plain is None else rest[0] / plain[1] / wall
    return [
        Row(name, what, bits / wall, "bit/s", bits / wall / aim, None, ratio),
        Row(name, f"{what}, a core", bits / each, "bit/s", bits / each / aim, None, None),
    ]
