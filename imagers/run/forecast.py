"""The forecast of `viform plan` for an imager: its plan, and the run time predicted from the cost
table of the effects."""

from __future__ import annotations

from typing import Any, Final

from cosim.plan.forecast import Speeds, forecast_document
from imagers.run.plan import PlannedRun

__all__ = ["DEVICE", "forecast"]

DEVICE: Final = "numba on this processor"


def forecast(run: PlannedRun) -> dict[str, Any]:
    """The document of `viform plan --json`. Nothing is simulated."""
    plan, exposures, (rows, columns) = run.plan, run.exposures, run.model.shape
    return forecast_document(
        run.spec.name, plan, tier="exact", device=DEVICE, tier_error=0.0,
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
