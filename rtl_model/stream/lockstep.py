"""Runs the Verilog of a source with its stream beside the cycle model, on the same inputs."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rtl_model.stream.models import array_outputs, external_outputs, lines_outputs
from rtl_model.stream.program import Case
from rtl_model.stream.ring import Beat
from rtl_model.stream.verilated import COLUMNS, VerilatedStream

Numbers = npt.NDArray[np.uint64]


class Outcome(NamedTuple):
    """Result of a run.

    Attributes:
        clocks: number of clocks that were compared.
        outputs: outputs of the model, (clocks, outputs) uint64.
        difference: first clock at which an output differs: clock, output, Verilog, model; None if
            there is none.
    """

    clocks: int
    outputs: Numbers
    difference: tuple[int, str, int, int] | None


def model_outputs(case: Case) -> Numbers:
    """The outputs of the cycle model, (clocks, outputs) uint64, in the order of `COLUMNS`."""
    size, settings, inputs = case.geometry, case.settings, case.inputs
    if case.source == "array":
        return array_outputs(size, settings, inputs)
    if case.source == "external":
        return external_outputs(size, settings, inputs, case.memory, case.latency)
    return lines_outputs(size, settings, inputs)


def run(case: Case, *, sources: Path | None = None) -> Outcome:
    """Compares all outputs at every clock.

    Args:
        case: the source and its inputs.
        sources: folder of the Verilog; the design's if None.
    """
    model = model_outputs(case)
    memory = case.memory if case.source == "external" else None
    with VerilatedStream(
        case.source, case.geometry, case.settings, sources=sources, memory=memory,
        latency=case.latency,
    ) as verilog:  # fmt: skip
        found = verilog.run(case.inputs)
    wrong = np.argwhere(found != model)
    if not len(wrong):
        return Outcome(len(model), model, None)
    clock, column = wrong[0].tolist()
    values = int(found[clock, column]), int(model[clock, column])
    return Outcome(clock, model, (clock, COLUMNS[case.source][column], *values))


def beats(case: Case, outputs: Numbers) -> list[Beat]:
    """The transfers in outputs: where TVALID and TREADY are high."""
    taken = (outputs[:, 0] == 1) & (case.inputs[:, 0] == 1)
    return [Beat(data, bool(last), user) for data, last, user in outputs[taken][:, 1:4].tolist()]
