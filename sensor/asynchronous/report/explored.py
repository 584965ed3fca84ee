"""The explorer of an asynchronous stream: its spikes as planes of a clock, beside true light."""

from __future__ import annotations

from typing import Final

import numpy as np

from cosim.clock import Clock
from cosim.config.amounts import amount, count
from cosim.report.explorer import INSTANTS, Truths, explorer_part, span_of
from cosim.spikes.clocked import ClockedEvents, HeldPlanes
from cosim.spikes.events import only_full
from cosim.spikes.held import held_events
from cosim.spikes.staged import StagedStream
from sensor.asynchronous.run import EventRun

_SPIKES: Final = 16
"""Spikes of white within the window of TFP, about."""
_ENOUGH: Final = 1024
"""Cycles of a short run, at most: with more of them a page has fewer pixels."""


def _clock(judged: EventRun, clock: Clock) -> tuple[Clock, int]:
    """The clock of the planes and its cycles: sensor.clock times the largest power of two with
    which the run has at most `_ENOUGH`."""
    cycles = judged.spec.cycles
    while 2 * cycles <= _ENOUGH:
        clock, cycles = Clock(2 * clock.num, clock.den), 2 * cycles
    return clock, cycles


def events_explorer(judged: EventRun) -> str:
    """HTML of the section; "" for targets of steady light, whose decades no planes of one clock can
    show."""
    if judged.views.recovered:
        return ""
    spec, events = judged.spec, judged.views.events
    clock, cycles = _clock(judged, spec.setting.clock)
    light = spec.illuminance * spec.lens.gain * spec.setting.electrons_per_lux
    white = float(f"{min(light / spec.model.threshold / clock.hz, 1.0):.4g}")
    told = [f"The page has spikes latched at {amount(clock.hz, 'Hz')}."]
    stage: ClockedEvents | HeldPlanes
    if spec.model.change > 0:
        stage = held_events(events, clock, cycles)
        told.append(
            "The camera sends an event only where a width has changed: until its next event a "
            "pixel fires here at the rate of the last one, once a cycle at most."
        )
    else:
        full, partial = only_full(events)
        stage = ClockedEvents(full, clock, cycles)
        if partial:
            told.append(f"{count(partial)} readings of charge below the threshold are left out.")
    at = cycles // 2
    first, stop = span_of(cycles, at)
    instants = np.unique(np.linspace(first, stop - 1, INSTANTS).round().astype(int)).tolist()
    truths = Truths(instants, [spec.source.truth(clock.middle(k)) for k in instants])
    window = min(2 * int(_SPIKES / max(white, 1e-9) / 2) + 1, 1001)
    stream = StagedStream(stage, spec.shape, cycles, clock)
    part = explorer_part(stream, at, white, window, truths, told=False)
    if isinstance(stage, ClockedEvents) and stage.lost:
        told.append(
            f"{count(stage.lost)} of {count(stage.lost + stage.spikes)} spikes came in a cycle in "
            "which their pixel had fired already: they are missing here, not in the recording."
        )
    return f"<h2>Explore the stream</h2><p>{' '.join(told)}</p>{part}"
