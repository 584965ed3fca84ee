"""`viform paper` sees faults of the simulation: rows that stood on copied constants would hold."""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import reduce
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from scenarios.studies.paper import DOCUMENTS, paper_rows

Fault = Callable[[Any], Any]
"""From what a name stands for to what it stands for in the mutant."""


def scaled(factor: float) -> Fault:
    """A function whose result is this many times as large."""
    return lambda right: lambda *args, **more: right(*args, **more) * factor


def moved(by: float) -> Fault:
    """A function whose result is larger by `by`."""
    return lambda right: lambda *args, **more: right(*args, **more) + by


def fixed(value: Any) -> Fault:
    """A function that always returns this."""
    return lambda right: lambda *args, **more: value


def number(value: Any) -> Fault:
    return lambda right: value


def scaled_property(factor: float) -> Fault:
    return lambda right: property(lambda self: right.fget(self) * factor)


PRINCIPLE, ADAPTIVE = "scenarios.studies.paper.spike_principle", "rtl_model.imagers.adaptive"
EBAPS, EMCCD = "rtl_model.imagers.ebaps", "rtl_model.imagers.emccd"
RANGE = "rtl_model.imagers.hardware_chain"

MUTANTS: dict[str, list[tuple[str, str, Fault]]] = {
    "000": [
        ("sensor.dynamic_range.spike", "photons_per_lux", scaled(1.03)),
        ("sensor.asynchronous.pixel.array", "AsynchronousPixels.rate", scaled(1.05)),
        ("sensor.asynchronous.pixel.array", "interval_table",
         lambda right: lambda q: right(q * 0.8)),
        ("sensor.device.chips", "Chip.electrons_per_lux", scaled(0.97)),
        ("sensor.latched.pixel.model", "ExactModel.q",
         lambda right: property(lambda self: right.fget(self) * 2)),
        (PRINCIPLE, "isi", moved(1)),
        ("scenarios.studies.paper.spike_chips", "isi", moved(1)),
        (PRINCIPLE, "interval_rate", lambda right: lambda tau: right(tau) ** 2),
        (PRINCIPLE, "without_transitions", lambda right: lambda train: train),
    ],
    "001": [
        ("sensor.imagers.cmos.setting", "ROUNDING", number(2.0)),
        ("sensor.imagers.cmos.setting", "CmosSetting.volts", scaled(1.1)),
        (f"{ADAPTIVE}.device.decision", "lengthening", fixed(2)),
        (f"{ADAPTIVE}.paper", "lengthening", fixed(2)),
        (f"{ADAPTIVE}.paper", "shortened", fixed(1)),
        (f"{ADAPTIVE}.device.timing", "Timing.period", scaled(2)),
        (f"{ADAPTIVE}.device.switching", "ring", lambda right: lambda n, rows, code: n),
        (f"{ADAPTIVE}.device.loop", "shortest_exposure", scaled(3)),
    ],
    "002": [
        (f"{EBAPS}.paper", "region_bytes", fixed(1280 * 1024)),
        ("sensor.imagers.ebaps.pixels", "EbapsPixels.convert",
         lambda right: lambda *args: np.minimum(right(*args), 4095)),
        (f"{EBAPS}.paper", "deserialise", lambda right: lambda bits: right(bits) >> 1),
        (f"{EBAPS}.device.exposure", "ExposureRule.after",
         lambda right: lambda self, exposure, mean, steps: exposure),
        (f"{EBAPS}.board.timing", "Timing.vsync", scaled(2)),
        (f"{EBAPS}.paper", "drive_records",
         lambda right: lambda frames: [r for r in right(frames) if r.signal != "rst"]),
        (f"{EBAPS}.paper", "recognisable", fixed(True)),
    ],
    "003": [
        (f"{EMCCD}.paper", "frame_clocks", fixed(10**5)),
        (f"{EMCCD}.device.sequencer", "Cycle.transfer", scaled_property(0.5)),
        (f"{EMCCD}.device.sequencer", "Cycle.exposure_end", scaled_property(1.01)),
        ("sensor.imagers.emccd.pixels", "EmccdPixels.convert",
         lambda right: lambda *args: np.minimum(right(*args), 4095)),
        (f"{EMCCD}.paper", "spill_lines", fixed(None)),
        (f"{EMCCD}.paper", "HighVoltage.volts", moved(1.0)),
        (f"{EMCCD}.device.sequencer", "Cycle.after", scaled_property(2)),
        (f"{EMCCD}.paper", "word_edges", lambda right: lambda edge, code: right(edge, code & ~1)),
        (f"{EMCCD}.device.sine_drive", "SineDrive.loop_gain", scaled(0.5)),
        (f"{EMCCD}.device.sine_drive", "SineDrive.efficiency", scaled_property(1.01)),
        (f"{EMCCD}.device.supplies", "Supplies.rails",
         lambda right: property(lambda self: right.fget(self)[::-1])),
    ],
    "004": [
        (f"{RANGE}.paper", "decibels", fixed(10.0)),
        (f"{RANGE}.paper", "sensor_dynamic_range", moved(1.0)),
        ("sensor.dynamic_range.noise", "SensorNoise.at", scaled(1.1)),
        (f"{RANGE}.paper", "gain_counted_once", moved(3.0)),
        (f"{RANGE}.paper", "as_ratio", scaled(1.5)),
        ("sensor.dynamic_range.chain", "Chain.floor", scaled_property(1.2)),
        (f"{RANGE}.pixels", "ChainPixels.slope", scaled_property(1.001)),
        ("sensor.dynamic_range.noise", "SensorNoise.parts",
         lambda right: lambda self, celsius, *rest: right(self, 25.0, *rest)),
        (f"{RANGE}.pixels", "normal", scaled(1.03)),
        (f"{RANGE}.ripple", "Ripple.at", scaled(1.1)),
        (f"{RANGE}.ripple", "Ripple._per_cycle", scaled_property(1.01)),
    ],
}  # fmt: skip
"""Document: module, name in it, and fault."""
ALL = [(document, *mutant) for document, some in MUTANTS.items() for mutant in some]


def planted(monkeypatch: pytest.MonkeyPatch, module: str, name: str, fault: Fault) -> None:
    *path, last = name.split(".")
    owner = reduce(getattr, path, import_module(module))
    right = owner.__dict__[last] if isinstance(owner, type) else getattr(owner, last)
    monkeypatch.setattr(owner, last, fault(right))


def holds(document: str) -> bool:
    try:
        return all(row.holds for row in paper_rows((document,)))
    except (ValueError, RuntimeError, IndexError):  # a loop that gets nowhere says so
        return False


def test_there_are_mutants_of_every_document() -> None:
    assert set(MUTANTS) == set(DOCUMENTS) and len(ALL) >= 20


@pytest.mark.parametrize("document", MUTANTS)
def test_a_fault_chosen_at_random_makes_rows_fail(
    document: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, name, fault = random.SystemRandom().choice(MUTANTS[document])
    planted(monkeypatch, module, name, fault)
    assert not holds(document), f"the fault in {module}.{name} is not seen"


@pytest.mark.slow
@pytest.mark.parametrize(("document", "module", "name", "fault"), ALL)
def test_every_fault_makes_rows_fail(
    document: str, module: str, name: str, fault: Fault, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert holds(document)
    planted(monkeypatch, module, name, fault)
    assert not holds(document)
