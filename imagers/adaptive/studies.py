"""The adaptive-exposure sensor in `viform compare`, where it chooses its exposure itself, and in
`viform laboratory`."""

from __future__ import annotations

from typing import Any, Final

from imagers.adaptive.device.loop import longest_exposure, shortest_exposure
from imagers.adaptive.device.registers import DEFAULT_LONGEST
from imagers.adaptive.pixels import AdaptivePixels
from imagers.adaptive.section import AdaptiveSection
from imagers.common.kind import Comparison, Setting
from sensor.laboratory.bench import Bench
from sensor.laboratory.cameras import Camera


class AdaptiveComparison(Comparison):
    """See `Comparison`."""

    title = "adaptive-exposure CMOS"

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        return (
            Setting(pixels, shortest_exposure()),
            Setting(pixels, longest_exposure(DEFAULT_LONGEST)),
        )

    def setting(self, section: AdaptiveSection, pixels: Any) -> str:
        return "chosen by itself"


def _bench(seed: int) -> Bench:
    return Bench(
        AdaptivePixels((32, 96)), 1e-10, 0.01, (0.01, 2, 4), rows=32, frames=6, stack=32,
        seed=seed, bias=None,
    )  # fmt: skip


MEASURED: Final = Camera("adaptive-exposure", "adaptive-exposure CMOS imager", _bench)
"""Its part in `viform laboratory`."""
