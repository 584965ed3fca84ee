"""The planner: selects the effects that a scene needs for a tolerance, tile by tile.

It minimises the cost, while the sum of the bounds of all effects that are left out stays within
half the tolerance in every tile. The other half is a reserve for errors that the bounds do not
cover. An estimate counts twice. Effects without cost are kept. Effects of scope "plane" are kept or
left out on the whole plane, and the others tile by tile. The search starts with the sets that leave
out the most, and skips sets that cannot be cheaper than the best so far.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Effect, Kind, Summary

SHARE = 0.5
"""Share of the tolerance for the bounds of all effects that are left out."""
RANDOM: Final = 4
"""Number of tiles that are chosen at random to check a plan."""
ESTIMATE_WEIGHT = 2.0
"""Weight of an estimate."""
Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class EffectRow:
    """One effect in a plan.

    Attributes:
        effect: name of the effect.
        bound: largest bound over the tiles that leave it out, or over all tiles if none does;
            estimates are doubled.
        kind: kind of the bound.
        kept: share of tiles that keep it, 0 to 1.
        cost_ns: cost of keeping it in every tile, ns per pixel-cycle.
    """

    effect: str
    bound: float
    kind: Kind
    kept: float = 0.0
    cost_ns: float = 0.0


def left_out_rows(
    rows: Iterable[EffectRow], measured: Mapping[str, float | None]
) -> list[dict[str, Any]]:
    """Rows of `result.json`, one for each effect that is left out.

    Args:
        rows: rows of these effects, such as `Plan.absent`.
        measured: error without an effect, by name, where it was measured.
    """
    return [
        {
            "effect": row.effect, "bound": row.bound, "kind": row.kind,
            "measured": measured.get(row.effect),
        }
        for row in rows
    ]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Plan:
    """Which effects each tile keeps.

    Attributes:
        tolerance: tolerance of the plan.
        rows: one row for every effect.
        kept: whether a tile keeps an effect, (tiles,) bool by name.
        promise: bound of the error without an effect, (tiles,) by name.
        total: (tiles,) sum of the bounds of all effects that are left out.
        cost_ns, full_ns: cost with the planned effects and with all effects, ns per pixel-cycle.
    """

    tolerance: float
    rows: tuple[EffectRow, ...]
    kept: dict[str, npt.NDArray[np.bool_]]
    promise: dict[str, Values]
    total: Values
    cost_ns: float
    full_ns: float

    @property
    def everywhere(self) -> tuple[str, ...]:
        """Effects that at least one tile keeps."""
        return tuple(name for name, tiles in self.kept.items() if tiles.any())

    @property
    def left_out(self) -> tuple[str, ...]:
        """Effects that at least one tile leaves out."""
        return tuple(name for name, tiles in self.kept.items() if not tiles.all())

    @property
    def absent(self) -> list[EffectRow]:
        """Rows of the effects that at least one tile leaves out."""
        absent = self.left_out
        return [row for row in self.rows if row.effect in absent]

    @property
    def kind(self) -> Kind:
        """Kind of `total`: a proof if all its bounds are proofs."""
        return "proof" if all(row.kind == "proof" for row in self.absent) else "estimate"

    def keeping(self, names: Collection[str]) -> Plan:
        """The plan with these effects kept everywhere, and no others anew. Its costs are those of
        this plan."""
        kept = {name: tiles | (name in names) for name, tiles in self.kept.items()}
        gone = [np.where(kept[name], 0.0, bound) for name, bound in self.promise.items()]
        rows = tuple(
            replace(row, kept=1.0, bound=float(self.promise[row.effect].max()))
            if row.effect in names else row
            for row in self.rows
        )  # fmt: skip
        return replace(self, rows=rows, kept=kept, total=np.sum(gone, axis=0))

    @property
    def sets(self) -> dict[tuple[str, ...], int]:
        """All distinct sets of effects, with the number of tiles that keep each."""
        names = list(self.kept)
        rows, counts = np.unique(
            np.stack([self.kept[n] for n in names]), axis=1, return_counts=True
        )
        return {
            tuple(n for n, k in zip(names, column, strict=True) if k): int(count)
            for column, count in zip(rows.T, counts, strict=True)
        }


def choose_tiles(
    plan: Plan, figures: Sequence[Values], among: npt.NDArray[np.intp], seed: int, each: int = 1
) -> list[int]:
    """Numbers of tiles that tell most about a plan, the most informative first.

    Args:
        plan: the plan.
        figures: (tiles,) values; the tile with the largest of each is chosen.
        among: (n,) numbers of the tiles to choose from.
        seed: seed of the RANDOM tiles that are chosen at random.
        each: number of tiles for every effect left out, where its bound is largest.
    """
    order = [int(np.argmax(values[among])) for values in figures]
    for name in plan.left_out:
        promised = np.where(plan.kept[name], -1.0, plan.promise[name])[among]
        order += np.argsort(-promised, kind="stable")[:each].tolist()
    order += np.random.default_rng(seed).permutation(len(among))[:RANDOM].tolist()
    return list(dict.fromkeys(int(among[n]) for n in order))


def _subsets(names: Sequence[int]) -> list[tuple[int, ...]]:
    """All subsets, the smallest first."""
    return [c for n in range(len(names) + 1) for c in combinations(names, n)]


def _costs(effects: Sequence[Effect], scene: Summary, tiles: int) -> Values:
    """Cost of each effect, (effects, tiles) ns per pixel-cycle."""
    return np.stack([np.broadcast_to(np.asarray(e.cost(scene), float), tiles) for e in effects])


def _total(effects: Sequence[Effect], costs: Values, out: frozenset[int]) -> Values:
    """Cost of all effects except `out`, (tiles,); each group counts once."""
    groups: dict[str, Values] = {}
    for n, effect in enumerate(effects):
        if n not in out:
            key = effect.group or effect.name
            groups[key] = np.maximum(groups[key], costs[n]) if key in groups else costs[n]
    return sum(groups.values(), np.zeros(costs.shape[1]))


_TIE: Final = 1e-12
"""Relative difference below which costs count as equal. Of equal plans, the one that keeps more is
selected."""


class _Search:
    """Search for the cheapest set of plane effects to leave out, with the cheapest of `local` in
    each tile.

    Branch and bound: each plane effect is first left out and then kept. The lower bound of a branch
    is its cost if all undecided effects are left out, whether or not their bounds allow it.
    """

    def __init__(
        self, effects: Sequence[Effect], costs: Values, promise: Values, room: Values | float,
        plane: Sequence[int], local: Sequence[tuple[int, ...]],
    ) -> None:  # fmt: skip
        self._effects, self._costs, self._promise, self._room = effects, costs, promise, room
        self._local = local
        fitting = [n for n in plane if not (promise[n] > room).any()]
        # Effects that save the most come first. The order does not change the result.
        self._plane = sorted(fitting, key=lambda n: (-float(costs[n].mean()), n))
        self._place = {n: k for k, n in enumerate(plane)}
        self._leaves: dict[tuple[int, ...], tuple[float, npt.NDArray[np.intp]]] = {}
        self._best = math.inf

    def best(self) -> tuple[float, tuple[int, ...], npt.NDArray[np.intp]]:
        """Cost, plane effects to leave out, and the index in `local` of each tile, (tiles,)."""
        self._branch(0, (), np.zeros(self._costs.shape[1]))
        low = min(total for total, _ in self._leaves.values())
        alike = [out for out, (total, _) in self._leaves.items() if total <= low * (1 + _TIE)]
        out = min(alike, key=lambda o: (len(o), [self._place[n] for n in o]))
        total, chosen = self._leaves[out]
        return total, out, chosen

    def _branch(self, at: int, out: tuple[int, ...], spent: Values) -> None:
        """Searches a branch, in which plane effects before `at` are decided.

        Args:
            at: index of the first undecided effect.
            out: effects that are left out.
            spent: (tiles,) sum of their bounds.
        """
        rest = self._plane[at:]
        free = frozenset((*out, *rest, *(n for more in self._local for n in more)))
        if float(_total(self._effects, self._costs, free).mean()) > self._best * (1 + _TIE):
            return
        if not rest:
            total, chosen = self._tiles(out, spent)
            self._best = min(self._best, total)
            self._leaves[tuple(sorted(out, key=self._place.__getitem__))] = total, chosen
            return
        more = spent + self._promise[rest[0]]
        if not (more > self._room).any():
            self._branch(at + 1, (*out, rest[0]), more)
        self._branch(at + 1, out, spent)

    def _moot(self, effect: int, more: tuple[int, ...]) -> bool:
        """Whether leaving out an effect changes nothing beside the others of a local set."""
        return any(self._effects[n].name == self._effects[effect].moot for n in more)

    def _tiles(self, out: tuple[int, ...], spent: Values) -> tuple[float, npt.NDArray[np.intp]]:
        """Mean cost of the cheapest local set of each tile, and its index, (tiles,). Of equal
        costs, the first is selected, which keeps the most."""
        cost = np.full((len(self._local), spent.size), np.inf)
        for m, more in enumerate(self._local):
            counted = [n for n in more if not self._moot(n, more)]
            fits = spent + self._promise[np.array(counted, int)].sum(axis=0) <= self._room
            total = _total(self._effects, self._costs, frozenset(out + more))
            cost[m] = np.where(fits, total, np.inf) if more else total
        return float(cost.min(axis=0).mean()), cost.argmin(axis=0)


def make_plan(
    effects: Sequence[Effect],
    scene: Summary,
    tolerance: float,
    *,
    certain: npt.NDArray[np.bool_] | bool = True,
    base_ns: float = 0.0,
    tier_error: Values | float = 0.0,
    forced: Sequence[str] = (),
    exempt: Mapping[str, npt.NDArray[np.bool_]] | None = None,
) -> Plan:
    """Plans a scene. The tiles are those of the arrays of `scene`.

    Args:
        effects: effects that may be left out.
        scene: summary of the scene.
        tolerance: allowed relative error.
        certain: (tiles,) whether the ranges of the scene are proven. Elsewhere all bounds count as
            estimates.
        base_ns: cost without effects, ns per pixel-cycle.
        tier_error: relative error of the tier's arithmetic, which uses a part of the tolerance; a
            number, or one a tile.
        forced: names of effects to keep in any case.
        exempt: (tiles,) tiles that have an effect whatever the plan, by the name of the effect.
    """
    tiles, exempt = np.broadcast(scene.darkest, scene.brightest).size, exempt or {}
    sure = np.broadcast_to(np.asarray(certain), tiles)
    costs = _costs(effects, scene, tiles)
    promise, kinds = np.zeros(costs.shape), []
    for n, effect in enumerate(effects):
        bound = effect.bound(scene)
        kinds.append(bound.kind)
        twice = ~sure if bound.kind == "proof" else np.ones(tiles, bool)
        value = np.broadcast_to(np.asarray(bound.value, float), tiles)
        promise[n] = np.where(twice, ESTIMATE_WEIGHT * value, value)
    bounds = promise.copy()
    for n, effect in enumerate(effects):
        if effect.name in exempt:
            promise[n, exempt[effect.name]] = 0.0
    room = SHARE * tolerance - tier_error
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
    names = [e.name for e in effects]
    for n, effect in enumerate(effects):
        if effect.name in exempt:
            kept[n, exempt[effect.name]] = True
        if effect.moot in names:
            idle = ~kept[n] & ~kept[names.index(effect.moot)]
            bounds[n, idle] = promise[n, idle] = 0.0
    rows = []
    for n, effect in enumerate(effects):
        gone = ~kept[n]
        at = gone if gone.any() else np.ones(tiles, bool)
        kind: Kind = "proof" if kinds[n] == "proof" and sure[at].all() else "estimate"
        largest = float(bounds[n][at].max())
        rows.append(
            EffectRow(effect.name, largest, kind, float(kept[n].mean()), float(costs[n].mean()))
        )
    return Plan(
        tolerance,
        tuple(rows),
        dict(zip(names, kept, strict=True)),
        dict(zip(names, promise, strict=True)),
        np.where(kept, 0.0, promise).sum(axis=0),
        base_ns + total_cost,
        base_ns + float(_total(effects, costs, frozenset()).mean()),
    )
