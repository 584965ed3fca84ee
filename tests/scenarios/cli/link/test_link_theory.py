"""`viform link ber` and `viform link capacity`: documents, tables, refusals."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from link.evaluation.curves import LEVEL, Curve, error_curves, measure_curves
from link.mode import Mode
from link.prediction.capacity import CapacityInput, capacity_document, scenario_input
from scenarios.assemble.schema.loading import linked, load
from scenarios.assemble.source.link import link_camera
from scenarios.cli.link.theory import _achievable
from scenarios.cli.link.theory import _capacity_text as _text

NAMES = ["poisson-threshold", "reset-hard", "reset-residual", "reset-subtract"]
KEYED = [f"{law}-{c}" for c in ("peak", "average") for law in ("awgn", "log-normal", "gamma-gamma")]
WORDS = ["rs-scattered", "rs-bursts-interleaved", "rs-bursts-plain"]


@pytest.fixture(scope="module")
def curves() -> list[Curve]:
    return error_curves(2)


def _quick(curve: Curve) -> Curve:
    return replace(curve, least=min(curve.least, 2000), most=min(curve.most, 20_000))


def test_every_curve_is_here(curves: list[Curve]) -> None:
    assert [c.name for c in curves] == NAMES + KEYED + WORDS
    with pytest.raises(ValueError, match="2 to 256"):
        error_curves(1)


def test_theory_is_inside_and_a_wrong_one_is_not(curves: list[Curve]) -> None:
    chosen = [_quick(c) for c in curves if c.name in ("reset-residual", "gamma-gamma-peak")]
    document = measure_curves(chosen, 1)
    assert document["holds"] and document["level"] == LEVEL and document["points_judged"] >= 3
    for d in document["curves"]:
        for low, theory, high, inside in zip(
            d["low"], d["theory"], d["high"], d["inside"], strict=True
        ):
            assert inside is (low <= theory <= high)
    wrong = [replace(c, theory=[p / 3 for p in c.theory]) for c in chosen]
    assert not measure_curves(wrong, 1)["holds"]


def test_without_an_interleaver_it_fails(curves: list[Curve]) -> None:
    plain = _quick(next(c for c in curves if c.name == "rs-bursts-plain"))
    (document,) = measure_curves([plain], 1)["curves"]
    assert all(document["inside"]) and document["beside"]["refuted"] == [True, True]


def test_a_document_hangs_on_its_seed_alone(curves: list[Curve]) -> None:
    chosen = [_quick(curves[0])]
    assert measure_curves(chosen, 5) == measure_curves(chosen, 5) != measure_curves(chosen, 6)


class TestBer:
    @pytest.fixture(autouse=True)
    def short(self, monkeypatch: pytest.MonkeyPatch, curves: list[Curve]) -> None:
        few = [_quick(c) for c in curves if c.name in ("poisson-threshold", *WORDS)]
        monkeypatch.setattr("link.evaluation.curves.error_curves", lambda points: few)

    def test_prints_a_document_and_writes_a_folder(
        self, viform: Callable[..., Any], tmp_path: Path
    ) -> None:
        out = tmp_path / "ber"
        code, text, _ = viform("link", "ber", "--json", "--no-detectors", "--out", out)
        document = json.loads(text)
        assert code == 0 and document["holds"] and document["detectors"] == []
        keys = {
            "name",
            "x",
            "x_unit",
            "theory",
            "measured",
            "low",
            "high",
            "errors",
            "bits",
            "inside",
        }
        assert all(keys <= set(curve) for curve in document["curves"])
        assert json.loads((out / "ber.json").read_text()) == document
        assert (out / "ber.png").read_bytes().startswith(b"\x89PNG")
        assert "<svg" in (out / "ber.svg").read_text()[:2000]

    def test_prints_a_table(self, viform: Callable[..., Any]) -> None:
        code, text, _ = viform("link", "ber", "--no-detectors")
        assert code == 0 and "(rs-bursts-plain)" in text and "all of them inside" in text

    def test_says_no(
        self, viform: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, curves: list[Curve]
    ) -> None:
        wrong = replace(_quick(curves[0]), theory=[0.3, 0.3])
        monkeypatch.setattr("link.evaluation.curves.error_curves", lambda points: [wrong])
        code, text, _ = viform("link", "ber", "--no-detectors")
        assert code == 1 and "OUTSIDE" in text and "NOT all of them inside" in text

    def test_refuses_a_folder_that_is_there(
        self, refused: Callable[..., str], tmp_path: Path
    ) -> None:
        assert refused("link", "ber", "--out", tmp_path).startswith("--out must be a new folder")


SMALL = [
    "--set", "link.panel.width=128", "--set", "link.panel.height=128", "--symbols", "8",
]  # fmt: skip
"""A panel that is simulated in a moment."""


class TestCapacity:
    GIVEN = CapacityInput(140.0, 10.0, 100.0, "residual", 40_000.0, 10**6, 900_000.0, 1)
    MODE = Mode(960, 960, 2, 2, "8b10b", 32)

    def test_the_budget_ends_at_the_coded_rate(self) -> None:
        d = capacity_document(self.GIVEN, self.MODE)
        assert d["budget"][0]["bps"] == 40e9 and d["capacity_bps"] == 36e9
        assert d["budget"][-1]["bps"] == pytest.approx(d["coded_bps"])
        assert sum(row["share_of_loss"] for row in d["budget"]) == pytest.approx(1)
        assert d["raw_bps"] == d["coded_bps"] / 0.8 * 255 / 223
        low, high = d["pixel"]["memory"]["ci"]
        assert low < 0.775 < high and d["pixel"]["slot"]["value"] > 0.99
        assert d["pixel"]["cell"]["value"] == pytest.approx(1, abs=1e-4)  # two ticks mend it

    @pytest.mark.parametrize("scale", [1.0, 0.2, 0.002])  # 2 m, 10 m, 1 km
    @pytest.mark.parametrize("cell", [1, 2, 16])
    def test_no_rate_is_above_the_bound_before_it(self, scale: float, cell: int) -> None:
        there = replace(self.GIVEN, on_panel=(960 * scale) ** 2)
        d = capacity_document(there, replace(self.MODE, cell=cell, ticks=1))
        left = [row["bps"] for row in d["budget"]]
        assert left == sorted(left, reverse=True)
        assert left[-1] == pytest.approx(d["coded_bps"])
        assert d["capacity_bps"] >= d["cells_bps"] and d["capacity_bps"] >= d["raw_bps"]
        assert d["raw_bps"] > d["coded_bps"] and 0 < d["share"] < 1

    def test_cells_that_a_run_would_choose_are_assumed(self) -> None:
        for distance, cell in (("2 m", 2), ("10 m", 8), ("1 km", 16)):
            link = linked(load("light-link", [f"link.distance={distance}"])[1], "test")
            assert scenario_input(link, link_camera(link))[1].cell == cell

    def test_no_light_carries_nothing(self) -> None:
        dark = replace(self.GIVEN, on=10.0)
        d = capacity_document(dark, self.MODE)
        assert d["capacity_bps"] == pytest.approx(0, abs=1) and d["cells_bps"] == pytest.approx(
            0, abs=1
        )
        assert d["pixel"]["memory"]["value"] == pytest.approx(0, abs=1e-9)

    def test_of_the_scenario(self, viform: Callable[..., Any]) -> None:
        given = ["--set", "sensor.threshold=100 e", "--set", "link.modem.cell=4", *SMALL]
        code, text, _ = viform("link", "capacity", "--json", *given)
        d = json.loads(text)
        assert code == 0 and d["mode"]["cell"] == 4 and d["assumed"] == ["ticks", "line", "parity"]
        assert 1.3 < d["given"]["on"] / 100 < 1.6 and d["given"]["looks"] == 9
        assert 0 < d["share"] < 1 and d["capacity_bps"] <= 40e9
        mine, best = d["information_bps"], d["information_best"]
        assert d["information_low"] <= mine <= d["information_high"]
        # The raw rate counts the camera's ticks, which are 20 ppm longer than the panel's planes.
        assert d["information_high"] <= d["raw_bps"] * (1 + 2.1e-5)
        assert mine <= best["information_bps"] <= d["capacity_bps"] and d["curves"] == []
        assert best in d["tried"] and all(
            one["information_bps"] <= best["information_bps"] for one in d["tried"]
        )
        code, text, _ = viform("link", "capacity", *given)
        assert code == 0 and text.strip() == _text("light-link", d).strip()
        assert "of capacity" in text and "not given, so assumed: ticks" in text
        assert "achievable information, simulated" in text

    @pytest.mark.parametrize(("coded", "says"), [(4.7e8, True), (3.5e8, False)])
    def test_a_coded_rate_that_the_mode_does_not_carry_is_said(
        self, coded: float, says: bool
    ) -> None:
        one = {"cell": 8, "ticks": 1, "information_bps": 3.6e8, "information_low": 3.5e8,
               "information_high": 3.7e8, "information_bit": 0.67}  # fmt: skip
        mode = {"cell": 8, "ticks": 1}
        lines = _achievable(
            {**one, "mode": mode, "information_best": one, "coded_bps": coded, "phase": 0.9}
        )
        assert lines[0].endswith("the best, cells of 8 x 8, 1 tick, 360 Mbit/s [350 Mbit/s, "
                                 "370 Mbit/s], 0.6700 bit of a cell's symbol")  # fmt: skip
        said = f"the coded rate, {coded / 1e6:.0f} Mbit/s, is above what this mode carries here"
        assert [line.partition(":")[0] for line in lines[1:]] == [said][: int(says)]

    def test_promises_nothing_where_the_tags_cannot_be_found(
        self, viform: Callable[..., Any]
    ) -> None:
        far = ["--set", "link.distance=20 m", *SMALL]
        d = json.loads(viform("link", "capacity", "--json", *far)[1])
        assert d["information_bps"] is d["information_best"] is None and d["tried"] == []
        assert d["capacity_bps"] > 0
        assert "cannot find the panel" in _text("light-link", d)

    @pytest.mark.slow
    def test_draws_curves(
        self, viform: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
    ) -> None:
        for name, few in (("CELLS", (2, 8)), ("_CELLS", (1, 8)), ("ticks_chosen", lambda _: (1,))):
            monkeypatch.setattr(f"link.evaluation.capacity_curves.{name}", few)
        out = tmp_path / "new"
        code, text, _ = viform(
            "link", "capacity", "--points", 2, "--out", out, *SMALL,
            *("--set", "link.modem.cell=8", "--set", "link.modem.ticks=1"),
        )  # fmt: skip
        d = json.loads((out / "capacity.json").read_text())
        assert code == 0 and text.strip().startswith(_text("light-link", d).strip())
        assert f"figure: {out}/capacity.png" in text
        distance, luminance, ambient, cell = d["curves"]
        assert distance["x"] == sorted(distance["x"]) and distance["marks"][0] <= 2
        assert all(best is not None for best in distance["best_bps"])  # found over all the range
        assert distance["best_bps"][0] > distance["best_bps"][-1]
        assert luminance["x"] == [1000, 4000]
        assert luminance["information_bps"][0] == d["information_bps"]
        assert ambient["best_bps"][0] > ambient["best_bps"][1]  # daylight drowns the panel
        assert cell["x"] == [1, 8] and cell["best_mode"][0] == {"cell": 1, "ticks": 1}
        assert cell["information_bps"][-1] == d["information_bps"]
        assert (out / "capacity.png").read_bytes().startswith(b"\x89PNG")
        assert "<svg" in (out / "capacity.svg").read_text()[:2000]

    def test_refuses_what_is_no_link(self, refused: Callable[..., str]) -> None:
        said = refused("link", "capacity", "film")
        assert (
            "must be one with a [link] for `viform link capacity`, not one with a [scene]" in said
        )
