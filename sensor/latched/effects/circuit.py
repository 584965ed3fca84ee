"""Effects of a pixel's circuit on its rate: overshoot of the comparator, and leak.

The reference tier integrates the circuit itself. The other tiers use its lumped form
(sensor/circuit/lumped.py): dead time, electrons beyond each threshold, and a negative dark current.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Final

from pydantic import Field

from cosim.errors import InputError
from cosim.plan.effects import Bound, Summary
from sensor.circuit.circuit import CircuitSection
from sensor.circuit.lumped import lump
from sensor.latched.effects.effect import (
    ALL_PIXELS,
    Key,
    Operation,
    PixelEffect,
    Setting,
    circuit_cost,
)
from sensor.latched.effects.windows import bound_of, light_contrast, shift_error

FAINTEST: Final = 1e-3
"""Lowest rate, spikes a cycle, for which the lumped form holds."""


class _Overshoot(PixelEffect):
    """Overshoot. It also turns the section [sensor.circuit] into the parameters of both effects."""

    name = "comparator overshoot"
    source = "comparator of one pole on a ramp: late by trip / (gain x slope)"
    group = "circuit"
    parameters: ClassVar = {"circuit": None, "overshoot": 0.0, "lumped_error": 0.0}
    keys: ClassVar = {
        "circuit": Key(
            CircuitSection | None,
            Field(
                default=None,
                description="capacitance, leak, comparator and reset of a synchronous pixel",
            ),
            pixels=ALL_PIXELS,
            reported=False,
            section=True,
        )
    }

    def configure(self, section: Any, operation: Operation) -> Mapping[str, Any]:
        """The circuit, and its lumped form for rates from FAINTEST to one spike a cycle."""
        if section.circuit is None:
            return {}
        if section.reset != "residual":
            raise InputError(
                "sensor.reset", "residual with sensor.circuit: its own switch resets the pixel",
                section.reset, "leave one of them out",
            )  # fmt: skip
        if section.dead_time > 0:
            raise InputError(
                "sensor.dead_time", "0 with sensor.circuit, whose reset_time it is",
                f"{section.dead_time:g} s", "leave one of them out",
            )  # fmt: skip
        circuit, threshold = section.circuit.circuit, operation.threshold
        most, period = threshold * operation.clock.hz, float(operation.clock.period)
        try:
            lumped = lump(circuit, threshold, FAINTEST * most, most)
        except ValueError as exc:
            raise InputError(
                "sensor.circuit",
                "one that the pixel can work with",
                f"one whose {exc}",
                "change the value named",
            ) from exc
        if not (lumped.bound < 1 and lumped.dead_time <= period):
            raise InputError(
                "sensor.circuit", f"one that fires at {FAINTEST:g} to 1 spike a cycle and is ready "
                f"again within a cycle, {period:g} s", "one that does not", "raise leak or "
                "bandwidth, or lower trip or reset_time",
            )  # fmt: skip
        if not abs(lumped.shift) < threshold / 2:
            raise InputError(
                "sensor.circuit",
                f"one whose comparator overshoots by less than half the threshold, "
                f"{threshold / 2:g} e", f"one that does by {lumped.shift:g} e",
                "lower trip, or raise gain",
            )  # fmt: skip
        return {
            "circuit": circuit, "dead_time": lumped.dead_time, "overshoot": lumped.shift,
            "leak": lumped.dark_current, "lumped_error": lumped.bound,
        }  # fmt: skip

    def acts(self, setting: Setting) -> bool:
        return bool(setting.overshoot)

    def removed(self, setting: Setting) -> Mapping[str, Any]:
        return {"overshoot": 0.0}

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # The rate is light / (Q + overshoot). Without overshoot it is higher by the share
        # overshoot / Q.
        share = abs(setting.overshoot) / scene.threshold
        shift = share * scene.brightest * scene.cycles / scene.threshold
        return bound_of(scene, share * light_contrast(scene) + shift_error(scene, shift), True)

    def cost(self, scene: Summary) -> Any:
        return circuit_cost(scene)

    def threshold_shift(self, setting: Setting) -> float:
        return float(setting.overshoot)


class _Leak(PixelEffect):
    name = "leak"
    source = "mean of Q V(t) / tau over an interval: threshold / (2 tau) (sensor/circuit/lumped.py)"
    group = "circuit"
    parameters: ClassVar = {"leak": 0.0}

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        lost = abs(setting.leak * float(setting.clock.period))
        moved = shift_error(scene, lost * scene.cycles / scene.threshold)
        return bound_of(scene, scene.relative(lost) + moved, True)

    def cost(self, scene: Summary) -> Any:
        return circuit_cost(scene)

    def lumped_dark(self, setting: Setting) -> float:
        return float(setting.leak)


OVERSHOOT, LEAK = _Overshoot(), _Leak()
