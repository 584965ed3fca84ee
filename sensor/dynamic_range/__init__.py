"""Dynamic range from a model of the hardware: sensor, circuit, converter, gains, output mapping;
and the spike camera's own formulas."""

from sensor.dynamic_range.chain import (
    DALSA,
    Chain,
    Mapping,
    document_dynamic_range,
    gain_counted_once,
    rounding_variance,
)
from sensor.dynamic_range.monte_carlo import measure_chain
from sensor.dynamic_range.parts import (
    CONVERTERS,
    KODAK,
    SENSORS,
    Converter,
    ConverterPart,
    DarkLaw,
    SensorNoise,
    SensorPart,
    as_ratio,
    bits_for,
    converter_rule,
    decibels,
    sensor_dynamic_range,
)
from sensor.dynamic_range.spike_camera import (
    dark_limit,
    interval_rsd,
    level_step,
    levels_for,
    longest_width,
    photons_per_second,
    seen_dark_share,
    spike_dynamic_range,
    threshold_for,
)
from sensor.dynamic_range.sweep import Budget, Judged, sweep

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
    "dark_limit",
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
    "seen_dark_share",
    "sensor_dynamic_range",
    "spike_dynamic_range",
    "sweep",
    "threshold_for",
]
