"""The preset file of a calibrated camera, which `sensor.preset` takes."""

from __future__ import annotations

import math
from typing import Any

import tomli_w

from cosim.config.quantity import Quantity
from sensor.calibrate.calibration import Calibration

_MOST = 2e6
"""Largest threshold of a scenario, electrons."""


def preset_text(result: Calibration) -> str | None:
    """The file as TOML; None if the recordings do not tell the temporal noise.

    What is not known is left out, or taken so that the recordings are reproduced: without a dark
    recording all of the spread in light is PRNU, and a threshold that is not known is the least
    that the noise allows. Comments say so.
    """
    found = result.parameters
    noise = found["interval_noise"].value
    if not isinstance(noise, float) or not found["interval_noise"].known:
        return None
    lines = ["A camera by `viform calibrate`, with limits of 95 %. Use: sensor.preset."]
    threshold = found["threshold"].value
    if not isinstance(threshold, float):
        threshold = min(1 / noise**2 if noise else math.inf, _MOST)
        lines.append(
            "threshold: not known; this is the least that the noise allows, all of it shot noise"
        )
    noise = max(noise, threshold**-0.5)
    sensor: dict[str, Any] = {
        "width": result.shape[1], "height": result.shape[0],
        "clock": Quantity("frequency").write(result.clock.hz),
        "threshold": Quantity("charge").write(threshold),
    }  # fmt: skip
    if found["reset"].known:
        sensor["reset"] = found["reset"].value
    dead = found["dead_time"].value
    if isinstance(dead, float):
        sensor["dead_time"] = Quantity("time").write(dead)
    pattern: dict[str, Any] = {}
    of_threshold: dict[str, Any] = {"interval_noise": noise}
    for names, section in (
        (("prnu", "threshold_fpn", "dsnu", "hot_pixels", "dead_pixels"), pattern),
        (("dark_current", "hot_current"), of_threshold),
    ):
        for name in names:
            value = found[name].value if name in found else None
            if isinstance(value, float):
                section[name] = value
    if "prnu" not in pattern and "gain_spread" in found:
        spread = found["gain_spread"].value
        if isinstance(spread, float):
            pattern["prnu"] = spread
            lines.append("PRNU and spread of the threshold are not told apart: prnu is both")
    if pattern.get("hot_pixels") and "hot_current" not in of_threshold:
        del pattern["hot_pixels"]
    lines += [
        f"{p.name}: {p.text}" if p.known else f"{p.name}: not known; {p.why}"
        for p in found.values()
    ]
    sensor["pattern"] = pattern
    head = "".join(f"# {line}\n" for line in lines)
    return head + tomli_w.dumps({"sensor": sensor, "of_threshold": of_threshold})
