"""Scenes: where the light of a run comes from."""

from scenarios.scenes.charts.sky import Patch, SkySource
from scenarios.scenes.making import make_source
from scenarios.scenes.source import AnalyticSource, Source

__all__ = ["AnalyticSource", "Patch", "SkySource", "Source", "make_source"]
