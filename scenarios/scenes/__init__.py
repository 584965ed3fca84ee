"""Scenes: where the light of a run comes from."""

from scenarios.scenes.charts.sky import SkySource
from scenarios.scenes.making import make_source
from scenarios.scenes.source import AnalyticSource

__all__ = ["AnalyticSource", "SkySource", "make_source"]
