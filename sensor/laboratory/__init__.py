"""Cameras measured as a laboratory would: photon transfer in the manner of EMVA 1288."""

from sensor.laboratory.bench import Bench, Stack
from sensor.laboratory.emva import LEVEL, Measured, Report, measure_camera
from sensor.laboratory.estimate import Estimate
from sensor.laboratory.linear import LinearPixels
from sensor.laboratory.transfer import PhotonTransfer, measure_transfer

__all__ = [
    "LEVEL",
    "Bench",
    "Estimate",
    "LinearPixels",
    "Measured",
    "PhotonTransfer",
    "Report",
    "Stack",
    "measure_camera",
    "measure_transfer",
]
