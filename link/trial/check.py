"""The error of a link's run: its bit error rate against that of full physics, on a few patches.

Both are met on the same bits, with the same chance in every pixel. Two figures come of it:

- counted: by the bits that only one of the two has wrong. |Difference of the rates| is at most
  their share; where there are none that share has a one-sided Clopper-Pearson limit, else the two
  kinds have an interval each, which together hold at 99.9 %. The bits are taken as independent.
  Nothing else is assumed, and what limits it is the number of bits.
- estimated: by the bits that are nearly wrong (`link_near`), whose relative change is taken as that
  of the bit error rate. Where there are enough bits this is the error that is told, and says so.

The unit is half the interval of the run's own bit error rate: before the run that of full physics
on the patches, after it the rate that was measured over all of its bits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.run.progress import Progress
from cosim.run.result import Error
from link.mode import Mode
from link.sending import Transmission
from link.setting import LinkSetting
from link.theory import byte_error, clopper_pearson, rs_word_error
from link.trial.near import Lead, Near, near
from link.trial.patches import Decided, LinkPatches, Variant
from link.trial.plan import LEVEL, LinkPlan, half_width

__all__ = ["ESTIMATED", "KIND", "LinkCheck", "Paired", "check_link", "compare", "goodput_change"]

KIND = "bit error rate, half-widths of its interval"
"""What the error of a link is of."""
ESTIMATED = f"{KIND}, estimated from bits that are nearly wrong"
"""The same, where it is."""
_FULL, _RUN = "reference", "run"
Wrong = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Paired:
    """Two ways on the same bits. bits: compared. full, run: wrong bits of full physics, and as run.
    more, fewer: those that only the run, and only full physics has wrong. unit: a half-width, as a
    bit error rate. change: interval of |difference of the rates|, at 99.9 %. rate: bit error rate
    that the relative change of bits nearly wrong is taken of, at least that of a single error.
    near: those bits, None where errors alone are counted."""

    bits: int
    full: int
    run: int
    more: int
    fewer: int
    unit: float
    change: tuple[float, float]
    rate: float = 0.0
    near: Near | None = None

    @property
    def kind(self) -> str:
        """What `value`, `low` and `high` are."""
        return KIND if self.near is None else ESTIMATED

    @property
    def counted(self) -> tuple[float, float, float]:
        """|Difference of the rates| by errors alone, its least and most at 99.9 %, half-widths."""
        low, high = self.change
        off = abs(self.more - self.fewer) / self.bits
        return off / self.unit, low / self.unit, high / self.unit

    @property
    def _estimate(self) -> tuple[float, float, float]:
        if self.near is None:
            return self.counted
        each = self.rate / self.unit
        low, high = self.near.size
        return abs(self.near.change) * each, low * each, high * each

    @property
    def value(self) -> float:
        """|Difference of the rates| in half-widths, of `kind`."""
        return self._estimate[0]

    @property
    def low(self) -> float:
        """At 99.9 %, half-widths."""
        return self._estimate[1]

    @property
    def high(self) -> float:
        """At 99.9 %, half-widths."""
        return self._estimate[2]

    def met(self, rate: float, bits: int) -> Paired:
        """The same beside a bit error rate met over so many bits."""
        return replace(self, unit=half_width(rate, bits), rate=max(rate, 1 / bits))

    @property
    def otherwise(self) -> float:
        """Share of bits that are decided otherwise, at most, at 99.9 %."""
        return _at_most(self.more + self.fewer, self.bits)


def _at_most(count: int, bits: int) -> float:
    """One-sided Clopper-Pearson limit at 99.9 %."""
    return float(clopper_pearson(count, bits, 1 - 2 * (1 - LEVEL))[1])


def compare(
    full: Wrong, run: Wrong, bits_of_run: int, leads: tuple[Lead, Lead] | None = None
) -> Paired:
    """full, run: of each bit, whether it was decided wrong. leads: by how much each soft value is
    for what was sent, of full physics and of the run. The unit is half the 99.9 % interval of
    the bit error rate of full physics, met over the run's bits."""
    bits, rate = full.size, float(full.mean())
    more, fewer = int((run & ~full).sum()), int((full & ~run).sum())
    level = 1 - (1 - LEVEL) / 2
    up, down = (clopper_pearson(n, bits, level) for n in (more, fewer))
    low, high = float(up[0] - down[1]), float(up[1] - down[0])
    nearest = 0.0 if low <= 0 <= high else min(abs(low), abs(high))
    farthest = max(abs(low), abs(high)) if more + fewer else _at_most(0, bits)
    return Paired(
        bits, int(full.sum()), int(run.sum()), more, fewer, half_width(rate, bits_of_run),
        (nearest, farthest), max(rate, 1 / bits), None if leads is None else near(*leads, LEVEL),
    )  # fmt: skip


def goodput_change(full: float, run: float, mode: Mode) -> float:
    """Relative change of the goodput that two bit error rates foretell: the codewords that come
    through, with independent bits. 0 where none come through either way."""
    a_byte = round(8 * mode.code.symbols / mode.code.bits)
    through = [
        1 - float(rs_word_error(255, 255 - mode.parity, byte_error(min(rate, 0.5), a_byte)))
        for rate in (full, run)
    ]
    return abs(through[1] - through[0]) / through[0] if through[0] > 0 else 0.0


@dataclass(frozen=True, eq=False)
class LinkCheck:
    """paired: the run against full physics, None where nothing could be compared. alone: of each
    effect that the plan leaves out, what leaving out that one alone changed.
    goodput: relative change foretold. patches: how many. full_ns: what full physics takes for a
    pixel-cycle of the patches, their light included."""

    paired: Paired | None
    alone: Mapping[str, Paired | None]
    goodput: float | None
    patches: int
    full_ns: float | None

    @property
    def measured(self) -> dict[str, float | None]:
        """`alone` in half-widths."""
        return {name: None if p is None else p.value for name, p in self.alone.items()}

    def met(self, rate: float | None, bits: int) -> LinkCheck:
        """The same in half-widths of the bit error rate that the run's own bits have."""
        if rate is None or self.paired is None or not bits:
            return self
        alone = {name: None if p is None else p.met(rate, bits) for name, p in self.alone.items()}
        return replace(self, paired=self.paired.met(rate, bits), alone=alone)

    @property
    def error(self) -> Error:
        """As `result.json` has it."""
        if self.paired is None:
            return Error(None, None, None)
        return Error(self.paired.value, self.paired.kind, (self.paired.low, self.paired.high))

    def beyond(self, tolerance: float) -> bool:
        """Whether the run is shown to be off by more than was asked for."""
        if self.paired is None or tolerance <= 0:
            return False
        return max(self.paired.low, self.paired.counted[1]) > tolerance

    def document(self) -> dict[str, Any]:
        """For reports: what was compared."""
        paired = self.paired
        close = None if paired is None else paired.near
        return {
            "bits": None if paired is None else paired.bits,
            "wrong_full_physics": None if paired is None else paired.full,
            "wrong_as_run": None if paired is None else paired.run,
            "otherwise": None if paired is None else paired.more + paired.fewer,
            "otherwise_at_most": None if paired is None else paired.otherwise,
            "nearly_wrong": None if close is None else close.count,
            "nearly_wrong_otherwise": None if close is None else close.more + close.fewer,
            "counted": None if paired is None else list(paired.counted),
            "goodput_change": self.goodput, "patches": self.patches,
        }  # fmt: skip


def _without(setting: LinkSetting, plan: LinkPlan, name: str) -> Variant:
    """Full physics but for one effect."""
    if name in plan.of_air:
        return Variant("reference", setting.camera, plan.of_air - {name})
    return Variant("reference", setting.camera.without({name}))


def check_link(
    setting: LinkSetting,
    sent: Transmission,
    plan: LinkPlan,
    *,
    detector: str = "joint",
    seed: int,
    device: Device | None,
    progress: Progress,
) -> LinkCheck:
    """Runs a few patches of the link with every effect in the reference tier, as planned, and
    without each effect alone that the plan leaves out. seed: of patches that lie by chance."""
    patches = LinkPatches(setting, sent, seed, detector)
    count = 0 if patches.plane is None else len(patches.plane.tiles)
    if not patches.bits:  # out of view, or nothing sent but the training
        return LinkCheck(None, dict.fromkeys(plan.left_out), None, count, None)
    variants = {
        _FULL: Variant("reference", setting.camera),
        _RUN: Variant(plan.tier, plan.camera, plan.run_air),
    }
    variants |= {name: _without(setting, plan, name) for name in plan.left_out}
    decided = patches.film(variants, device, progress)
    full = decided[_FULL]

    def against(other: Decided) -> Paired:
        return compare(
            full.wrong, other.wrong, plan.scene.bits, (full.lead, other.lead)
        )  # fmt: skip

    return LinkCheck(
        against(decided[_RUN]),
        {name: against(decided[name]) for name in plan.left_out},
        goodput_change(full.rate, decided[_RUN].rate, sent.mode),
        count, full.air_ns + full.camera_ns,
    )  # fmt: skip
