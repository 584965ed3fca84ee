"""The EBAPS in `viform compare`: its high voltage is set for the light."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

from imagers.common.kind import Comparison, Setting
from imagers.ebaps.device.exposure import WINDOW, ExposureRule, Linear
from imagers.ebaps.device.settling import settle
from imagers.ebaps.model import EbapsModel
from imagers.ebaps.pixels import COLUMNS, ROWS, EbapsPixels, wanted_exposure
from imagers.ebaps.section import EbapsSection
from sensor.laboratory.bench import Bench
from sensor.laboratory.cameras import Camera

VOLTS: Final = (1500.0, 1000.0, 500.0, 0.0)
"""Voltages of the document's figure 11, V below ground."""
_SHAPE: Final = (32, 32)
"""Pixels for which closed forms are evaluated."""


class EbapsComparison(Comparison):
    """See `Comparison`."""

    title = "EBAPS"
    note = "corner of an array of 1280 x 1024, whose data rate is given"

    def adjust(
        self, section: EbapsSection, white: float, mean: float, given: frozenset[str]
    ) -> EbapsSection:
        """The highest of the document's voltages at which the range of the loop contains the
        exposure that the light needs, and the exposure at which the loop comes to rest."""
        rule = ExposureRule()
        target = sum(WINDOW) / 2
        choices = (-section.high_voltage,) if "high_voltage" in given else VOLTS
        volts, wanted, pixels = choices[-1], 0.0, EbapsModel(section).pixels
        for volts in choices:
            wanted = wanted_exposure(pixels.at(volts=volts), mean, target)
            if wanted * 1e9 >= rule.shortest:
                break
        changed: dict[str, float] = {"high_voltage": -volts}
        if "exposure" not in given:
            longest = 10 * rule.longest
            clipped = min(max(round(wanted * 1e9), 1), longest) if wanted < 1e3 else 10**12
            changed["exposure"] = settle(rule, Linear.wanting(clipped, rule)).low * 1e-9
        return section.model_copy(update=changed)

    def extremes(self, pixels: Any) -> tuple[Setting, Setting]:
        rule, small = ExposureRule(), replace(pixels, shape=_SHAPE)
        return (
            Setting(small.at(volts=0.0), rule.shortest * 1e-9),
            Setting(small.at(volts=1500.0), rule.longest * 1e-9),
        )

    def sent(self, section: EbapsSection) -> int:
        return ROWS * COLUMNS

    def setting(self, section: EbapsSection, pixels: Any) -> str:
        return f"{section.high_voltage + 0.0:.0f} V"

    def pedestal(self, section: EbapsSection) -> float | None:
        return float(section.pedestal) if section.darks else None


def _bench(seed: int) -> Bench:
    pixels = EbapsPixels(shape=(32, 96))
    rare = {"ion events", "direct light", "photocathode emission"}
    return Bench(
        pixels, pixels.silicon.area, 1e-3, (0.001, 0.1, 0.2), rows=32, levels=8, frames=8,
        stack=32, seed=seed, kept=frozenset(pixels.effects) - rare, linear=0.15,
    )  # fmt: skip


MEASURED: Final = Camera(
    "ebaps", "EBAPS at -1500 V", _bench,
    (
        "photons are counted at 555 nm; the sensitivity of the photocathode is that to a "
        "lamp with infrared light, so that the quantum efficiency may exceed 1",
        "the gain is measured with its excess noise factor F^2: K is K F^2, and the "
        "quantum efficiency is QE/F^2",
        "some ten photoelectrons fill the scale, so slopes are fitted up to 15 % of "
        "saturation; ion events, direct light and photocathode emission are left out",
    ),
)  # fmt: skip
"""Its part in `viform laboratory`."""
