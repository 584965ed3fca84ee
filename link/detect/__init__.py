"""Spikes of a panel's image to soft values of its bits."""

from link.detect.calibration import confidence
from link.detect.comparison import Compared, comparison
from link.detect.detector import DETECTORS, Detector, DetectorName, make_detector
from link.detect.joint import Joint
from link.detect.pixel import PixelLaw
from link.detect.plain import plain_soft

__all__ = [
    "DETECTORS",
    "Compared",
    "Detector",
    "DetectorName",
    "Joint",
    "PixelLaw",
    "comparison",
    "confidence",
    "make_detector",
    "plain_soft",
]
