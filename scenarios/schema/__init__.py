"""The scenario schema: frozen, typed, complete. Unknown keys and wrong kinds of unit are refused.

A quantity is text with a unit in the file and a float in the kind's unit here. `export` gives the
whole as JSON Schema.
"""

from scenarios.schema.asynchronous import AsynchronousSection, ChannelSection
from scenarios.schema.board import BoardScenario, BoardSection
from scenarios.schema.continuous import ContinuousSection
from scenarios.schema.link import (
    AimSection,
    AirSection,
    LinkSection,
    ModemSection,
    PanelSection,
)
from scenarios.schema.messages import validate
from scenarios.schema.scenario import ImageSection, LinkScenario, Scenario, export
from scenarios.schema.scenes import (
    FilmScene,
    SceneSection,
    ShockwaveScene,
    StarScene,
    StepScene,
    SunAndStarsScene,
    WaveScene,
)
from scenarios.schema.sensor import SPIKING, LensSection, PatternSection, SensorSection

__all__ = [
    "SPIKING",
    "AimSection",
    "AirSection",
    "AsynchronousSection",
    "BoardScenario",
    "BoardSection",
    "ChannelSection",
    "ContinuousSection",
    "FilmScene",
    "ImageSection",
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
    "WaveScene",
    "export",
    "validate",
]
