"""Bring-up of a board: a sequence of stages that finds which part works and why another does not.

`bench` holds the board under test, `stages` the checks, `report` the page and the JUnit file, and
`machine` the run of a [board] scenario.

The commands of `viform board` import `bench.endpoint` when the program starts, so nothing is
imported here.
"""
