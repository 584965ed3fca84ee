"""The planner: which effects a scene needs for the tolerance asked, tile by tile.

Left out are those effects whose cost is the most, as long as the linear sum of their bounds stays
within half the tolerance in every tile (the other half is for what the bounds do not see); an
estimate counts twice. What costs nothing is kept. Effects of scope "plane" are kept or left out
everywhere; the others tile by tile. There are few effects, so every set is tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from cosim.effects import Effect, Kind, Summary

__all__ = ["ESTIMATE_WEIGHT", "SHARE", "Plan", "Row", "make_plan"]

SHARE = 0.5
"""Of the tolerance that bounds of what is left out may take together."""
ESTIMATE_WEIGHT = 2.0
"""How often an estimate counts."""
Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """One effect in a plan. kept: share of tiles that keep it, 0 to 1. bound: largest promise over
    the tiles that leave it out, or, where all keep it, over all; an estimate's is twice its size.
    kind: of the bound. cost_ns: of keeping it everywhere, ns a pixel-cycle."""

    effect: str
    kept: float
    bound: float
    kind: Kind
    cost_ns: float


@dataclass(frozen=True, eq=False)
class Plan:
    """tolerance: asked. rows: every effect. kept: names of effects, (tiles,) bool each. promise:
    names, (tiles,) what leaving the effect out may change. total: (tiles,) sum over what is left
    out. cost_ns, full_ns: of a pixel-cycle as planned, and with everything."""

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
    """Plans a scene of so many tiles as `scene`'s arrays are long.

    certain: (tiles,) whether the scene's intervals are proven; else every bound is an estimate.
    base_ns: what a pixel-cycle costs without effects. own: relative error that the simulation makes
    by itself, which takes its part of the tolerance. forced: names of effects to keep whatever
    their bound.
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
    every = np.ones(tiles, bool)
    best: tuple[float, tuple[int, ...], npt.NDArray[np.intp]] | None = None
    for out in _subsets(plane):  # fewer left out first: a tie keeps more
        spent = promise[np.array(out, int)].sum(axis=0)
        if out and (spent > room).any():
            continue
        cost = np.full((len(local), tiles), np.inf)
        for m, more in enumerate(local):
            fits = spent + promise[np.array(more, int)].sum(axis=0) <= room if more else every
            cost[m] = np.where(fits, _total(effects, costs, frozenset(out + more)), np.inf)
        chosen = cost.argmin(axis=0)
        total = float(cost.min(axis=0).mean())
        if best is None or total < best[0] * (1 - 1e-12):
            best = (total, out, chosen)
    assert best is not None  # nothing left out is always a plan
    total_cost, out, chosen = best
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
