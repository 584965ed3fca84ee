"""Which imager a scenario asks for."""

from __future__ import annotations

from scenarios.imagers.machine import Machine
from scenarios.schema import AdaptiveSection, EbapsSection, ImagerScenario

__all__ = ["machine_of"]


def machine_of(scenario: ImagerScenario) -> Machine:
    """The machine of its kind; what one kind needs is imported for that kind alone."""
    section = scenario.imager
    if isinstance(section, AdaptiveSection):
        from scenarios.imagers.adaptive import AdaptiveMachine

        return AdaptiveMachine(section)
    if isinstance(section, EbapsSection):
        from scenarios.imagers.ebaps import EbapsMachine

        return EbapsMachine(section)
    from scenarios.imagers.emccd import EmccdMachine

    return EmccdMachine(section, scenario.duration)
