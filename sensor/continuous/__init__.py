"""Continuous photographing: pixels that report their absolute intensity when it has changed."""

from sensor.continuous.camera import ContinuousCamera
from sensor.continuous.converter import Converter
from sensor.continuous.false_reports import exit_time, sampled_exit_time
from sensor.continuous.setting import ContinuousSetting, quiet_floor

__all__ = [
    "ContinuousCamera",
    "ContinuousSetting",
    "Converter",
    "exit_time",
    "quiet_floor",
    "sampled_exit_time",
]
