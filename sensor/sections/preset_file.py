"""A preset of the user's own camera: the file that `sensor.preset` names.

Spikes alone tell charges over the threshold, not electrons (sensor/calibrate). So the file states
charges as shares of the threshold in [of_threshold], which hold whatever the threshold is:

    [sensor]                    keys of [sensor], at most SENSOR
    [sensor.pattern]            keys of [sensor.pattern], at most PATTERN
    [of_threshold]
    interval_noise = 0.01       all temporal noise of an interval, shot noise included
    dark_current = 12.5         mean, thresholds a second
    hot_current = 800.0         of a hot pixel on top, thresholds a second

With the threshold Q in electrons, of the scenario or of the file, the threshold noise is Q
sqrt(interval_noise^2 - 1/Q): what shot noise does not explain.
"""

from __future__ import annotations

import difflib
import math
from pathlib import Path
from typing import Any, Final

from cosim.config.quantity import Quantity
from cosim.config.toml import read_toml
from cosim.errors import InputError, quote, shorten

BUILT_IN: Final = ("ideal", "silicon")
"""Presets that are no files."""
SENSOR: Final = (
    "width", "height", "clock", "threshold", "reset", "dead_time", "duplicated_rows", "drift",
    "row_jitter", "row_band", "row_band_width",
)  # fmt: skip
PATTERN: Final = (
    "prnu", "threshold_fpn", "dsnu", "hot_pixels", "dead_pixels", "row_fpn", "column_fpn",
    "neighbours_in_row", "neighbours_in_column",
)  # fmt: skip
OF_THRESHOLD: Final = ("interval_noise", "dark_current", "hot_current")
_ROUNDING: Final = 1e-6
"""Relative excess of shot noise over the noise of the file that is rounding of its digits."""


def _read(path: Path) -> dict[str, Any]:
    """The file's data. Raises InputError in one line."""
    try:
        data = read_toml(path)
    except (OSError, ValueError, RecursionError) as exc:
        reason = exc.strerror if isinstance(exc, OSError) else str(exc)
        raise InputError(
            "sensor.preset", "ideal, silicon, or a TOML file of `viform calibrate`",
            f"{path} ({shorten(str(reason))})", "check the path and the file",
        ) from exc  # fmt: skip
    sensor = data.get("sensor", {})
    parts = [
        ("", data, ("sensor", "of_threshold")), ("sensor.", sensor, (*SENSOR, "pattern")),
        ("sensor.pattern.", sensor.get("pattern", {}) if isinstance(sensor, dict) else {}, PATTERN),
        ("of_threshold.", data.get("of_threshold", {}), OF_THRESHOLD),
    ]  # fmt: skip
    for where, section, known in parts:
        if not isinstance(section, dict):
            raise InputError(f"{where[:-1]} in {path}", "a section", "a value", "correct the file")
        for key in section:
            if key not in known:
                near = difflib.get_close_matches(key, known, 1)
                raise InputError(
                    f"{where}{key} in {path}", f"one of {', '.join(known)}", "an unknown key",
                    f"did you mean {near[0]}?" if near else "remove it",
                )  # fmt: skip
    for key, value in data.get("of_threshold", {}).items():
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not number or not math.isfinite(value) or value < 0:
            raise InputError(
                f"of_threshold.{key} in {path}", "a number of 0 or more", repr(value), "correct it"
            )
    return data


def with_preset(data: dict[str, Any], levels: int) -> dict[str, Any]:
    """A [sensor] section with the keys of its preset's file where its own are absent.

    Args:
        data: the section, whose `preset` names a file.
        levels: settings of the threshold.

    Raises:
        InputError: the file cannot be used, or its noise is less than the shot noise of the
            threshold.
    """
    path = Path(data["preset"])
    if path.suffix != ".toml":
        raise InputError(
            "sensor.preset", "ideal, silicon, or a .toml of `viform calibrate`",
            quote(data["preset"]), "choose one",
        )  # fmt: skip
    if data.get("pixel", "latched") != "latched" or data.get("source"):
        raise InputError(
            "sensor.preset", "ideal or silicon, except with simulated latched pixels",
            str(path), "leave it out",
        )  # fmt: skip
    preset = _read(path)
    own = dict(preset.get("sensor", {}))
    pattern = {**own.pop("pattern", {})}
    if data.get("circuit") is not None:  # whose reset takes its own time
        own.pop("dead_time", None)
    given = data.get("pattern", {})
    merged = own | data
    try:  # a wrong threshold is refused on its own
        charge = Quantity("charge").read(merged.get("threshold"))
        charge *= int(merged.get("threshold_level", levels)) / levels
    except (ValueError, TypeError):
        return merged
    shares = preset.get("of_threshold", {})
    for key in ("dark_current", "hot_current"):
        if key in shares:
            pattern[key] = Quantity("current").write(charge * shares[key])
    if not isinstance(given, dict):
        return merged
    for key, needs in (("dsnu", "dark_current"), ("hot_pixels", "hot_current")):
        absent = {**pattern, **given}.get(needs)
        if absent is None or Quantity("current").read(absent) == 0:
            pattern.pop(key, None)
    if "interval_noise" in shares and "threshold_noise" not in data and "capacitance" not in data:
        merged["threshold_noise"] = _threshold_noise(path, shares["interval_noise"], charge)
    return merged | {"pattern": pattern | given}


def _threshold_noise(path: Path, noise: float, charge: float) -> str:
    """What shot noise leaves of the noise of an interval, as text. charge: threshold, electrons."""
    rest = noise**2 - 1 / charge
    if rest < -_ROUNDING / charge:
        least = math.ceil(1 / noise**2) if noise else math.inf
        raise InputError(
            "sensor.threshold", f"at least {least:g} e with sensor.preset = {path}, whose noise of "
            f"{noise:.3g} of an interval is less than the shot noise of fewer electrons",
            f"{charge:g} e", f"write --set sensor.threshold='{least:g} e', or leave it out",
        )  # fmt: skip
    return Quantity("charge").write(charge * math.sqrt(max(rest, 0.0)))
