"""The planner: effects that a scene needs for a tolerance."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from cosim import Bound, Effect, Summary
from cosim.compute.streams import Stream
from cosim.plan.planner import ESTIMATE_WEIGHT, SHARE, choose_tiles, make_plan


def effect(name, bound, cost=1.0, kind="proof", scope="plane", group="", moot=""):
    """An effect whose bound and cost are these numbers, or one a tile."""
    return Effect(
        name, "a test", Stream.NONE, lambda scene: Bound(bound, kind),
        lambda scene: cost, scope, group, moot,
    )  # fmt: skip


def scene(tiles=1):
    return Summary(np.full(tiles, 1.0), np.full(tiles, 2.0), 100.0, 41, 400)


def plan(effects, tolerance, tiles=1, **more):
    return make_plan(effects, scene(tiles), tolerance, **more)


def test_the_linear_sum_of_bounds_stays_within_half_the_tolerance():
    """The plan is the cheapest of all sets whose bounds fit in half the tolerance."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        bounds = 10 ** rng.uniform(-4, -1, 6)
        costs = rng.uniform(0.1, 5, 6)
        effects = [effect(str(n), b, c) for n, (b, c) in enumerate(zip(bounds, costs, strict=True))]
        tolerance = float(10 ** rng.uniform(-3.5, -0.5))
        found = plan(effects, tolerance)
        sets = [s for k in range(7) for s in combinations(range(6), k)]
        fitting = [s for s in sets if sum(bounds[list(s)]) <= SHARE * tolerance]
        best = min(costs.sum() - costs[list(s)].sum() for s in fitting)
        assert found.cost_ns == pytest.approx(best, rel=1e-12)
        assert found.total.max() <= SHARE * tolerance
        out = [int(name) for name in found.left_out]
        assert found.total[0] == pytest.approx(bounds[out].sum(), rel=1e-12, abs=1e-300)
        assert found.full_ns == pytest.approx(costs.sum(), rel=1e-12)


@pytest.mark.parametrize(("kind", "least"), [("proof", 0.02), ("estimate", 0.04)])
def test_an_estimate_counts_twice(kind, least):
    one = [effect("a", 0.01, kind=kind)]
    assert plan(one, least).left_out == ("a",)
    assert plan(one, least * 0.999).left_out == ()
    row = plan(one, 1.0).rows[0]
    assert (row.kind, row.bound) == (kind, 0.01 * (ESTIMATE_WEIGHT if kind == "estimate" else 1))


def test_a_proof_over_an_uncertain_scene_is_an_estimate():
    one = [effect("a", 0.01, scope="tile")]
    found = plan(one, 0.03, 2, certain=np.array([True, False]))
    assert found.kept["a"].tolist() == [False, True]
    assert found.promise["a"].tolist() == [0.01, 0.02]
    assert found.rows[0].kind == "proof"
    assert plan(one, 1.0, 2, certain=False).rows[0].kind == "estimate"


def test_what_costs_nothing_is_kept_and_a_tie_keeps_more():
    assert plan([effect("a", 0.0, 0.0)], 1.0).left_out == ()
    # Two effects of one group: leaving out one alone saves nothing.
    pair = [effect("a", 1e-6, group="g"), effect("b", 1.0, group="g")]
    assert plan(pair, 0.01).left_out == ()
    assert plan(pair, 10.0).left_out == ("a", "b")


def test_a_group_is_paid_once_and_at_its_dearest():
    pair = [effect("a", 1.0, 2.0, group="g"), effect("b", 1.0, 5.0, group="g"), effect("c", 1, 3.0)]
    assert plan(pair, 0.0, base_ns=0.5).cost_ns == 8.5


def test_tolerance_0_keeps_everything_and_what_is_forced_stays():
    free = [effect("a", 0.0), effect("b", 0.0)]
    assert plan(free, 0.0).left_out == ()
    assert plan(free, 1e-9).left_out == ("a", "b")
    assert plan(free, 1.0, forced=["a"]).left_out == ("b",)


def test_tiles_decide_for_themselves_and_a_plane_goes_by_its_worst():
    bounds = np.array([0.001, 0.1, 0.001])
    both = [effect("tile", bounds, scope="tile"), effect("plane", bounds)]
    found = plan(both, 0.1, 3)
    assert found.kept["tile"].tolist() == [False, True, False]
    assert found.kept["plane"].all()
    assert found.sets == {("plane",): 2, ("tile", "plane"): 1}
    assert found.everywhere == ("tile", "plane") and found.left_out == ("tile",)
    assert [row.kept for row in found.rows] == [pytest.approx(1 / 3), 1.0]
    # The promise of a row is that of the tiles that leave the effect out.
    assert found.rows[0].bound == 0.001 and found.rows[1].bound == 0.1
    assert found.cost_ns == pytest.approx(4 / 3)


def test_the_tier_s_own_error_takes_its_part():
    one = [effect("a", 0.4)]
    assert plan(one, 1.0, tier_error=0.1).left_out == ("a",)
    assert plan(one, 1.0, tier_error=0.11).left_out == ()


def test_an_infinite_bound_is_never_left_out_and_darkness_changes_nothing():
    assert plan([effect("a", np.inf)], 1.0).left_out == ()
    dark = replace(scene(), darkest=np.zeros(1), brightest=np.zeros(1))
    assert dark.relative(0.0).tolist() == [0.0] and dark.relative(1.0).tolist() == [np.inf]
    floored = replace(dark, floor=0.01)
    assert floored.relative(1.0).tolist() == [1.0]  # a spike in 100 cycles of 100 electrons


def test_what_is_moot_without_another_effect_is_left_out_with_it_and_comes_back_with_it():
    noise = effect("noise", np.array([0.01, 0.3]), scope="tile")
    pair = [noise, effect("repeats", 0.2, 20.0, scope="tile", moot="noise")]
    found = plan(pair, 0.1, 2)
    # Alone, repeats would change too much; beside the noise they change nothing.
    assert found.kept["repeats"].tolist() == found.kept["noise"].tolist() == [False, True]
    assert found.total.tolist() == [0.01, 0.0] and found.promise["repeats"].tolist() == [0.0, 0.2]
    back = found.keeping({"noise", "repeats"})
    assert back.left_out == () and back.total.tolist() == [0.0, 0.0] and back.absent == []
    assert [(row.kept, row.bound) for row in back.rows] == [(1.0, 0.3), (1.0, 0.2)]


def test_tiles_to_check_tell_most():
    bounds = np.array([1e-3, 5e-3, 2e-3, 4e-3, 0.9, 0, 0, 0])
    found = plan([effect("a", bounds, scope="tile")], 0.1, 8)
    figure = np.arange(8.0)
    among = np.array([0, 1, 2, 3, 4, 5])
    tiles = choose_tiles(found, (figure, -figure), among, 1, each=2)
    assert tiles[:4] == [5, 0, 1, 3] and set(tiles) <= set(among.tolist())
    assert len(tiles) == len(set(tiles)) and tiles == choose_tiles(
        found, (figure, -figure), among, 1, each=2
    )
