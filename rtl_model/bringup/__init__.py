"""Bring-up of a board: a sequence of stages that finds which part works and why another does not.

`bench` holds the board under test, `stages` the checks, `report` the page and the JUnit file, and
`machine` the run of a [board] scenario.
"""

from rtl_model.bringup.bench.stage import Stage
from rtl_model.bringup.run import BringUp, bring_up

__all__ = ["BringUp", "Stage", "bring_up"]
