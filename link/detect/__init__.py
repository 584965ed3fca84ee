"""Spikes of a panel's image to soft values of its bits."""

from link.detect.comparison import Compared, comparison
from link.detect.detector import DETECTORS, Detector, DetectorName, make_detector
from link.detect.pixel import PixelLaw

__all__ = [
    "DETECTORS",
    "Compared",
    "Detector",
    "DetectorName",
    "PixelLaw",
    "comparison",
    "make_detector",
]
