"""A physical effect: what it is, where it comes from, what leaving it out can change.

Every effect is one small file that makes one `Effect`. The kernel is compiled from the fragments
of the effects that are kept and from nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from cosim.streams import Stream

__all__ = ["Bound", "Effect", "Summary"]


@dataclass(frozen=True)
class Summary:
    """What bounds read of a scene, known before anything is simulated.

    darkest, brightest: photoelectrons a cycle. threshold: electrons. window: cycles over which a
    rate is taken. cycles: duration.
    """

    darkest: float
    brightest: float
    threshold: float
    window: int
    cycles: int


@dataclass(frozen=True)
class Bound:
    """How far leaving an effect out can move a pixel's spike rate, relative to that rate (RMS).

    kind: "proof" holds always; "estimate" is the right size, not a limit.
    """

    value: float
    kind: Literal["proof", "estimate"]


@dataclass(frozen=True)
class Effect:
    """name: as reports print it. source: of its equation. stream: of its draws.
    define: macro that turns it on in a kernel. fragment: its OpenCL source.
    """

    name: str
    source: str
    stream: Stream
    define: str
    fragment: Callable[[], str]
    bound: Callable[[Summary], Bound]
