"""The link that is called from Python: the result of a run, its noise, and refusals."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import viform
from scenarios.cli.entry import _main

SMALL = {
    "panel.width": 160, "panel.height": 160, "modem.cell": 2, "modem.ticks": 2,
    "modem.rate": 0.75, "sensor.chip": "spikeone", "sensor.width": 200, "sensor.height": 200,
}  # fmt: skip
DATA = bytes(range(250))


@pytest.fixture(scope="module")
def link() -> viform.Link:
    return viform.Link(size=len(DATA), **SMALL)


def in_scenario(keys: dict[str, object]) -> dict[str, object]:
    return {key if key.startswith("sensor.") else f"link.{key}": keys[key] for key in keys}


def test_bytes_arrive_again_and_again_whatever_the_threads(link: viform.Link) -> None:
    with ThreadPoolExecutor(3) as pool:
        calls = [pool.submit(link.send, DATA, call=n) for n in (1, 2, 1, 2)]
        one, two, again, other = (each.result() for each in calls)
    assert one == again and two == other and one != two
    assert one.received == two.received == DATA and one.intact and two.intact
    assert one.ber is not None and 0 < one.ber < 1e-3 and one.bits == two.bits
    assert one.goodput_bps is not None and one.raw_bps > one.goodput_bps > 1e5
    assert one.error.bound < 1e-4 and one.error.tier == "fast"
    assert "250 bytes arrived" in repr(one) and "160 x 160" in repr(link)
    assert link.send(memoryview(b"a message"), call=7).received == b"a message"


def test_a_hidden_panel_is_a_cause_not_an_error() -> None:
    """And a send without a folder is the first call."""
    keys = SMALL | {"aim.blocked": [["0 ms", "1 s"]]}
    with viform.Link(**keys) as hidden:
        first, second = hidden.send(b"a message"), hidden.send(b"a message")
    for sent in (first, second):
        assert not sent.intact and sent.received == b"" and "too dim" in sent.verdict
        assert sent.ber is None and sent.goodput_bps is None and sent.bits == 0
        assert "nothing arrived" in repr(sent)
    with pytest.raises(viform.InputError, match="the link must be open, not closed"):
        hidden.send(b"a message")
    assert "closed" in repr(hidden)
    assert viform.send(b"a message", **in_scenario(keys)) == first


def test_what_cannot_be_sent_is_one_line(link: viform.Link) -> None:
    calls = {
        "link.distanse": lambda: viform.Link(distanse="2 m"),
        "link.distance must be": lambda: viform.Link(distance="2 s"),
        "sensor.pixel must be latched": lambda: viform.Link(
            **SMALL, **{"sensor.pixel": "continuous"}
        ),
        "link.file must be absent for a link in memory": lambda: viform.Link(file="a"),
        "link.loop must be absent": lambda: viform.Link(loop="serial:/dev/ttyS0"),
        "duration must be absent": lambda: viform.send(DATA, duration="1 ms"),
        "size must be a whole number of bytes": lambda: viform.Link(size=0),
        "size must be .* not 'many'": lambda: viform.Link(size="many"),
        "data must be bytes, not str": lambda: link.send("text"),
        "data must be bytes, not list": lambda: link.send([1, 2]),
        "data must be from 1 to .* bytes, not none": lambda: link.send(b""),
        "data must be one byte or more": lambda: viform.send(b""),
        "link.file must be a file that can be read": lambda: viform.send("not there"),
        "resume must be given with out": lambda: viform.send(DATA, resume=True),
        "call must be a whole number from 0, not -1": lambda: link.send(DATA, call=-1),
        "call must be a whole number from 0, not 1.0": lambda: link.send(DATA, call=1.0),
    }
    for says, call in calls.items():
        with pytest.raises(viform.InputError, match=says) as raised:
            call()
        assert "\n" not in str(raised.value) and "--" not in str(raised.value)


LOCKED = {"panel.width": 256, "panel.height": 256, "sensor.width": 300, "sensor.height": 300}


@pytest.mark.slow
@pytest.mark.parametrize("keys", [SMALL, LOCKED], ids=["given", "chosen"])
def test_a_call_is_what_a_run_does(keys: dict[str, object], tmp_path: Path) -> None:
    """Once with a given mode, and once with one that is chosen by pilots and a locked clock."""
    place = tmp_path / "data"
    place.write_bytes(DATA)
    own = [f"--set={key}={value}" for key, value in in_scenario(keys).items()]
    command = ["run", "light-link", f"--set=link.file={place}", "--out", str(tmp_path / "run")]
    assert not _main([*command, *own])
    result = json.loads((tmp_path / "run" / "result.json").read_bytes())
    link = viform.Link(size=len(DATA), **keys)
    assert ("clock locked" in repr(link)) == (keys is LOCKED)
    sent = link.send(DATA)
    assert sent.received == (tmp_path / "run" / "received" / "data").read_bytes() == DATA
    assert sent.ber == result["metrics"]["ber"]["value"]
    assert sent.goodput_bps == result["metrics"]["goodput_bps"]["value"]
    assert sent.simulated_s == result["simulated_s"]
    assert set(sent.error.left_out) == {row["effect"] for row in result["plan"]["left_out"]}
    assert viform.send(place, **in_scenario(keys)) == sent
