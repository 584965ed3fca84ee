"""The EMCCD's drive, potentiometer and supplies in a scenario: keys, frames, metrics, messages."""

import numpy as np
import pytest

from cosim import PS, InputError
from imagers.catalogue import IMAGERS
from imagers.common.model import measure_frame
from imagers.emccd.device.supplies import Supplies
from imagers.emccd.pixels import HighVoltage
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.imager import make_view

KEYS = ("duration=70 ms", "imager.writes=[]", "imager.rows=16", "imager.gain_step=218")


class Dark:
    shape = (528, 536)

    def lux_seconds(self, first, begin, end):
        return np.zeros((begin.size, 536))


def run(*assignments):
    """Model, imager after the run, figures of its frames, and its metrics."""
    _, given = load("emccd-window", [*KEYS, *assignments])
    model = IMAGERS["emccd"].model(given.imager, given.duration)
    imager, stop = model.make(), round(given.duration * PS)
    frames = [measure_frame(f) for f in imager.film(Dark(), stop, seed=1, kept=frozenset())]
    view = make_view(given, model.shape)
    assert len(frames) == model.exposures(view, stop).frames
    return imager, frames, model.metrics(frames, view, imager) if frames else {}, model


def test_defaults_are_the_ideal_drive():
    imager, frames, metrics, model = run()
    gain = model.voltage.gain(218, frames[0].state["kelvin"])
    assert frames[0].state["gain"] == gain and metrics["high_voltage_error"].value == 0
    assert metrics["gain_lost_by_phase"].value == 0 and metrics["ageing_codes"].value == 0
    assert metrics["potentiometer_words"].value == imager.potentiometer.words == 1
    assert metrics["high_voltage_settling"].value == pytest.approx(168, rel=0.06)
    assert "power_up_to_exposure" not in metrics


def test_the_picture_begins_when_the_supplies_are_good_and_ends_with_them():
    up = Supplies().switch_time
    _, frames, metrics, _ = run("imager.supplies.on=3 ms", "imager.supplies.off=60 ms")
    assert frames[0].begin == round((3e-3 + up + 528e-6) * PS)
    assert frames[-1].ready <= 60e9 and len(frames) < len(run()[1]) / 2
    assert metrics["power_up"].value == pytest.approx(up * 1e3)
    assert metrics["power_up_to_exposure"].value == pytest.approx(up * 1e3 + 0.528)
    imager, frames, _, model = run("imager.supplies.failed=substrate")
    assert frames == [] and "substrate did not come up" in model.faults(imager)[0]
    assert run()[3].faults(imager) == []


def test_a_warm_transformer_and_an_aged_chip():
    warm = run("imager.ambient=35 degC", "imager.drive.loop_gain=20")[2]
    volts, x = HighVoltage().volts(218), -0.02
    wanted = volts * x / (1 + (21 * 45 / volts - 1) * (1 + x))
    assert warm["high_voltage_error"].value == pytest.approx(wanted)
    aged = run("imager.ageing=0.2 V")[2]  # the step is given, so nothing corrects it
    assert aged["gain"].value == pytest.approx(90.2, abs=0.1)
    assert aged["potentiometer_code"].value == 218 and aged["ageing_codes"].value == 19


ORDER = '["substrate", "output_drain", "reset_drain", "dump_drain", "area_clocks", ' \
    '"register_clocks", "dc_gate", "high_voltage"]'  # fmt: skip


@pytest.mark.parametrize(
    ("assignment", "says"),
    [
        (f"imager.supplies.order={ORDER}", "imager.supplies.order must be an order in which "
         "output_drain comes up before substrate"),
        ('imager.supplies.order=["substrate"]', "imager.supplies.order must be output_drain, "),
        ("imager.supplies.failed=pump", "imager.supplies.failed must be one of output_drain"),
        ("imager.drive.phase=5", "imager.drive.phase must be an angle"),
        ("imager.drive.transfer=60 ns", "imager.drive.transfer must be a time"),
        ("imager.temperature=-150 degC", "imager.temperature must be a temperature such as"),
        ("imager.drive.phse=5 deg", "did you mean imager.drive.phase?"),
    ],
)  # fmt: skip
def test_a_wrong_key_is_one_line(assignment, says):
    with pytest.raises(InputError) as caught:
        load("emccd-window", [assignment])
    assert says in str(caught.value) and "\n" not in str(caught.value)
