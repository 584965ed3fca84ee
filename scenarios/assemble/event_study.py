"""An asynchronous camera that is planned and measured without a run of its own."""

from __future__ import annotations

from typing import Any

from cosim.run.progress import Progress
from scenarios.assemble.event_accuracy import accuracy_events
from scenarios.assemble.event_forecast import forecast_events
from scenarios.assemble.scenario import Scenario

__all__ = ["AsynchronousStudy"]


class AsynchronousStudy:
    """See `Study`."""

    def __init__(self, name: str, scenario: Scenario) -> None:
        self._name, self._scenario = name, scenario

    def forecast(self, progress: Progress) -> dict[str, Any]:
        return forecast_events(self._name, self._scenario)

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return accuracy_events(self._scenario, progress)
