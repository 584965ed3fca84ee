"""Comparison of all imagers, including the spike camera, for one scene."""

from scenarios.studies.compare.run import run_compare
from scenarios.studies.compare.setting import load_comparison

__all__ = ["load_comparison", "run_compare"]
