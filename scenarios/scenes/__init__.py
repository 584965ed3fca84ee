"""Scenes: where the light of a run comes from."""

from scenarios.scenes.making import make_source
from scenarios.scenes.source import AnalyticSource, Source

__all__ = ["AnalyticSource", "Source", "make_source"]
