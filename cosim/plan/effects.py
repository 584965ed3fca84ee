"""A physical effect with its cost and its bound, in the form that the planner reads.

The planner (cosim/plan/planner.py) evaluates cost and bound of each `Effect` for the `Summary` of a
scene. The bound limits the error if the effect is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream

Values = npt.NDArray[np.float64]
"""One number a tile, (tiles,) float64; a float stands for one tile, or for all."""
Kind = Literal["proof", "estimate"]


@dataclass(frozen=True)
class Summary:
    """Properties of a scene that bounds depend on, known before anything is simulated.

    Ranges hold over a tile of pixels and over the whole run. Values are numbers, or arrays of one
    a tile.

    Attributes:
        darkest, brightest: least and most photoelectrons a cycle, of any pixel in any cycle.
        threshold: electrons.
        window: cycles over which a rate is taken.
        cycles: duration.
        floor: spikes a cycle. Errors of lower rates are relative to this rate.
        spread: relative standard deviation of an interval's threshold, from all noise sources.
        planes: new planes of light a cycle, 0 if the light is constant.
        slack: largest factor by which all effects together can reduce a pixel's light.
        dead: dead time of a spike, cycles.
        uneven: relative standard deviation of the gains of pixels.
        timing: RMS of the noise of the sampling instants, cycles.
        slope: limit of the change of light within a cycle, electrons a cycle; infinite if it is not
            known, as with jumps.
        moved: sum of all changes of light, electrons a cycle; infinite if it is not known.
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
    uneven: float = 0.0
    timing: Any = 0.0
    slope: Any = np.inf
    moved: Any = np.inf

    @property
    def base(self) -> Values:
        """Electrons a cycle to which errors are relative: the least in the tile, or the floor."""
        return np.maximum(self.darkest, self.floor * self.threshold)

    def relative(self, electrons: Any) -> Values:
        """Electrons a cycle over `base`, infinite for base 0; 0 electrons always give 0."""
        amount, base = np.broadcast_arrays(np.asarray(electrons, np.float64), self.base)
        out = np.full(amount.shape, np.inf)
        np.divide(amount, base, out=out, where=base > 0)
        return np.where(amount > 0, out, 0.0)


@dataclass(frozen=True)
class Bound:
    """Bound of the RMS error of the spike rates in a tile if an effect is left out.

    Attributes:
        value: relative to the rate; a number, or one a tile.
        kind: "proof" for a proven limit; "estimate" for an expected size, which counts twice.
    """

    value: Any
    kind: Kind


def free(scene: Summary) -> float:
    """Cost of an effect that takes no time. Such an effect is never left out."""
    return 0.0


@dataclass(frozen=True)
class Effect:
    """A physical effect of one machine, as the planner reads it.

    Attributes:
        name: name in reports.
        source: source of its equation.
        stream: random stream of its draws.
        bound: bound of the error if it is left out.
        cost: cost of keeping it, ns per pixel-cycle, from its table of costs.
        scope: "tile" if it is kept or left out tile by tile, "plane" if on the whole plane.
        group: effects of one group share their cost, which counts once.
        moot: name of an effect of scope "tile"; in a tile that leaves that one out, leaving this
            one out as well changes nothing.
    """

    name: str
    source: str
    stream: Stream
    bound: Callable[[Summary], Bound]
    cost: Callable[[Summary], Any] = field(default=free)
    scope: Literal["tile", "plane"] = "plane"
    group: str = ""
    moot: str = ""
