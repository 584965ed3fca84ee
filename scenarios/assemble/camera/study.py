"""A latched camera that is planned and measured without a run."""

from __future__ import annotations

from typing import Any

from cosim.run.progress import Progress
from scenarios.assemble.camera.boards import refuse_boards
from scenarios.assemble.camera.every_tile import every_tile
from scenarios.assemble.camera.forecast import forecast
from scenarios.assemble.camera.ladder import accuracy
from scenarios.assemble.camera.memory import check_run_memory
from scenarios.assemble.camera.setup import set_up_camera
from scenarios.assemble.schema.scenario import Scenario


class LatchedStudy:
    """Implements `Study`. Raises InputError for a camera that cannot be simulated."""

    def __init__(self, name: str, scenario: Scenario, device: str | None) -> None:
        refuse_boards(scenario)
        self._name, self._setup = name, set_up_camera(scenario, device)
        check_run_memory(self._setup)

    def forecast(self, progress: Progress) -> dict[str, Any]:
        return forecast(self._name, self._setup)

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return accuracy(self._setup, progress)

    def every_tile(self, progress: Progress) -> dict[str, Any]:
        """The document of `viform accuracy --every-tile`."""
        return every_tile(self._setup, progress)
