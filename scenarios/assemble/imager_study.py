"""An imager that is planned and measured without a run of its own."""

from __future__ import annotations

from typing import Any

from cosim.run.progress import Progress
from rtl_model.imagers.run.accuracy import accuracy_imager
from rtl_model.imagers.run.kinds import machine_of
from rtl_model.imagers.run.planning import forecast_imager
from scenarios.assemble.scenario import ImagerScenario

__all__ = ["ImagerStudy"]


class ImagerStudy:
    """See `Study`."""

    def __init__(self, name: str, scenario: ImagerScenario) -> None:
        self._name, self._scenario, self._machine = name, scenario, machine_of(scenario)

    def forecast(self, progress: Progress) -> dict[str, Any]:
        return forecast_imager(self._name, self._scenario, self._machine)

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return accuracy_imager(self._name, self._scenario, self._machine, progress)
