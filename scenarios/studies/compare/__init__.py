"""One scene before all imagers, the spike camera among them, measured side by side."""

from scenarios.studies.compare.run import run_compare
from scenarios.studies.compare.setting import load_comparison

__all__ = ["load_comparison", "run_compare"]
