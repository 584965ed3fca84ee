"""Frame-transfer EMCCD of seed 003 as a whole machine."""

from rtl_model.imagers.emccd.cold_plant import Plant, Temperatures, Thermistor
from rtl_model.imagers.emccd.cooling import (
    Cooler,
    CoolingFault,
    CoolingRun,
    Pid,
    PidSettings,
    run_cooling,
)

__all__ = [
    "Cooler",
    "CoolingFault",
    "CoolingRun",
    "Pid",
    "PidSettings",
    "Plant",
    "Temperatures",
    "Thermistor",
    "run_cooling",
]
