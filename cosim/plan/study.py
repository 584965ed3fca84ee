"""The documents of a `Study`: `viform plan`, which says what a run would keep and leave out and how
long it would take, and `viform accuracy`, the error against the run time over a ladder of
tolerances.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any, Final, Generic, Literal, TypeVar

import numpy as np

from cosim.light.light import Light, PlaneMap
from cosim.plan.error import Law, Measured, Of
from cosim.plan.paired import CheckCamera
from cosim.plan.planner import EffectRow, Plan, Values
from cosim.plan.tiles import PatchPlane
from cosim.stage import Block

LADDER: Final = (0.0, 1e-5, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0)
"""Tolerances of the ladder."""
REFERENCE: Final = "reference"
"""Name of the tier of full physics."""
_CLEAR: Final = 3.0
"""Least ratio to the error at tolerance 0 at which an error is attributed to the tolerance."""

Tier = Literal["reference", "exact", "fast"]
P = TypeVar("P")


@dataclass(frozen=True)
class Speeds:
    """Run times in ns per pixel-cycle, None if unknown.

    Attributes:
        planned, everything: the camera with the planned effects, and with all effects.
        full: full physics.
        scene: computation of the light.
    """

    planned: float | None
    everything: float | None
    full: float | None
    scene: float | None

    def document(self, pixel_cycles: float) -> dict[str, float | None]:
        """The key `predicted` of the document, for a run of `pixel_cycles`."""

        def seconds(ns: float | None) -> float | None:
            return None if ns is None else ns * pixel_cycles * 1e-9

        return {
            "ns_per_pixel_cycle": self.planned,
            "sensor_s": seconds(self.planned),
            "scene_s": seconds(self.scene),
            "everything_ns_per_pixel_cycle": self.everything,
            "everything_s": seconds(self.everything),
            "full_physics_ns_per_pixel_cycle": self.full,
            "full_physics_s": seconds(self.full),
        }


@dataclass(frozen=True)
class Spell:
    """A time, s: on the clock, and of the processor in all threads."""

    wall: float
    processor: float

    def times(self, factor: float) -> Spell:
        return Spell(self.wall * factor, self.processor * factor)

    @classmethod
    def now(cls) -> Spell:
        return cls(time.perf_counter(), time.process_time())

    def since(self, begin: Spell) -> Spell:
        return Spell(self.wall - begin.wall, self.processor - begin.processor)

    @classmethod
    def least(cls, spent: Sequence[Spell]) -> Spell:
        """Least times of the calls after the first one, which may compile."""
        return cls(min(one.wall for one in spent[1:]), min(one.processor for one in spent[1:]))


@contextmanager
def timed(into: list[Spell]) -> Iterator[None]:
    """Adds the time of the block to a list."""
    begin = Spell.now()
    try:
        yield
    finally:
        into.append(Spell.now().since(begin))


@dataclass(frozen=True)
class FirstBlocks(Generic[P]):
    """The first blocks of a run, as several cameras have filmed them.

    Attributes:
        speeds: speeds of light and cameras.
        light, camera: time of the fastest block, of the light and of the planned camera.
        recorded: output of the planned camera, block by block.
    """

    speeds: Speeds
    light: Spell
    camera: Spell
    recorded: list[P]


def film_blocks(
    blocks: Sequence[Block], pixels: int, light: Callable[[Block], Light],
    cameras: Sequence[Callable[[Light, Block], P]],
    reference: tuple[PatchPlane, CheckCamera] | None,
) -> FirstBlocks[P]:  # fmt: skip
    """Films a few blocks of one length. The first one warms up; of the others the fastest counts,
    since other load of the machine only adds time.

    Args:
        blocks: the blocks, two at least.
        pixels: pixels of the chip.
        light: makes the light of a block.
        cameras: the planned camera, and that with every effect where it is another one; with fewer
            effects a simulation is never slower.
        reference: full physics on patches; None if it is not timed.
    """
    drawn: list[Spell] = []
    spent: list[list[Spell]] = [[] for _ in cameras]
    full: list[Spell] = []
    recorded: list[P] = []
    cut = None if reference is None else PlaneMap(reference[0].cut, None)
    for at, block in enumerate(blocks):
        with timed(drawn):
            given = light(block)
        # The order alternates: the first camera to read new light pays for loading it into cache.
        for n, camera in list(enumerate(cameras))[:: -1 if at % 2 else 1]:
            with timed(spent[n]):
                made = camera(given, block)
            if n == 0:
                recorded.append(made)
        if reference is not None and cut is not None:
            patches = cut(given)
            with timed(full):
                reference[1].step(patches, block.start, block.cycles)

    def ns(times: list[Spell], many: int) -> float:
        return Spell.least(times).wall * 1e9 / (blocks[0].cycles * many)

    planned, every = ns(spent[0], pixels), ns(spent[-1], pixels)
    reference_ns = None if reference is None else ns(full, reference[0].numbers.size)
    speeds = Speeds(planned, max(planned, every), reference_ns, ns(drawn, pixels))
    return FirstBlocks(speeds, Spell.least(drawn), Spell.least(spent[0]), recorded)


def plan_document(
    name: str, tolerance: float, rows: Sequence[EffectRow], *, tier: str, device: str,
    predicted: dict[str, float | None], **others: Any,
) -> dict[str, Any]:  # fmt: skip
    """The document of a plan. Bounds that are infinite are unknown.

    Args:
        name: name of the scenario.
        tolerance: tolerance of the plan.
        rows: rows of the effects.
        tier, device: tier and device of the run.
        predicted: predicted run times.
        others: keys of one kind of machine, and what is known of the sum of the bounds.
    """
    bounds = [row.bound if math.isfinite(row.bound) else None for row in rows]
    return {
        "scenario": name,
        "tolerance": tolerance,
        "tier": tier,
        "device": device,
        "tiles": {},
        "promised": None,
        "promised_kind": None,
        "error": {"of": "run", "law": None},
        "sets": [],
        **others,
        "kept": [row.effect for row in rows if row.kept > 0],
        "left_out": [
            {"effect": row.effect, "bound": bound, "kind": row.kind, "share": 1 - row.kept}
            for row, bound in zip(rows, bounds, strict=True) if row.kept < 1
        ],
        "rows": [
            asdict(row) | {"bound": bound} for row, bound in zip(rows, bounds, strict=True)
        ],
        "predicted": predicted,
    }  # fmt: skip


def forecast_document(
    name: str, plan: Plan, *, tier: str, device: str, tier_error: Values | float, speeds: Speeds,
    pixel_cycles: float, law: Law | None = None, **others: Any,
) -> dict[str, Any]:  # fmt: skip
    """The document of a plan whose run time is predicted.

    Args:
        name, tier, device, **others: see `plan_document`.
        plan: plan of the run.
        tier_error: bound of the error of the tier's arithmetic, relative; a number, or one a tile.
        speeds: predicted run times.
        pixel_cycles: size of the run.
        law: error in law; None for an error of the run.
    """
    error = {"of": "run", "law": None} if law is None else {"of": "law", "law": law.document()}
    return plan_document(
        name, plan.tolerance, plan.rows, tier=tier, device=device,
        predicted=speeds.document(pixel_cycles),
        promised=float(np.max(plan.total + tier_error)),
        promised_kind="estimate" if np.any(tier_error) else plan.kind,
        sets=[{"effects": list(effects), "tiles": n} for effects, n in plan.sets.items()],
        error=error,
        **others,
    )  # fmt: skip


@dataclass(frozen=True)
class Step:
    """One tier at one tolerance.

    Attributes:
        tier: "reference", "exact" or "fast".
        tolerance: requested tolerance; None for the reference.
        error, ci: error of the worst patch, and its 99.9 % interval.
        of: what the error is of, the run or its law; None for none.
        run_time_s: run time of the whole run, from ns_per_pixel_cycle.
        ns_per_pixel_cycle: measured run time.
        effects: effects that some tile keeps.
        left_out: effects that some tile leaves out.
        same_as: tighter tolerance with the same plan, and so the same figures.
    """

    tier: str
    tolerance: float | None
    error: float | None
    ci: tuple[float, float] | None
    run_time_s: float | None
    ns_per_pixel_cycle: float | None
    effects: list[str]
    left_out: list[str]
    same_as: float | None = None
    of: Of | None = "run"

    @classmethod
    def measured(
        cls, tier: str, tolerance: float | None, error: Measured | None, ns: float | None,
        size: float, effects: Sequence[str], left_out: Sequence[str] = (),
        same_as: float | None = None, of: Of = "run",
    ) -> Step:  # fmt: skip
        """The step with an error that was measured and a time of `ns` a pixel-cycle. size: of the
        run, pixel-cycles."""
        value, ci = (None, None) if error is None else (error.value, (error.low, error.high))
        seconds = None if ns is None else ns * 1e-9 * size
        known = None if error is None else of
        return cls(tier, tolerance, value, ci, seconds, ns, [*effects], [*left_out], same_as, known)

    def document(self) -> dict[str, Any]:
        """The step as a JSON object."""
        return asdict(self)


@dataclass(frozen=True)
class Rung(Generic[P]):
    """One plan of a ladder.

    Attributes:
        tier: tier of the plan.
        tolerances: all tolerances that lead to it, the tightest first.
        plan: the plan.
    """

    tier: Tier
    tolerances: list[float]
    plan: P

    @property
    def name(self) -> str:
        return f"{self.tier} {self.tolerances[0]:g}"

    def steps(
        self, error: Measured | None, ns: float | None, size: float, effects: Sequence[str],
        left_out: Sequence[str], of: Of = "run",
    ) -> list[Step]:  # fmt: skip
        """A step for each tolerance; see `Step.measured`."""
        first = self.tolerances[0]
        return [
            Step.measured(
                self.tier, t, error, ns, size, effects, left_out, first if n else None, of
            )
            for n, t in enumerate(self.tolerances)
        ]


def climb(
    tiers: Sequence[Tier], plan: Callable[[Tier, float], P], key: Callable[[P], object]
) -> list[Rung[P]]:
    """The distinct plans of a ladder of tolerances, tier by tier.

    Args:
        tiers: names of the tiers.
        plan: gives the plan for a tier and a tolerance.
        key: gives a value that is equal for equal plans.
    """
    found: list[Rung[P]] = []
    for tier in tiers:
        for tolerance in LADDER:
            planned, last = plan(tier, tolerance), found[-1] if found else None
            if last is not None and last.tier == tier and key(planned) == key(last.plan):
                last.tolerances.append(tolerance)
            else:
                found.append(Rung(tier, [tolerance], planned))
    return found


def ladder_document(
    steps: Sequence[Step], reference: dict[str, Any], floor: float, chance: float | None,
    **others: Any,
) -> dict[str, Any]:  # fmt: skip
    """The document of a ladder.

    Args:
        steps: its steps, with that of the reference.
        reference: what is known of the reference.
        floor: error of the reference itself.
        chance: error that chance alone makes; None if unknown.
        others: keys of one kind of machine.
    """
    return {
        **others,
        "reference": reference,
        "order": fit_steps(steps),
        "floor": {"reference": floor, "monte_carlo": chance},
        "rows": [step.document() for step in steps],
    }


def fit_order(points: Sequence[tuple[float, float]], floor: float = 0.0) -> float | None:
    """Exponent e of error = C tolerance^e, by least squares in logarithms.

    Args:
        points: (tolerance, error). Only positive ones well above `floor` are used.
        floor: error at tolerance 0.

    Returns:
        The exponent, None for fewer than three different tolerances.
    """
    clear = [(t, e) for t, e in points if t > 0 and e > max(_CLEAR * floor, 0.0)]
    if len({t for t, _ in clear}) < 3:
        return None
    x, y = np.log(clear).T
    return float(np.polyfit(x, y, 1)[0])


def fit_steps(steps: Sequence[Step]) -> float | None:
    """`fit_order` over the steps that neither are the reference nor repeat another plan."""
    asked = [step for step in steps if step.tier != REFERENCE and step.same_as is None]
    floor = min((s.error for s in asked if s.error and not s.tolerance), default=0.0)
    return fit_order([(s.tolerance or 0.0, s.error or 0.0) for s in asked], floor)
