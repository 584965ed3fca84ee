"""`viform bench code`: sizes of streams in every form, what the statistical code costs, and the
closed forms beside both."""

from scenarios.code_bench.figure import draw
from scenarios.code_bench.measure import bench_code
from scenarios.code_bench.tables import markdown

__all__ = ["bench_code", "draw", "markdown"]
