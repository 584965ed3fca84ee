"""`viform bench code`: sizes of streams in every format, the loss of the statistical code, and
their closed forms."""

from scenarios.studies.codes.measure import bench_code
from scenarios.studies.codes.tables import draw, markdown

__all__ = ["bench_code", "draw", "markdown"]
