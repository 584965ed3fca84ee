"""Runs of one scenario over values of its keys, on the workers of Dask."""

from scenarios.studies.batch.axes import read_axis
from scenarios.studies.sweep.sweep import Sweep, run_sweep

__all__ = ["Sweep", "read_axis", "run_sweep"]
