"""Frame-transfer EMCCD of seed 003 as a whole machine: timing, sequencer, registers, cooling."""

from rtl_model.imagers.emccd.cold_plant import Plant, Temperatures, Thermistor
from rtl_model.imagers.emccd.cooling import (
    Cooler,
    CoolingFault,
    CoolingRun,
    Pid,
    PidSettings,
    run_cooling,
)
from rtl_model.imagers.emccd.counted import Counted, counted
from rtl_model.imagers.emccd.imager import Emccd
from rtl_model.imagers.emccd.machine import EmccdMachine, machine
from rtl_model.imagers.emccd.plain import PlainSequencer
from rtl_model.imagers.emccd.registers import DESIGN, PARAMETERS, REGISTERS, design
from rtl_model.imagers.emccd.sequencer import SIGNALS, Cycle, Phase, signal_changes
from rtl_model.imagers.emccd.timing import (
    CLOCK_HZ,
    EXPOSURE_STEP_US,
    EXPOSURE_STEPS,
    SIZES,
    Settings,
    Timing,
    after_printed,
    exposure_range,
    frame_clocks,
    frame_rate,
    frame_seconds,
    window_table,
)

__all__ = [
    "CLOCK_HZ",
    "DESIGN",
    "EXPOSURE_STEPS",
    "EXPOSURE_STEP_US",
    "PARAMETERS",
    "REGISTERS",
    "SIGNALS",
    "SIZES",
    "Cooler",
    "CoolingFault",
    "CoolingRun",
    "Counted",
    "Cycle",
    "Emccd",
    "EmccdMachine",
    "Phase",
    "Pid",
    "PidSettings",
    "PlainSequencer",
    "Plant",
    "Settings",
    "Temperatures",
    "Thermistor",
    "Timing",
    "after_printed",
    "counted",
    "design",
    "exposure_range",
    "frame_clocks",
    "frame_rate",
    "frame_seconds",
    "machine",
    "run_cooling",
    "signal_changes",
    "window_table",
]
