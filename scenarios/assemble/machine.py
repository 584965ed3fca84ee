"""Assembles the machine of a scenario. Only this file distinguishes the kinds of scenarios.

The modules of a machine are imported in the function that assembles it: compiled pixels, OpenCL and
the Verilog tools take seconds to load.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from cosim import InputError
from cosim.config.toml import to_toml
from cosim.files import STORES
from cosim.run.inputs import PIPE
from cosim.run.machine import REPORTS, Machine, Options, Study
from cosim.run.progress import Progress
from cosim.run.workers import check_workers
from scenarios.assemble.memory import check_need
from scenarios.assemble.pixel_kinds import refuse_device, refuse_leftovers
from scenarios.assemble.schema.loading import filmed
from scenarios.assemble.schema.scenario import (
    AnyScenario,
    BoardScenario,
    ImagerScenario,
    LinkScenario,
    RecordingScenario,
    Scenario,
    StreamScenario,
)

if TYPE_CHECKING:
    from scenarios.assemble.source.feeds import Feed


def check_options(scenario: AnyScenario, options: Options) -> None:
    """Raises InputError for options and sections that a scenario of this kind does not use."""
    if isinstance(scenario, Scenario):
        refuse_leftovers(scenario)
    if options.store not in STORES:
        raise InputError("--store", f"one of {', '.join(STORES)}", options.store, "choose one")
    if options.report not in REPORTS:
        raise InputError("--report", f"one of {', '.join(REPORTS)}", options.report, "choose one")
    _check_workers(scenario, options)
    piped = isinstance(scenario, RecordingScenario) and scenario.sensor.source.startswith(PIPE)
    if piped and options.resume:
        raise InputError(
            "--resume", "given for a source that can be read again", "given for a pipe",
            "leave it out, and give another --out",
        )  # fmt: skip
    if not isinstance(scenario, BoardScenario | ImagerScenario) and options.trace is not None:
        raise InputError(
            "--trace", "given with a scenario of a virtual board or of another imager",
            "with one of a spike camera or a link", "run bring-up, or leave it out",
        )  # fmt: skip


def _check_workers(scenario: AnyScenario, options: Options) -> None:
    """Raises InputError for workers of a camera whose rows cannot be simulated apart."""
    check_workers(options.workers)
    if options.workers is None and options.scheduler is None:
        return
    if not isinstance(scenario, Scenario) or scenario.sensor.pixel != "latched":
        raise InputError(
            "--workers and --scheduler", "given with a latched spike camera", "with another one",
            "leave them out",
        )  # fmt: skip
    from scenarios.assemble.source.latched.bands import refuse_bands

    refuse_bands(scenario)


def assemble(name: str, scenario: AnyScenario, options: Options, progress: Progress) -> Machine:
    """The machine of a scenario, checked and planned. Raises InputError."""
    check_options(scenario, options)
    need = check_need(scenario)
    readout = None
    if getattr(scenario, "readout", None) is not None:
        from scenarios.assemble.behind.readout import readout_of

        readout = readout_of(scenario)  # refused before the machine is assembled: that takes longer
    machine = _assemble(name, scenario, options, progress)
    if need is not None:
        progress.note(need)
    if readout is None:
        return machine
    from scenarios.assemble.behind.readout import with_readout

    return with_readout(readout, machine, options.device)


def _assemble(name: str, scenario: AnyScenario, options: Options, progress: Progress) -> Machine:
    """The machine of a scenario without its [readout]."""
    device = options.device
    if isinstance(scenario, LinkScenario):
        from scenarios.assemble.source.link import assemble_link

        return assemble_link(name, scenario, device, progress)
    if isinstance(scenario, BoardScenario):
        from rtl_model.bringup.machine.machine import BoardMachine

        return BoardMachine(scenario.board, scenario.seed, to_toml(scenario), options.trace)
    if isinstance(scenario, RecordingScenario):
        from scenarios.assemble.source.recording.opening import is_live

        if scenario.link is None:
            refuse_device("a recorded stream", device)
        if is_live(scenario.sensor):
            from scenarios.assemble.behind.live import assemble_live

            return assemble_live(name, scenario, device, progress)
    machine, feed = _source(name, scenario, options)
    if scenario.display is None and scenario.link is None:
        return machine
    from scenarios.assemble.behind.machine import with_behind

    try:
        return with_behind(scenario, machine, feed(machine), device, progress)
    except BaseException:
        machine.close()
        raise


def _source(
    name: str, scenario: StreamScenario, options: Options
) -> tuple[Machine, Callable[[Any], Feed]]:
    """The machine of the source of a scenario, and what makes planes of it for those behind."""
    if isinstance(scenario, ImagerScenario):
        from scenarios.assemble.source.imager import FrameFeed, assemble_imager

        return assemble_imager(name, scenario, options), partial(FrameFeed, scenario)
    if isinstance(scenario, RecordingScenario):
        from scenarios.assemble.source.recording.machine import RecordedFeed, assemble_recording

        return assemble_recording(name, scenario), RecordedFeed
    if scenario.sensor.pixel == "latched":
        from scenarios.assemble.source.latched.feed import LatchedFeed
        from scenarios.assemble.source.latched.machine import assemble_latched

        return assemble_latched(name, scenario, options), LatchedFeed
    if scenario.link is None:
        refuse_device(scenario.sensor.pixel, options.device)
    if scenario.sensor.pixel == "asynchronous":
        from scenarios.assemble.source.asynchronous import EventFeed, assemble_asynchronous

        return assemble_asynchronous(name, scenario), partial(EventFeed, scenario)
    from scenarios.assemble.source.continuous import ContinuousFeed, assemble_continuous

    return assemble_continuous(name, scenario), partial(ContinuousFeed, scenario)


def assemble_study(command: str, name: str, scenario: AnyScenario, device: str | None) -> Study:
    """The study for `viform plan` and `viform accuracy`.

    Args:
        command: name of the command, for messages.
        name: short name of the scenario.
        scenario: the checked scenario.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.

    Raises:
        InputError: `command` does not support this kind of scenario, or the scenario is invalid.
    """
    if getattr(scenario, "readout", None) is None:
        return _assemble_study(command, name, scenario, device)
    from scenarios.assemble.behind.readout import readout_of, run_cycles

    readout = readout_of(scenario)
    study = _assemble_study(command, name, scenario, device)
    if command != "plan" or readout is None:
        return study
    from scenarios.assemble.behind.readout import ReadoutStudy

    return ReadoutStudy(study, readout, run_cycles(scenario))


def _assemble_study(command: str, name: str, scenario: AnyScenario, device: str | None) -> Study:
    """The study of a scenario without its [readout]."""
    if isinstance(scenario, LinkScenario):
        from link.plan.study import LinkStudy
        from scenarios.assemble.source.link import link_camera

        return LinkStudy(name, scenario, link_camera(scenario), device)
    if isinstance(scenario, ImagerScenario):
        from scenarios.assemble.source.imager import assemble_imager_study

        return assemble_imager_study(name, scenario, device)
    camera = filmed(scenario, command)
    refuse_leftovers(camera)
    if camera.sensor.pixel == "continuous":
        from scenarios.assemble.source.continuous import study_continuous

        refuse_device("continuous", device)
        return study_continuous(name, camera)
    if camera.sensor.pixel == "asynchronous":
        from scenarios.assemble.source.asynchronous import study_asynchronous

        refuse_device("asynchronous", device)
        return study_asynchronous(name, camera)
    from scenarios.assemble.source.latched.study import LatchedStudy

    return LatchedStudy(name, camera, device)
