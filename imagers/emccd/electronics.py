"""Metrics of the high-voltage drive, its potentiometer and the supplies."""

from __future__ import annotations

import math
from dataclasses import replace

from cosim.clock import PS
from cosim.run.result import Metric
from imagers.emccd.device.potentiometer import Potentiometer, word_clocks
from imagers.emccd.device.sine_drive import SineDrive
from imagers.emccd.device.supplies import Course
from imagers.emccd.pixels import HighVoltage
from imagers.emccd.pixels.multiplication import GAIN_RANGE, GAIN_STEPS

SETTLED = 0.01
"""Share of its end within which a gain counts as settled."""


def ageing_codes(voltage: HighVoltage, step: int) -> int:
    """Codes that the gain at a step of an aged chip is higher than on the curve of a new one: what
    its gain calibration adds."""
    gain = min(voltage.gain(step), GAIN_RANGE[1])
    return step - replace(voltage, ageing=0.0).step_for(gain)


def drive_metrics(drive: SineDrive, peak: float, potentiometer: Potentiometer) -> dict[str, Metric]:
    """Metrics of the drive at the end of a run.

    Args:
        drive: of the camera.
        peak: mean of the last frame, V.
        potentiometer: after the run.
    """
    voltage, step, last = drive.voltage, potentiometer.wiper, GAIN_STEPS - 1
    slope = voltage.slope(drive.at_transfer(peak))
    lost = 1 - voltage.gain_at(drive.at_transfer(peak)) / voltage.gain_at(peak)
    code = voltage.gain(min(step + 1, last)) / voltage.gain(min(step, last - 1)) - 1
    ripple, settled = drive.ripple(step), drive.settled(0, last, SETTLED)
    held = peak * drive.efficiency
    return {
        "high_voltage": Metric(peak, "V"),
        "high_voltage_error": Metric(drive.steady(step) - voltage.volts(step), "V"),
        "high_voltage_ripple": Metric(ripple, "V"),
        "detector_droop": Metric(held * (1 - drive.droop), "V"),
        "transfer_voltage": Metric(drive.transfer_mean(peak), "V"),
        "transfer_field": Metric(drive.field(peak), "V/um"),
        "gain_lost_by_phase": Metric(lost, "1"),
        "gain_slope": Metric(slope, "1/V"),
        "gain_ripple": Metric(math.expm1(slope * ripple), "1"),
        "gain_of_a_code": Metric(code, "1"),
        "loop_gain": Metric(drive.loop_gain(step), "1"),
        "high_voltage_settling": Metric(
            None if settled is None else settled * 1e6, "us", "the voltage does not settle"
        ),
        "potentiometer_code": Metric(step, "1"),
        "potentiometer_words": Metric(potentiometer.words, "1"),
        "potentiometer_word": Metric(word_clocks() / drive.hertz * 1e6, "us"),
        "ageing_codes": Metric(ageing_codes(voltage, step), "1"),
    }


def supply_metrics(course: Course, begin: int, switched: float | None) -> dict[str, Metric]:
    """Metrics of the power-up.

    Args:
        course: of the supplies from their switch-on.
        begin: first exposure's beginning, ps.
        switched: instant of the switch-on in the run, s; None before the run.
    """
    good = course.good
    made = {
        "power_up": Metric(
            None if good is None else good * 1e3,
            "ms",
            "the supplies are not good within the power-up",
        )
    }
    if switched is not None:
        made["power_up_to_exposure"] = Metric((begin / PS - switched) * 1e3, "ms")
    return made
