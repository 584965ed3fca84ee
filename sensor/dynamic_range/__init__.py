"""Dynamic range from a model of the hardware: sensor, circuit, converter, gains, output mapping;
and the spike camera's own formulas."""

from sensor.dynamic_range.catalogue import CONVERTERS, KODAK, SENSORS, ConverterPart, SensorPart
from sensor.dynamic_range.chain import (
    Chain,
    document_dynamic_range,
    gain_counted_once,
    rounding_variance,
)
from sensor.dynamic_range.converter import Converter, bits_for, converter_rule
from sensor.dynamic_range.decibels import as_ratio, decibels, sensor_dynamic_range
from sensor.dynamic_range.mapping import Mapping
from sensor.dynamic_range.monte_carlo import measure_chain
from sensor.dynamic_range.noise import DarkLaw, SensorNoise
from sensor.dynamic_range.spike import (
    interval_rsd,
    level_step,
    levels_for,
    longest_width,
    photons_per_second,
    spike_dynamic_range,
    threshold_for,
)
from sensor.dynamic_range.sweep import Budget, Judged, sweep
from sensor.dynamic_range.wells import DALSA

__all__ = [
    "CONVERTERS",
    "DALSA",
    "KODAK",
    "SENSORS",
    "Budget",
    "Chain",
    "Converter",
    "ConverterPart",
    "DarkLaw",
    "Judged",
    "Mapping",
    "SensorNoise",
    "SensorPart",
    "as_ratio",
    "bits_for",
    "converter_rule",
    "decibels",
    "document_dynamic_range",
    "gain_counted_once",
    "interval_rsd",
    "level_step",
    "levels_for",
    "longest_width",
    "measure_chain",
    "photons_per_second",
    "rounding_variance",
    "sensor_dynamic_range",
    "spike_dynamic_range",
    "sweep",
    "threshold_for",
]
