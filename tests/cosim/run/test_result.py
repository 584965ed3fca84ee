"""The metrics of `result.json`: a figure, or why there is none."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from cosim.run.result import NO_REASON, Metric, Result, read_result, write_result


@pytest.mark.parametrize("value", [None, math.nan, math.inf])
@pytest.mark.parametrize(
    ("given", "said"), [("no frame arrived", "no frame arrived"), (None, NO_REASON)]
)
def test_a_metric_without_a_figure_says_why(tmp_path: Path, value, given, said):
    result = Result("film", "ok", 1, "", 0.0, 0.0, metrics={
        "fer": Metric(value, "1", given), "ber": Metric(0.0, "1", "no bit was read"),
    })  # fmt: skip
    write_result(tmp_path, result)
    told = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["metrics"]
    assert told["fer"] == {"value": None, "unit": "1", "reason": said}
    assert told["ber"] == {"value": 0.0, "unit": "1"}
    again = read_result(tmp_path)
    assert again is not None and again.metrics["fer"].reason == said
