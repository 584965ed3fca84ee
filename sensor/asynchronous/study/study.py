"""An asynchronous camera that is planned and measured without a run of its own."""

from __future__ import annotations

from typing import Any

from cosim.light.steps import light_steps
from cosim.run.progress import Progress
from sensor.asynchronous.run import EventSpec, EventStart
from sensor.asynchronous.study.forecast import forecast_events
from sensor.asynchronous.study.ladder import measure_ladder


class AsynchronousStudy:
    """See `Study`."""

    def __init__(self, spec: EventSpec) -> None:
        steps = light_steps(spec.source, spec.relay, spec.setting.clock, spec.stop)
        light, _, until = next(steps)
        self.start = EventStart.under(spec, light, until)

    def forecast(self, progress: Progress) -> dict[str, Any]:
        return forecast_events(self.start)

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return measure_ladder(self.start, progress)
