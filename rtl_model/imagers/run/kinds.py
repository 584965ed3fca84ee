"""Which imager a scenario asks for."""

from __future__ import annotations

from rtl_model.imagers.run.machine import Machine
from rtl_model.imagers.sections import AdaptiveSection, EbapsSection
from scenarios.assemble.scenario import ImagerScenario

__all__ = ["machine_of"]


def machine_of(scenario: ImagerScenario) -> Machine:
    """The machine of its kind; what one kind needs is imported for that kind alone."""
    section = scenario.imager
    if isinstance(section, AdaptiveSection):
        from rtl_model.imagers.adaptive.run import AdaptiveMachine

        return AdaptiveMachine(section)
    if isinstance(section, EbapsSection):
        from rtl_model.imagers.ebaps.run import EbapsMachine

        return EbapsMachine(section)
    from rtl_model.imagers.emccd.run import EmccdMachine

    return EmccdMachine(section, scenario.duration)
