"""What `viform plan` says of an imager: its plan, and its time by the effects' table of costs."""

from __future__ import annotations

from typing import Any, Final

from cosim.plan.forecast import Speeds, forecast_document
from rtl_model.imagers.run.plan import PlannedRun

__all__ = ["DEVICE", "forecast"]

DEVICE: Final = "numba on this processor"


def forecast(run: PlannedRun) -> dict[str, Any]:
    """The document of `viform plan --json`. Nothing is simulated."""
    plan, exposures, (rows, columns) = run.plan, run.exposures, run.model.shape
    return forecast_document(
        run.spec.name, plan, tier="exact", device=DEVICE, own=0.0,
        speeds=Speeds(plan.cost_ns, plan.full_ns, plan.full_ns, None),
        pixel_cycles=rows * columns * exposures.frames,
        imager=run.spec.kind,
        expected={
            "frames": exposures.frames,
            "lux_seconds": list(exposures.lux_seconds),
            "exposure_s": list(exposures.seconds),
            "photoelectrons": [float(run.summary.darkest), float(run.summary.brightest)],
        },
    )  # fmt: skip
