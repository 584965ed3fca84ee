"""The scenario schema: frozen, typed, complete. Unknown keys and wrong kinds of unit are refused.

A quantity is text with a unit in the file and a float in the kind's unit here. `export` gives the
whole as JSON Schema.
"""

from scenarios.schema.asynchronous import AsynchronousSection, ChannelSection
from scenarios.schema.board import BoardScenario, BoardSection
from scenarios.schema.continuous import ContinuousSection
from scenarios.schema.imagers import (
    AdaptiveSection,
    EbapsSection,
    EmccdSection,
    ImagerLens,
    ImagerScenario,
    ImagerSection,
)
from scenarios.schema.link import (
    AimSection,
    AirSection,
    LinkSection,
    ModemSection,
    PanelSection,
)
from scenarios.schema.messages import first_fault, validate
from scenarios.schema.scenario import AnyScenario, ImageSection, LinkScenario, Scenario, export
from scenarios.schema.scenes import (
    FilmScene,
    SceneSection,
    ShockwaveScene,
    StarScene,
    StepScene,
    SunAndStarsScene,
    TargetScene,
    WaveScene,
    scene_keys,
)
from scenarios.schema.sensor import SPIKING, LensSection, PatternSection, SensorSection

__all__ = [
    "SPIKING",
    "AdaptiveSection",
    "AimSection",
    "AirSection",
    "AnyScenario",
    "AsynchronousSection",
    "BoardScenario",
    "BoardSection",
    "ChannelSection",
    "ContinuousSection",
    "EbapsSection",
    "EmccdSection",
    "FilmScene",
    "ImageSection",
    "ImagerLens",
    "ImagerScenario",
    "ImagerSection",
    "LensSection",
    "LinkScenario",
    "LinkSection",
    "ModemSection",
    "PanelSection",
    "PatternSection",
    "Scenario",
    "SceneSection",
    "SensorSection",
    "ShockwaveScene",
    "StarScene",
    "StepScene",
    "SunAndStarsScene",
    "TargetScene",
    "WaveScene",
    "export",
    "first_fault",
    "scene_keys",
    "validate",
]
