"""The [code] section."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from cosim import InputError
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.section import CodeSection


def test_the_code_and_the_control_follow_from_the_keys():
    assert CodeSection().code(1000.0) == StreamCode()
    assert CodeSection().control(40e3) is None
    section = CodeSection(kind="statistical", k=2, rate="2 Gbit/s", buffer="10 ms", cycles=512)
    assert section.code(1000.0, 5.0) == StreamCode(
        "statistical", 512, k=2.0, refine=8, threshold=1000.0, threshold_noise=5.0
    )
    control = section.control(40e3)
    assert (control.budget, control.buffer.limit) == (50_000.0, 2_500_000)
    assert section.control(40e3, 1e9).budget == 25_000.0  # the link carries less
    assert CodeSection().control(40e3, 1e9).buffer.limit == 2_500_000
    assert CodeSection(**section.model_dump(exclude_unset=True)) == section


@pytest.mark.parametrize(
    ("keys", "why"),
    [({"rate": "2 GHz"}, "must be a bit rate such as '8 Gbit/s'"),
     ({"k": 2}, "code.k must be given with code.kind = statistical, not with layered"),
     ({"kind": "raw", "layers": 3}, "code.layers must be given with code.kind = layered"),
     ({"kind": "statistical", "refine": 1}, "code.refine must be 0, or 2 to 255, not 1"),
     ({"kind": "event", "cycles": 160}, "code.cycles must be at most 128 with event, not 160"),
     ({"cycles": 100}, "multiple of 32"), ({"tile": 136}, "less than or equal to 128"),
     ({"kind": "jpeg"}, "'raw', 'first-spike', 'statistical', 'layered' or 'event'"),
     ({"speed": 1}, "Extra inputs")],
)  # fmt: skip
def test_keys_that_do_not_fit_are_refused(keys, why):
    with pytest.raises((ValidationError, InputError), match=why):
        CodeSection(**keys)
