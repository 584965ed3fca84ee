"""Spikes of a panel's image to soft values of its bits."""

from link.detect.detector import DETECTORS, Detector, make_detector

__all__ = ["DETECTORS", "Detector", "make_detector"]
