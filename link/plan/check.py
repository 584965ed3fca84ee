"""The error of a link's run: its bit error rate against full physics, on a few patches.

Both are measured on the same bits, with the same random numbers in every pixel. There are two
estimates:

- counted: from the bits that only one of the two decides wrongly. |Difference of the rates| is at
  most their share. If there are none, that share has a one-sided Clopper-Pearson limit; otherwise
  the two kinds have an interval each, which together hold at 99.9 %. Bits are taken as independent.
  Nothing else is assumed; the limit is the number of bits.
- estimated: from the bits that are nearly wrong, whose relative change is taken as that of the bit
  error rate. With enough bits this is the reported error, and it is marked as estimated.

The unit is half the interval of the run's own bit error rate: before the run that of full physics
on the patches, after it the rate over all of its bits.

A bit is nearly wrong if its soft value favours the sent bit by less than a margin. The margin is
chosen so that a thousandth of the bits of full physics are within it, which gives hundreds of such
bits for each error. Two simulations with the same random numbers are compared by the bits that are
nearly wrong in only one of them. The estimate assumes that errors change by the same share: an
omitted effect shifts soft values, and the share by which that changes the number of bits below a
margin follows the slope of ln(number), which is similar at zero and at a small margin. It grows
slightly towards zero: in the default link without glare and cross-talk, 13 % fewer bits are within
a margin of 10, 14 % within 8, 6 % within 15.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.plan.error import CONFIDENCE, Measured
from cosim.plan.planner import left_out_rows
from cosim.run.progress import Progress
from cosim.run.result import Error
from link.mode import Mode
from link.plan.patches import Decided, LinkPatches, Variant
from link.plan.plan import NEARLY, LinkPlan, half_width
from link.sending import Transmission
from link.setting import LinkSetting
from link.theory import clopper_pearson, word_loss

FEWEST: Final = 200
"""Smallest number of nearly wrong bits; with few bits the share is larger."""
WIDEST: Final = 0.01
"""Largest share. With fewer bits, only errors are counted."""
_SPREAD: Final = 1.0
"""Range of the random offset of each bit's margin, the same in all simulations: some detectors have
few distinct soft values, and a single margin could split equal ones."""
_SEED: Final = 0x6E656172
Lead = npt.NDArray[np.float32]
"""(symbols, cells) soft value in favour of the sent bit."""
KIND = "bit error rate, half-widths of its interval"
"""Kind of a link's error."""
ESTIMATED = f"{KIND}, estimated from bits that are nearly wrong"
"""Kind of an estimated error."""
_FULL, _RUN = "reference", "run"
Wrong = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Near:
    """Comparison of nearly wrong bits.

    Attributes:
        bits: number of bits compared.
        count: bits that are nearly wrong with full physics.
        more, fewer: bits that are nearly wrong only in the other simulation, and only with full
            physics.
        margin: mean margin of soft values.
        relative: interval of the relative change of their number.
    """

    bits: int
    count: int
    more: int
    fewer: int
    margin: float
    relative: tuple[float, float]

    @property
    def change(self) -> float:
        """Relative change of their number."""
        return (self.more - self.fewer) / self.count

    @property
    def size(self) -> tuple[float, float]:
        """Interval of the magnitude of the relative change."""
        low, high = self.relative
        nearest = 0.0 if low <= 0 <= high else min(abs(low), abs(high))
        return nearest, max(abs(low), abs(high))


def near(full: Lead, run: Lead) -> Near | None:
    """Compares nearly wrong bits; None if there are too few bits or too many errors.

    Args:
        full, run: soft values in favour of the sent bits.
    """
    bits = full.size
    count = max(round(NEARLY * bits), FEWEST)
    if count > WIDEST * bits:
        return None
    offset = np.random.default_rng(_SEED).uniform(-_SPREAD, _SPREAD, full.shape).astype(np.float32)
    one, two = full - offset, run - offset
    margin = float(np.partition(one.ravel(), count)[count])
    if margin <= _SPREAD:
        return None
    first, second = one < margin, two < margin
    count = int(first.sum())
    if not count:
        return None
    more, fewer = int((second & ~first).sum()), int((first & ~second).sum())
    each = 1 - (1 - CONFIDENCE) / 2
    up, down = (clopper_pearson(n, bits, each) for n in (more, fewer))
    share = count / bits
    relative = float(up[0] - down[1]) / share, float(up[1] - down[0]) / share
    return Near(bits, count, more, fewer, margin, relative)


@dataclass(frozen=True)
class BitErrors:
    """Decisions of full physics and of the run on the same bits.

    Attributes:
        bits: number of bits compared.
        full, run: wrong bits of full physics, and of the run.
        more, fewer: bits that only the run decides wrongly, and only full physics.
        unit: half-width of the interval, as a bit error rate.
        change: interval of |difference of the rates|, at 99.9 %.
        rate: bit error rate that the relative change of nearly wrong bits refers to, at least that
            of a single error.
        near: the nearly wrong bits, None if only errors are counted.
    """

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
        """Kind of `error`."""
        return KIND if self.near is None else ESTIMATED

    @property
    def counted(self) -> Measured:
        """|Difference of the rates| from errors alone, half-widths."""
        low, high = self.change
        off = abs(self.more - self.fewer) / self.bits
        return Measured(off / self.unit, low / self.unit, high / self.unit)

    @property
    def error(self) -> Measured:
        """|Difference of the rates| of `kind`, half-widths."""
        if self.near is None:
            return self.counted
        each, (low, high) = self.rate / self.unit, self.near.size
        return Measured(abs(self.near.change) * each, low * each, high * each)

    def rescaled(self, rate: float, bits: int) -> BitErrors:
        """The same in half-widths of a bit error rate measured over `bits` bits."""
        return replace(self, unit=half_width(rate, bits), rate=max(rate, 1 / bits))

    @property
    def differing_limit(self) -> float:
        """Upper limit of the share of bits that are decided differently, at 99.9 %."""
        return _at_most(self.more + self.fewer, self.bits)


def _at_most(count: int, bits: int) -> float:
    """One-sided Clopper-Pearson limit at 99.9 %."""
    return float(clopper_pearson(count, bits, 1 - 2 * (1 - CONFIDENCE))[1])


def compare(
    full: Wrong, run: Wrong, bits_of_run: int, leads: tuple[Lead, Lead] | None = None
) -> BitErrors:
    """Compares the decisions of a run with those of full physics.

    The unit is half the 99.9 % interval of the bit error rate of full physics, over the run's bits.

    Args:
        full, run: bool of one shape, whether each bit was decided wrongly.
        bits_of_run: number of bits of the run.
        leads: soft value in favour of the sent bit, of full physics and of the run; None to count
            errors only.
    """
    bits, rate = full.size, float(full.mean())
    more, fewer = int((run & ~full).sum()), int((full & ~run).sum())
    level = 1 - (1 - CONFIDENCE) / 2
    up, down = (clopper_pearson(n, bits, level) for n in (more, fewer))
    low, high = float(up[0] - down[1]), float(up[1] - down[0])
    nearest = 0.0 if low <= 0 <= high else min(abs(low), abs(high))
    farthest = max(abs(low), abs(high)) if more + fewer else _at_most(0, bits)
    return BitErrors(
        bits, int(full.sum()), int(run.sum()), more, fewer, half_width(rate, bits_of_run),
        (nearest, farthest), max(rate, 1 / bits), None if leads is None else near(*leads),
    )  # fmt: skip


def goodput_change(full: float, run: float, mode: Mode) -> float:
    """Relative change of the goodput between two bit error rates.

    Goodput is the share of codewords that arrive, with independent bits; the result is 0 if none
    arrive with `full`.
    """
    through = [1 - word_loss(mode, rate) for rate in (full, run)]
    return abs(through[1] - through[0]) / through[0] if through[0] > 0 else 0.0


@dataclass(frozen=True, eq=False)
class LinkCheck:
    """Result of the check of a link's plan.

    Attributes:
        paired: the run against full physics, None if nothing could be compared.
        alone: change of each effect that the plan leaves out, if only that one is left out; if
            there is only one, the change of the run, which includes the tier.
        goodput: predicted relative change of the goodput.
        patches: number of patches.
        full_ns: run time of full physics for a pixel-cycle of the patches, light included, ns.
    """

    paired: BitErrors | None
    alone: Mapping[str, BitErrors | None]
    goodput: float | None
    patches: int
    full_ns: float | None

    @property
    def measured(self) -> dict[str, float | None]:
        """`alone` in half-widths."""
        return {name: None if p is None else p.error.value for name, p in self.alone.items()}

    def rescaled(self, rate: float | None, bits: int) -> LinkCheck:
        """The same in half-widths of the bit error rate of the run's own bits."""
        if rate is None or self.paired is None or not bits:
            return self
        alone = {
            name: None if p is None else p.rescaled(rate, bits) for name, p in self.alone.items()
        }
        return replace(self, paired=self.paired.rescaled(rate, bits), alone=alone)

    def error(self, promised: float) -> Error:
        """The error for `result.json`. Its upper limit is at least the bound of the plan, which
        holds for all cells, while the patches are a part of them. promised: `LinkPlan.promised`."""
        paired = self.paired
        if paired is None:
            return Error(None, "nothing is left out, or no bit of the patches was read", None)
        error = paired.error
        high = max(error.high, promised / paired.unit)
        return Error(error.value, paired.kind, (error.low, high))

    def beyond(self, tolerance: float) -> bool:
        """Whether the error of the run significantly exceeds the tolerance."""
        if self.paired is None or tolerance <= 0:
            return False
        return max(self.paired.error.low, self.paired.counted.low) > tolerance

    def document(self) -> dict[str, Any]:
        """What was compared, for reports."""
        paired = self.paired
        close = None if paired is None else paired.near
        return {
            "bits": None if paired is None else paired.bits,
            "wrong_full_physics": None if paired is None else paired.full,
            "wrong_as_run": None if paired is None else paired.run,
            "otherwise": None if paired is None else paired.more + paired.fewer,
            "otherwise_at_most": None if paired is None else paired.differing_limit,
            "nearly_wrong": None if close is None else close.count,
            "nearly_wrong_otherwise": None if close is None else close.more + close.fewer,
            "counted": None if paired is None else list(astuple(paired.counted)[:3]),
            "goodput_change": self.goodput, "patches": self.patches,
        }  # fmt: skip


def left_out_documents(plan: LinkPlan, check: LinkCheck | None) -> list[dict[str, Any]]:
    """Effects that a plan leaves out, for `result.json`, with the measured error without each, and
    its 99.9 % limits `ci`, null where it was not measured."""
    alone = {} if check is None else check.alone
    errors = {name: None if found is None else found.error for name, found in alone.items()}
    rows = left_out_rows(plan.plan.absent, {} if check is None else check.measured)
    for row in rows:
        error = errors.get(row["effect"])
        row["ci"] = None if error is None else (error.low, error.high)
    return rows


def _without(setting: LinkSetting, plan: LinkPlan, name: str) -> Variant:
    """Full physics without one effect."""
    if name in plan.active_air:
        return Variant("reference", setting.camera, plan.active_air - {name})
    return Variant("reference", setting.camera.without({name}))


def check_variants(setting: LinkSetting, plan: LinkPlan) -> dict[str, Variant]:
    """Ways that the check of a plan simulates: full physics, the run, and, if the plan leaves out
    several effects, full physics without each."""
    several = plan.left_out if len(plan.left_out) > 1 else ()
    return {
        _FULL: Variant("reference", setting.camera),
        _RUN: Variant(plan.tier, plan.camera, plan.air_effects),
    } | {name: _without(setting, plan, name) for name in several}


def check_link(
    setting: LinkSetting,
    sent: Transmission,
    plan: LinkPlan,
    *,
    detector: str = "packed",
    seed: int,
    device: Device | None,
    progress: Progress,
) -> LinkCheck:
    """Compares the planned run with full physics on a few patches.

    If the plan leaves out several effects, full physics is also compared with itself without each.

    Args:
        setting: the link.
        sent: the transmission.
        plan: the plan to check.
        detector: name of the detector.
        seed: seed of the random patches.
        device: OpenCL device, None for numba.
        progress: progress of the check.
    """
    patches = LinkPatches(setting, sent, seed, detector)
    count = 0 if patches.plane is None else len(patches.plane.tiles)
    if not patches.bits:  # out of view, or nothing sent but the training
        return LinkCheck(None, dict.fromkeys(plan.left_out), None, count, None)
    decided = patches.film(check_variants(setting, plan), device, progress)
    full = decided[_FULL]

    def against(other: Decided) -> BitErrors:
        return compare(
            full.wrong, other.wrong, plan.scene.bits, (full.lead, other.lead)
        )  # fmt: skip

    run = against(decided[_RUN])
    return LinkCheck(
        run,
        {name: against(decided[name]) if name in decided else run for name in plan.left_out},
        goodput_change(full.rate, decided[_RUN].rate, sent.mode),
        count, full.air_ns + full.camera_ns,
    )  # fmt: skip
