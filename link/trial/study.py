"""A link that is planned and measured without a run of its own."""

from __future__ import annotations

from typing import Any

from cosim.run.progress import Progress
from link.section import LinkScenario
from link.setup.setup import set_up_link
from link.trial.forecast import link_forecast
from link.trial.ladder import link_ladder

__all__ = ["LinkStudy"]


class LinkStudy:
    """See `Study`. device: part of an OpenCL device's name, "numba", or None for the default."""

    def __init__(self, name: str, scenario: LinkScenario, device: str | None) -> None:
        self._name, self._scenario, self._device = name, scenario, device

    def forecast(self, progress: Progress) -> dict[str, Any]:
        setup = set_up_link(self._scenario, self._device, progress)
        return link_forecast(self._name, setup, progress)

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return link_ladder(set_up_link(self._scenario, self._device, progress), progress)
