"""The planner: which effects a scene needs for the tolerance asked, tile by tile.

Left out are those effects whose cost is the most, as long as the linear sum of their bounds stays
within half the tolerance in every tile (the other half is for what the bounds do not see); an
estimate counts twice. What costs nothing is kept. Effects of scope "plane" are kept or left out
everywhere; the others tile by tile. The search goes through the sets of the plane from those that
leave out the most, and skips a set that cannot be cheaper than the best so far.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Effect, Kind, Summary

__all__ = ["ESTIMATE_WEIGHT", "SHARE", "Plan", "Row", "make_plan"]

SHARE = 0.5
"""Of the tolerance that bounds of what is left out may take together."""
ESTIMATE_WEIGHT = 2.0
"""How often an estimate counts."""
Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """One effect in a plan.

    Attributes:
        effect: its name.
        kept: share of tiles that keep it, 0 to 1.
        bound: largest bound over the tiles that leave it out, or over all tiles if none does; an
            estimate counts twice.
        kind: of the bound.
        cost_ns: of keeping it in every tile, ns per pixel-cycle.
    """

    effect: str
    kept: float
    bound: float
    kind: Kind
    cost_ns: float


@dataclass(frozen=True, eq=False)
class Plan:
    """Which effects each tile keeps.

    Attributes:
        tolerance: that the plan was made for.
        rows: one for every effect.
        kept: tiles that keep an effect, (tiles,) bool by name.
        promise: bound on what leaving an effect out changes, (tiles,) by name.
        total: sum of the bounds of what is left out, (tiles,).
        cost_ns, full_ns: cost of a pixel-cycle as planned and with every effect, ns.
    """

    tolerance: float
    rows: tuple[Row, ...]
    kept: dict[str, npt.NDArray[np.bool_]]
    promise: dict[str, Values]
    total: Values
    cost_ns: float
    full_ns: float

    @property
    def everywhere(self) -> tuple[str, ...]:
        """Effects that some tile keeps."""
        return tuple(name for name, tiles in self.kept.items() if tiles.any())

    @property
    def left_out(self) -> tuple[str, ...]:
        """Effects that some tile leaves out."""
        return tuple(name for name, tiles in self.kept.items() if not tiles.all())

    @property
    def kind(self) -> Kind:
        """Of `total`: proof where every bound in it is one."""
        absent = self.left_out
        proven = all(row.kind == "proof" for row in self.rows if row.effect in absent)
        return "proof" if proven else "estimate"

    @property
    def sets(self) -> dict[tuple[str, ...], int]:
        """Every distinct set of effects with the number of tiles that keep it."""
        names = list(self.kept)
        rows, counts = np.unique(
            np.stack([self.kept[n] for n in names]), axis=1, return_counts=True
        )
        return {
            tuple(n for n, k in zip(names, column, strict=True) if k): int(count)
            for column, count in zip(rows.T, counts, strict=True)
        }


def _subsets(names: Sequence[int]) -> list[tuple[int, ...]]:
    return [c for n in range(len(names) + 1) for c in combinations(names, n)]


def _costs(effects: Sequence[Effect], scene: Summary, tiles: int) -> Values:
    """(effects, tiles) ns a pixel-cycle."""
    return np.stack([np.broadcast_to(np.asarray(e.cost(scene), float), tiles) for e in effects])


def _total(effects: Sequence[Effect], costs: Values, out: frozenset[int]) -> Values:
    """Cost of all but `out`, each group once."""
    groups: dict[str, Values] = {}
    for n, effect in enumerate(effects):
        if n not in out:
            key = effect.group or effect.name
            groups[key] = np.maximum(groups[key], costs[n]) if key in groups else costs[n]
    return sum(groups.values(), np.zeros(costs.shape[1]))


_TIE: Final = 1e-12
"""Relative difference of costs below which two plans are alike; that which keeps more is taken."""


class _Search:
    """The cheapest set of plane effects to leave out, with the cheapest of `local` in each tile.

    Branch and bound: each effect of the plane is left out first and kept second. What a branch may
    cost at the least is what is left when all that it has not decided is left out, whether or not
    it fits.
    """

    def __init__(
        self, effects: Sequence[Effect], costs: Values, promise: Values, room: float,
        plane: Sequence[int], local: Sequence[tuple[int, ...]],
    ) -> None:  # fmt: skip
        self._effects, self._costs, self._promise, self._room = effects, costs, promise, room
        self._local = local
        fitting = [n for n in plane if not (promise[n] > room).any()]
        # Those that save the most first; the order does not change what is found.
        self._plane = sorted(fitting, key=lambda n: (-float(costs[n].mean()), n))
        self._place = {n: k for k, n in enumerate(plane)}
        self._found: dict[tuple[int, ...], tuple[float, npt.NDArray[np.intp]]] = {}
        self._best = math.inf

    def best(self) -> tuple[float, tuple[int, ...], npt.NDArray[np.intp]]:
        """Cost, effects of the plane to leave out, and the number in `local` of each tile."""
        self._look(0, (), np.zeros(self._costs.shape[1]))
        low = min(total for total, _ in self._found.values())
        alike = [out for out, (total, _) in self._found.items() if total <= low * (1 + _TIE)]
        out = min(alike, key=lambda o: (len(o), [self._place[n] for n in o]))
        total, chosen = self._found[out]
        return total, out, chosen

    def _look(self, at: int, out: tuple[int, ...], spent: Values) -> None:
        rest = self._plane[at:]
        free = frozenset((*out, *rest, *(n for more in self._local for n in more)))
        if float(_total(self._effects, self._costs, free).mean()) > self._best * (1 + _TIE):
            return
        if not rest:
            total, chosen = self._tiles(out, spent)
            self._best = min(self._best, total)
            self._found[tuple(sorted(out, key=self._place.__getitem__))] = total, chosen
            return
        more = spent + self._promise[rest[0]]
        if not (more > self._room).any():
            self._look(at + 1, (*out, rest[0]), more)
        self._look(at + 1, out, spent)

    def _tiles(self, out: tuple[int, ...], spent: Values) -> tuple[float, npt.NDArray[np.intp]]:
        """Mean cost of the cheapest local set of each tile, and which it is: the first of equals,
        which keeps the most."""
        cost = np.full((len(self._local), spent.size), np.inf)
        for m, more in enumerate(self._local):
            fits = spent + self._promise[np.array(more, int)].sum(axis=0) <= self._room
            own = _total(self._effects, self._costs, frozenset(out + more))
            cost[m] = np.where(fits, own, np.inf) if more else own
        return float(cost.min(axis=0).mean()), cost.argmin(axis=0)


def make_plan(
    effects: Sequence[Effect],
    scene: Summary,
    tolerance: float,
    *,
    certain: npt.NDArray[np.bool_] | bool = True,
    base_ns: float = 0.0,
    own: float = 0.0,
    forced: Sequence[str] = (),
) -> Plan:
    """Plans a scene; its tiles are those of `scene`'s arrays.

    Args:
        effects: that may be left out.
        scene: summary of the scene.
        tolerance: relative error allowed.
        certain: (tiles,) whether the scene's intervals are proven; else every bound is an estimate.
        base_ns: cost of a pixel-cycle without effects, ns.
        own: relative error of the simulation itself, which takes its part of the tolerance.
        forced: names of effects to keep whatever their bound.
    """
    tiles = np.broadcast(scene.darkest, scene.brightest).size
    sure = np.broadcast_to(np.asarray(certain), tiles)
    costs = _costs(effects, scene, tiles)
    promise, kinds = np.zeros(costs.shape), []
    for n, effect in enumerate(effects):
        bound = effect.bound(scene)
        kinds.append(bound.kind)
        twice = ~sure if bound.kind == "proof" else np.ones(tiles, bool)
        value = np.broadcast_to(np.asarray(bound.value, float), tiles)
        promise[n] = np.where(twice, ESTIMATE_WEIGHT * value, value)
    room = SHARE * tolerance - own
    able = [
        n for n, e in enumerate(effects)
        if tolerance > 0 and e.name not in forced and costs[n].max() > 0
    ]  # fmt: skip
    plane = [n for n in able if effects[n].scope == "plane"]
    local = _subsets([n for n in able if effects[n].scope == "tile"])
    search = _Search(effects, costs, promise, room, plane, local)
    total_cost, out, chosen = search.best()
    kept = np.ones((len(effects), tiles), bool)
    kept[np.array(out, int)] = False
    for m, more in enumerate(local):
        for n in more:
            kept[n, chosen == m] = False
    rows = []
    for n, effect in enumerate(effects):
        gone = ~kept[n]
        at = gone if gone.any() else np.ones(tiles, bool)
        kind: Kind = "proof" if kinds[n] == "proof" and sure[at].all() else "estimate"
        largest = float(promise[n][at].max())
        rows.append(Row(effect.name, float(kept[n].mean()), largest, kind, float(costs[n].mean())))
    names = [e.name for e in effects]
    return Plan(
        tolerance,
        tuple(rows),
        dict(zip(names, kept, strict=True)),
        dict(zip(names, promise, strict=True)),
        np.where(kept, 0.0, promise).sum(axis=0),
        base_ns + total_cost,
        base_ns + float(_total(effects, costs, frozenset()).mean()),
    )
