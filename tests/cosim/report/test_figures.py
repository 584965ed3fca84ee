"""Figures do not follow the settings that a user has for his own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import pytest

from cosim.report import figures
from cosim.report.figures import own_settings, subplots
from scenarios.report.frame import write_report
from scenarios.scenes.charts import chart

USERS = {"text.usetex": True, "font.style": "italic", "figure.facecolor": "black"}
"""Settings that end the figures of a machine without LaTeX, or change them."""


def test_settings_of_a_user_hold_again_after_our_figures(tmp_path: Path) -> None:
    with matplotlib.rc_context(USERS):
        with own_settings(), own_settings():
            figure, ax = subplots(figsize=(1, 1))
            ax.set_title("no LaTeX")
            figure.savefig(tmp_path / "a.png")
        assert figure.get_facecolor() == (1, 1, 1, 1)
        assert {name: matplotlib.rcParams[name] for name in USERS} == USERS


def test_a_report_is_drawn_with_our_settings(tmp_path: Path) -> None:
    class Ended(Exception): ...

    class Machine:
        def page(self, run: Any) -> None:
            raise Ended(matplotlib.rcParams["text.usetex"], matplotlib.rcParams["font.style"])

    class Run:
        folder = tmp_path

    machine: Any = Machine()
    run: Any = Run()
    with matplotlib.rc_context(USERS), pytest.raises(Ended) as ended:
        write_report(machine, run)
    assert ended.value.args == (False, "normal")


def test_a_command_reads_no_matplotlibrc_of_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "matplotlibrc").write_bytes(b"font.family: caf\xe9\n")
    monkeypatch.chdir(tmp_path)
    found = []
    imported = figures.import_module
    monkeypatch.setattr(
        figures, "import_module",
        lambda name: found.append(matplotlib.matplotlib_fname()) or imported(name),
    )  # fmt: skip
    for value in ("/dev/null", "/home/a"):
        monkeypatch.setenv("MATPLOTLIBRC", value)
        subplots(figsize=(1, 1))
    assert found == ["/dev/null", "matplotlibrc"] and matplotlib.matplotlib_fname() == found[1]


def test_the_letters_of_a_scene_are_the_same_for_every_user() -> None:
    ours, width = chart._letters("0.3 %")
    chart._letters.cache_clear()
    with matplotlib.rc_context(USERS):
        theirs, other = chart._letters("0.3 %")
    assert width == other
    assert all((a == b).all() for a, b in zip(ours, theirs, strict=True))
