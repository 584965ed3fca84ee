"""The catalogue entries of the pulse-modulated imagers.

The methods import what they need, because the physics takes seconds to load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from imagers.common.kind import ImagerKind
from imagers.pulse.section import PfmSection, PulseSection, PwmSection

if TYPE_CHECKING:
    from imagers.common.kind import Comparison
    from imagers.common.model import ImagerModel


class _PulseKind(ImagerKind):
    def model(self, section: PulseSection, seconds: float) -> ImagerModel:
        from imagers.pulse.model import PulseModel

        return PulseModel(section)


class PwmKind(_PulseKind):
    """See `ImagerKind`."""

    name = "pwm"
    title = "pulse-width modulated imager"
    section = PwmSection

    def comparison(self) -> Comparison:
        from imagers.pulse.model import PwmComparison

        return PwmComparison()


class PfmKind(_PulseKind):
    """See `ImagerKind`."""

    name = "pfm"
    title = "pulse-frequency modulated imager"
    section = PfmSection

    def comparison(self) -> Comparison:
        from imagers.pulse.model import PfmComparison

        return PfmComparison()
