"""A display as it is simulated: panel, observer, and resolution in time."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from cosim.plan.effects import Effect
from display.effects import SPANS, emission_effect, planes_effect, row_timing_effect
from display.observe.views import Observer, Views, panel_views
from display.panels.panel import SpikePanel

__all__ = ["DisplaySetting"]

MOTION: Final = 1.0
"""Pixels that light may move on a pursuing eye's retina within a span of planes. With 0.5 the
PSNR of the scenario `glass` is the same to 0.1 dB."""


@dataclass(frozen=True)
class DisplaySetting:
    """A display and what is simulated of it.

    Attributes:
        panel: with every effect.
        observer: whose radiance the error is of.
        batch: planes to a span of light, 1 to 64.
        row_timing: whether rows are shown at their own instants.
    """

    panel: SpikePanel
    observer: Observer
    batch: int = 1
    row_timing: bool = True

    @property
    def simulated_panel(self) -> SpikePanel:
        """The panel with the timing of its rows that is simulated."""
        return self.panel if self.row_timing else replace(self.panel, row_scan=0.0)

    def views(self, first: int, planes: int) -> Views:
        """Of the observer, for planes `first` to `first + planes`."""
        return panel_views(self.observer, self.simulated_panel, first, planes, self.batch)

    def with_spans(self, velocity: float, most: int) -> DisplaySetting:
        """The setting with spans short enough for a pursuing eye (`MOTION`).

        Args:
            velocity: of the eye along the rows, pixels/s.
            most: planes in two spans, at most, where a span is longer than one.
        """
        batch, step = self.batch, abs(velocity) / self.panel.clock.hz
        while batch > 1 and (batch * step > MOTION or 2 * batch > most):
            batch //= 2
        return replace(self, batch=batch)

    @property
    def acting_effects(self) -> tuple[Effect, ...]:
        """Every effect that acts in this setting."""
        effects = [
            planes_effect(self.panel, self.observer, fine, coarse)
            for fine, coarse in pairwise(SPANS)
            if self.batch < coarse
        ]
        if self.row_timing and self.panel.row_scan > 0:
            effects.append(row_timing_effect(self.panel, self.observer))
        if max(self.panel.rise, self.panel.decay) > 0:
            effects.append(emission_effect(self.panel, self.observer))
        return tuple(effects)

    def without(self, names: Collection[str]) -> DisplaySetting:
        """The setting with these effects left out, named as in `acting_effects`; other names are
        ignored. Spans grow as far as every shorter one is left out as well."""
        batch = self.batch
        for span in SPANS:
            if span > batch:
                if f"planes within {span}" not in names:
                    break
                batch = span
        panel = self.panel
        if "emission rise and decay" in names:
            panel = replace(panel, rise=0.0, decay=0.0)
        return replace(
            self, panel=panel, batch=batch, row_timing=self.row_timing and "row timing" not in names
        )
