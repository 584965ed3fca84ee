"""The setting of a simulated display: panel, observer, and resolution in time."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from cosim.plan.effects import Effect
from display.effects import SPANS, emission_effect, planes_effect, row_timing_effect
from display.observe.views import Observer, Views, panel_views
from display.panels.panel import SpikePanel

MOTION: Final = 1.0
"""Maximum motion of light on the retina of a pursuing eye within a span of planes, pixels. With
0.5, the PSNR of the scenario `glass` is the same within 0.1 dB."""


@dataclass(frozen=True)
class DisplaySetting:
    """A display and its simulated effects.

    Attributes:
        panel: panel with every effect.
        observer: observer whose radiance the error refers to.
        batch: number of planes in a span of light, 1 to 64.
        row_timing: whether each row is shown at its own instant.
    """

    panel: SpikePanel
    observer: Observer
    batch: int = 1
    row_timing: bool = True

    @property
    def simulated_panel(self) -> SpikePanel:
        """The panel with the simulated timing of its rows."""
        return self.panel if self.row_timing else replace(self.panel, row_scan=0.0)

    def views(self, first: int, planes: int) -> Views:
        """The views of the observer for planes `first` to `first + planes`."""
        return panel_views(self.observer, self.simulated_panel, first, planes, self.batch)

    def with_spans(self, velocity: float, most: int) -> DisplaySetting:
        """The setting with spans short enough for a pursuing eye (`MOTION`).

        Args:
            velocity: velocity of the eye along the rows, pixels/s.
            most: maximum number of planes in two spans, if a span has more than one plane.
        """
        batch, step = self.batch, abs(velocity) / self.panel.clock.hz
        while batch > 1 and (batch * step > MOTION or 2 * batch > most):
            batch //= 2
        return replace(self, batch=batch)

    @property
    def acting_effects(self) -> tuple[Effect, ...]:
        """The effects that this setting simulates and that change the light."""
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
        """The setting without these effects, by their names in `acting_effects`; other names are
        ignored. A span grows only if all shorter spans are left out too."""
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
