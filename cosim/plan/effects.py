"""A physical effect: what it is, where from, what it costs, what leaving it out can change.

The planner (cosim/plan/planner.py) reads cost and bound of each `Effect` over a scene's `Summary`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream

__all__ = ["Bound", "Effect", "Kind", "Summary", "free"]

Values = npt.NDArray[np.float64]
"""One number a tile, (tiles,) float64; a plain float serves for one tile or for all."""
Kind = Literal["proof", "estimate"]


@dataclass(frozen=True)
class Summary:
    """What bounds read of a scene, known before anything is simulated.

    Intervals hold over a tile of pixels and over the whole run. Values are numbers, or arrays of
    one a tile.

    Attributes:
        darkest, brightest: photoelectrons a cycle, the least and the most that any pixel gets in
            any cycle.
        threshold: electrons.
        window: cycles over which a rate is taken.
        cycles: duration.
        floor: spikes a cycle below which an error counts as if the rate were this.
        spread: standard deviation of an interval's threshold over the threshold, with every noise
            of the setting.
        planes: new planes of light a cycle, 0 where the light never changes.
        slack: factor that all effects together may take off a pixel's light.
        dead: cycles of light that each spike costs.
    """

    darkest: Any
    brightest: Any
    threshold: float
    window: int
    cycles: int
    floor: float = 0.0
    spread: float = 0.0
    planes: Any = 1.0
    slack: float = 1.25
    dead: float = 0.0

    @property
    def base(self) -> Values:
        """Electrons a cycle that errors are relative to, the least in the tile."""
        return np.maximum(self.darkest, self.floor * self.threshold)

    def relative(self, electrons: Any) -> Values:
        """Electrons a cycle as a share of `base`; nothing is no share of anything."""
        amount, base = np.broadcast_arrays(np.asarray(electrons, np.float64), self.base)
        out = np.full(amount.shape, np.inf)
        np.divide(amount, base, out=out, where=base > 0)
        return np.where(amount > 0, out, 0.0)


@dataclass(frozen=True)
class Bound:
    """How far leaving an effect out can move the spike rate of a tile's pixels, RMS.

    Attributes:
        value: relative to that rate; a number, or one a tile.
        kind: "proof" holds always; "estimate" is the right size, not a limit, and counts twice.
    """

    value: Any
    kind: Kind


def free(scene: Summary) -> float:
    """Cost of an effect that takes no time of its own: it is never left out."""
    return 0.0


@dataclass(frozen=True)
class Effect:
    """A physical effect of one machine, as the planner reads it.

    Attributes:
        name: as reports print it.
        source: of its equation.
        stream: of its random draws.
        bound: of leaving it out.
        cost: of keeping it, ns per pixel-cycle, by the table of `costs.py` of its part. Nothing is
            saved by leaving out an effect that costs nothing.
        scope: "tile" where each tile may keep it or not, "plane" where the whole plane does.
        group: effects of one group share their cost: it is paid once.
    """

    name: str
    source: str
    stream: Stream
    bound: Callable[[Summary], Bound]
    cost: Callable[[Summary], Any] = field(default=free)
    scope: Literal["tile", "plane"] = "plane"
    group: str = ""
