"""Assembles the machine of a scenario with an [imager]."""

from __future__ import annotations

from cosim import InputError
from cosim.config.toml import to_toml
from cosim.run.folder import check_trace_file
from cosim.run.machine import Options
from imagers.catalogue import IMAGERS
from imagers.machine import ImagerMachine, ImagerStudy
from imagers.run.plan import PlannedRun, RunSpec, plan_run
from scenarios.assemble.schema.scenario import ImagerScenario
from scenarios.assemble.view import make_view


def assemble_imager(name: str, scenario: ImagerScenario, options: Options) -> ImagerMachine:
    """The machine of a scenario. Raises InputError."""
    if scenario.link is None:  # its chip may run on a device
        _refuse_device(options.device)
    if options.trace is not None:
        check_trace_file(options.trace)
    kind = IMAGERS[scenario.imager.kind]
    return ImagerMachine(kind, plan_imager(name, scenario), options.trace)


def assemble_imager_study(name: str, scenario: ImagerScenario, device: str | None) -> ImagerStudy:
    """The study of an imager for `viform plan` and `viform accuracy`. Raises InputError."""
    _refuse_device(device)
    return ImagerStudy(plan_imager(name, scenario))


def plan_imager(name: str, scenario: ImagerScenario) -> PlannedRun:
    """The run of a scenario, planned for its tolerance. Raises InputError."""
    kind = IMAGERS[scenario.imager.kind]
    model = kind.model(scenario.imager, scenario.duration)
    spec = RunSpec(
        name,
        scenario.title,
        kind.name,
        scenario.duration,
        scenario.tolerance,
        scenario.seed,
        to_toml(scenario),
    )
    return plan_run(spec, model, make_view(scenario, model.shape))


def _refuse_device(device: str | None) -> None:
    if device not in (None, "numba"):
        raise InputError(
            "--device", "numba, or absent, for an imager other than a spike camera", repr(device),
            "leave it out: these imagers run on this processor",
        )  # fmt: skip
