"""The link that is called: the bits of a run's machine, and what later calls know."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.compute.opencl import Device
from cosim.run.progress import QuietProgress
from link.core import LinkCore
from link.evaluation.errors import errors_of
from link.evaluation.reception import receive_stream
from link.machine import LinkMachine
from link.section import LinkScenario
from link.setting import link_setting, steering_of
from link.setup.setup import set_up_link
from scenarios.assemble.schema.loading import linked, load
from scenarios.assemble.source.link import link_camera

SMALL = (
    "sensor.chip=spikeone", "sensor.width=200", "sensor.height=200", "link.panel.width=160",
    "link.panel.height=160", "link.modem.cell=2", "link.modem.ticks=2", "link.modem.rate=0.75",
    "link.modem.line=scrambled", "sensor.duplicated_rows=[[60, 61]]",
)  # fmt: skip
DATA = bytes(range(250))


def scenario(*more: str) -> LinkScenario:
    return linked(load("light-link", [*SMALL, *more])[1], "test")


def core(given: LinkScenario, device: Device | None) -> LinkCore:
    return LinkCore(
        link_setting(given, link_camera(given)), given.link.modem, steering_of(given.sensor),
        device, size=len(DATA), tolerance=given.tolerance,
        duplicated_rows=given.sensor.duplicated_rows,
    )  # fmt: skip


def test_call_0_films_what_the_machine_of_a_run_records(tmp_path: Path, device: Device) -> None:
    place = tmp_path / "data"
    place.write_bytes(DATA)
    given = scenario(f"link.file={place}")
    machine = LinkMachine("test", set_up_link(given, link_camera(given), None, QuietProgress()))
    chain = machine.chain(tmp_path)
    chain.run(QuietProgress())
    stream = chain.stages["recorder"].recorded()
    machine.close()
    made = core(given, device)
    link = made._planned(made._setup(DATA, 0))
    words = made._film(link).words
    assert (words == stream.read_words(0, len(words))).all() and words.any()
    assert (words[:, 61] == words[:, 60]).all()
    assert link.plan.left_out == machine._link.plan.left_out != ()
    assert link.plan.promised == machine._link.plan.promised


@pytest.mark.slow
def test_a_receiver_that_knows_the_link_reads_as_well_as_one_that_searches(device: Device) -> None:
    """The image shakes by a twentieth of a pixel from call to call. Where it shakes more, all
    search."""
    assert core(scenario("link.aim.vibration=0.2"), device)._rehearsed() is None
    made = core(scenario(), device)
    tuned = made._rehearsed()
    assert tuned is not None
    wrong = []
    for number in range(1, 4):
        link = made._planned(made._setup(DATA, number))
        stream = made._film(link)
        both = [
            receive_stream(stream, link.setup.modem, device, QuietProgress(), known)[0]
            for known in (tuned, None)
        ]
        assert all(each.delivered == (DATA, "data") for each in both)
        places = [each.registration.camera(80.0, 80.0) for each in both]
        assert np.abs(np.subtract(*places)).max() < 0.1
        begins = [each.timing.start(50, 100) for each in both]
        assert begins[0] == pytest.approx(begins[1], abs=0.1)
        wrong.append([errors_of(link.setup, each).rate for each in both])
    knowing, searching = np.mean(wrong, axis=0)
    assert knowing < 1.5 * searching + 1e-4


def test_a_plan_is_shared_by_calls_of_a_length_and_given_back(device: Device) -> None:
    made = core(scenario(), device)
    one, two = (made._planned(made._setup(DATA, number)) for number in (1, 2))
    assert one.survey is two.survey and one.plan.plan is two.plan.plan
    assert one.plan.camera.seed != two.plan.camera.seed
    made.forget()
    assert made._planned(made._setup(DATA, 1)).survey is not one.survey
