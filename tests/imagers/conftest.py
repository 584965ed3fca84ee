"""Fixtures of the imagers' tests: the command line in this process."""

from tests.scenarios.conftest import viform as viform
