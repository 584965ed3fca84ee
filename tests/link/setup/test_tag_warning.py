"""The warning of tags too small has the limit of the report, also through a blur."""

from __future__ import annotations

import pytest

from link.mode import Mode
from link.receiving.tags import LEAST_MODULE
from link.setting import LinkSetting, link_setting
from link.setup.distances import span_of
from link.setup.modes import tag_warning
from link.setup.truth import tag_module
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import linked, load

MODE = Mode(384, 224, 2, 2, "8b10b", 32)


def setting(blur: float, distance: float) -> LinkSetting:
    scenario = load("light-link", [
        "sensor.chip=spikeone", "link.panel.width=384", "link.panel.height=224",
        "link.modem.cell=2", "link.modem.ticks=2", "link.modem.line=8b10b",
        "link.modem.parity=32", f"link.aim.blur={blur}", f"link.distance={distance} m",
    ])[1]  # fmt: skip
    return link_setting(linked(scenario, "test"), camera_setting(linked(scenario, "test")))


@pytest.mark.parametrize("blur", [0.2, 1.2])
def test_it_comes_from_the_distance_on_at_which_the_report_says_that_the_panel_is_lost(
    blur: float,
) -> None:
    far = span_of(setting(blur, 2.0), MODE)[1]
    assert tag_warning(setting(blur, far * 0.98), MODE) is None
    beyond = setting(blur, far * 1.02)
    module, least = tag_module(beyond, MODE)
    told = tag_warning(beyond, MODE)
    assert told is not None
    assert f"has {module:.2g} camera pixels and is found from {least:.2g} on" in told
    assert ("make the image sharper" in told) == (least > LEAST_MODULE) == (blur > 0.5)
