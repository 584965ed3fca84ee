"""`viform bench code`: sizes of streams in every form, what the statistical code costs, and the
closed forms beside both."""

from scenarios.studies.codes.figure import draw
from scenarios.studies.codes.measure import bench_code
from scenarios.studies.codes.tables import markdown

__all__ = ["bench_code", "draw", "markdown"]
