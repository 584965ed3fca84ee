"""`viform bench events`: document, tables and figure."""

import json

import pytest

from scenarios.studies import events
from tests.scenarios.studies.bench.small import make_bench_small


@pytest.fixture
def small(monkeypatch):
    make_bench_small(monkeypatch, "events")


def test_the_command_prints_the_document_and_draws_its_figure(small, viform, refused, tmp_path):
    picture = tmp_path / "a.png"
    code, out, _ = viform("bench", "events", "--json", "--figure", picture)
    document = json.loads(out)
    assert code == 0
    assert [document["clock_hz"], document["latch_hz"]] == [48_000_000, 40_000]
    dim, bright = document["rows"]
    assert dim["pixels"] == bright["pixels"] == "8 x 8"
    assert dim["bits"] < 1 < bright["bits"]
    assert bright["sent"] < 1 < dim["sent"]
    assert dim["lost"] == bright["lost"] == 0
    (limit,) = document["limits"]
    assert (limit["depth"], limit["tick"]) == (64, 1200)
    assert picture.read_bytes().startswith(b"\x89PNG")
    code, out, _ = viform("bench", "events")
    assert code == 0
    assert out.strip() == events.markdown(document)
    assert out.count("| 8 x 8 | ") == 3
