"""Plan and accuracy of a link, measured without a run."""

from __future__ import annotations

from typing import Any

from cosim.run.progress import Progress
from link.section import LinkScenario
from link.setup.setup import FileLinkSetup, set_up_link
from link.trial.forecast import link_forecast
from link.trial.ladder import link_ladder
from sensor import CameraSetting


class LinkStudy:
    """Study of a link; see `Study`.

    Args:
        name: short name of the scenario.
        scenario: the scenario.
        camera: camera of [sensor], with every effect.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
    """

    def __init__(
        self, name: str, scenario: LinkScenario, camera: CameraSetting, device: str | None
    ) -> None:
        self._name, self._scenario, self._camera, self._device = name, scenario, camera, device

    def _set_up(self, progress: Progress) -> FileLinkSetup:
        return set_up_link(self._scenario, self._camera, self._device, progress)

    def forecast(self, progress: Progress) -> dict[str, Any]:
        return link_forecast(self._name, self._set_up(progress), progress)

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return link_ladder(self._set_up(progress), progress)
