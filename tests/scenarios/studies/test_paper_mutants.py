"""`viform paper` sees faults of the simulation: rows that stood on copied constants would hold."""

from __future__ import annotations

import random
import sys
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


def scaled_property(factor: float) -> Fault:
    return lambda right: property(lambda self: right.fget(self) * factor)


ADAPTIVE, RECONSTRUCT = "imagers.adaptive", "sensor.reconstruct.intervals"
EBAPS, EMCCD = "imagers.ebaps", "imagers.emccd"
RANGE = "imagers.hardware_chain"

MUTANTS: dict[str, list[tuple[str, str, Fault]]] = {
    "000": [
        ("cosim.light.radiometry", "photons_per_lux", scaled(1.03)),
        ("sensor.asynchronous.pixel.array", "AsynchronousPixels.rate", scaled(1.05)),
        ("sensor.latched.pixel.interval", "interval_table",
         lambda right: lambda q: right(q * 0.8)),
        ("sensor.device.chips", "Chip.electrons_per_lux", scaled(0.97)),
        ("sensor.latched.pixel.model", "ExactModel.q",
         lambda right: property(lambda self: right.fget(self) * 2)),
        (RECONSTRUCT, "isi", moved(1)),
        (RECONSTRUCT, "interval_rate", lambda right: lambda tau: right(tau) ** 2),
        ("cosim.spikes.viform", "count_spikes", lambda right: lambda *args: right(*args) // 2),
        ("sensor.codec.trains", "without_transitions", lambda right: lambda train: train),
    ],
    "001": [
        ("imagers.adaptive.pixels.setting", "CmosSetting.value",
         lambda right: lambda self, *args: (right(self, *args)[0] & ~1, right(self, *args)[1])),
        ("imagers.adaptive.pixels.setting", "CmosSetting.volts", scaled(1.1)),
        (f"{ADAPTIVE}.device.decision", "lengthening",
         lambda right: lambda value: min(right(value), 64)),
        (f"{ADAPTIVE}.device.decision", "lengthening",
         lambda right: lambda value: right(max(value, 1))),
        (f"{ADAPTIVE}.device.decision", "shortened", fixed(1)),
        (f"{ADAPTIVE}.device.timing", "Timing.period", scaled(2)),
        (f"{ADAPTIVE}.device.signals", "ring", lambda right: lambda n, rows, code: n),
        (f"{ADAPTIVE}.device.loop", "shortest_exposure", scaled(3)),
    ],
    "002": [
        (f"{EBAPS}.board.timing", "region_bytes", fixed(1280 * 1024)),
        ("imagers.ebaps.pixels.array", "EbapsPixels.convert",
         lambda right: lambda *args: np.minimum(right(*args), 4095)),
        (f"{EBAPS}.board.cameralink", "deserialise", lambda right: lambda bits: right(bits) >> 1),
        (f"{EBAPS}.device.exposure", "ExposureRule.after",
         lambda right: lambda self, exposure, mean, steps: exposure),
        (f"{EBAPS}.board.timing", "Timing.vsync", scaled(2)),
        (f"{EBAPS}.device.drive", "drive_records",
         lambda right: lambda *args: [r for r in right(*args) if r.signal != "rst"]),
        ("imagers.ebaps.pixels.contrast", "recognisable", fixed(True)),
    ],
    "003": [
        (f"{EMCCD}.device.timing", "frame_clocks", fixed(10**5)),
        (f"{EMCCD}.device.sequencer", "Cycle.transfer", scaled_property(0.5)),
        (f"{EMCCD}.device.sequencer", "Cycle.exposure_end", scaled_property(1.01)),
        ("imagers.emccd.pixels.array", "EmccdPixels.convert",
         lambda right: lambda *args: np.minimum(right(*args), 4095)),
        ("imagers.emccd.pixels.wells", "spill_lines", fixed(None)),
        ("imagers.emccd.pixels.multiplication", "HighVoltage.volts", moved(1.0)),
        (f"{EMCCD}.device.sequencer", "Cycle.after", scaled_property(2)),
        (f"{EMCCD}.device.sine_drive", "word_edges",
         lambda right: lambda edge, code: right(edge, code & ~1)),
        (f"{EMCCD}.device.sine_drive", "SineDrive.loop_gain", scaled(0.5)),
        (f"{EMCCD}.device.sine_drive", "SineDrive.efficiency", scaled_property(1.01)),
        (f"{EMCCD}.device.supplies", "Supplies.rails",
         lambda right: property(lambda self: right.fget(self)[::-1])),
    ],
    "004": [
        ("sensor.dynamic_range.parts", "decibels", fixed(10.0)),
        ("sensor.dynamic_range.parts", "sensor_dynamic_range", moved(1.0)),
        ("sensor.dynamic_range.parts", "SensorNoise.at", scaled(1.1)),
        ("sensor.dynamic_range.chain", "gain_counted_once", moved(3.0)),
        ("sensor.dynamic_range.parts", "as_ratio", scaled(1.5)),
        ("sensor.dynamic_range.chain", "Chain.floor", scaled_property(1.2)),
        (f"{RANGE}.pixels", "ChainPixels.slope", scaled_property(1.001)),
        ("sensor.dynamic_range.parts", "SensorNoise.parts",
         lambda right: lambda self, celsius, *rest: right(self, 25.0, *rest)),
        ("cosim.compute.draws", "normal", scaled(1.03)),
        (f"{RANGE}.pixels", "Ripple.at", scaled(1.1)),
        (f"{RANGE}.pixels", "Ripple._per_cycle", scaled_property(1.01)),
    ],
}  # fmt: skip
"""Document: module that defines a name, the name, and the fault."""
PACKAGES = ("cosim", "sensor", "rtl_model", "imagers", "scenarios")
ALL = [(document, *mutant) for document, some in MUTANTS.items() for mutant in some]


@pytest.fixture(scope="module", autouse=True)
def sound() -> None:
    """Without a fault every row holds. It also loads all modules: one that is loaded while a fault
    is planted would keep it."""
    assert all(row.holds for row in paper_rows())


def found(module: str, name: str) -> tuple[Any, str, Any]:
    """The owner of a name, its last part, and what it stands for."""
    *path, last = name.split(".")
    owner = reduce(getattr, path, import_module(module))
    right = owner.__dict__[last] if isinstance(owner, type) else getattr(owner, last)
    return owner, last, right


def planted(monkeypatch: pytest.MonkeyPatch, module: str, name: str, fault: Fault) -> None:
    """Replaces a method in its class, and a function in every module of the program that has it, as
    if its code were changed."""
    owner, last, right = found(module, name)
    wrong = fault(right)
    monkeypatch.setattr(owner, last, wrong)
    for label, other in list(sys.modules.items()):
        if label.split(".")[0] in PACKAGES and vars(other).get(last) is right:
            monkeypatch.setattr(other, last, wrong)


def holds(document: str) -> bool:
    return all(row.holds for row in paper_rows((document,)))


def test_there_are_mutants_of_every_document_in_the_code_of_the_simulation() -> None:
    assert set(MUTANTS) == set(DOCUMENTS) and len(ALL) >= 40
    for _, module, name, _ in ALL:
        owner, _, right = found(module, name)
        assert module.split(".")[0] in PACKAGES[:-1] and not module.endswith(".paper")
        assert (owner if isinstance(owner, type) else right).__module__ == module


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
    planted(monkeypatch, module, name, fault)
    assert not holds(document)
