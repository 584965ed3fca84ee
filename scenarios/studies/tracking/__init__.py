"""Detection, tracking and flow of fast motion, by spikes and by frames in the same light."""

from scenarios.studies.tracking.conditions import Conditions
from scenarios.studies.tracking.study import (
    run_tracking,
    tracking_document,
    tracking_figure,
    tracking_table,
)

__all__ = ["Conditions", "run_tracking", "tracking_document", "tracking_figure", "tracking_table"]
