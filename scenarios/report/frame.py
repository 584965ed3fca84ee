"""The frame of every report: the summary at its top, with the questions of a newcomer and notes of
the run, and what stands after the sections of a machine."""

from __future__ import annotations

import html
import shlex
import time

from cosim.config.amounts import amount, count, elapsed, number
from cosim.plan.error import OTHER_NOISE, Law
from cosim.report.figures import own_settings
from cosim.report.page import write_page
from cosim.report.parts import cards, run_time
from cosim.report.summary import big, listed, paragraph, summary
from cosim.run.machine import Machine, Page, Run
from cosim.run.result import Result


def summary_of_run(page: Page, run: Run, spent: float) -> str:
    """HTML of the heading, and of the answers: what was simulated, how good the machine is, how
    wrong the simulation may be, how long it took, what was left out."""
    result = run.result
    answers = [
        ("What was simulated", paragraph(page.simulated)),
        (page.good, cards(page.cards) + paragraph(page.quality)),
        ("How wrong the simulation may be", _wrong(result, page.unmeasured)),
        ("How long it took", _long(run, spent)),
        ("What was left out", _out(result)),
        ("Notes of the run", listed(run.notes)),
    ]
    subtitle = f"{page.subtitle}, seed {result.seed}, viform {result.version}"
    return summary(page.title, subtitle, answers, outcome=_outcome(result))


def _exceeds(result: Result) -> bool:
    """Whether the error of the simulation is, or may be, above the tolerance."""
    error = result.error
    if error.value is None:
        return False
    high = error.value if error.ci is None else error.ci[1]
    return bool(error.tiles_over) or 0 < result.tolerance < high


def _outcome(result: Result) -> str:
    """What an outcome other than "ok" means; it says nothing about the camera."""
    if result.outcome == "ok":
        return ""
    if result.outcome == "failed":
        text = "A check of the machine did not pass; the notes below say which."
    elif _exceeds(result):
        text = (
            "This is about the simulation, not about the camera or its data: the simulation's own "
            "error is, or may be, above the tolerance, so the figures of this page may be off by "
            "as much. The notes below say why."
        )
    else:
        text = (
            "The run is complete, but it falls short of what the scenario asks for; the notes "
            "below say in what. It is no verdict on the data."
        )
    return f"<b>Outcome: {result.outcome}.</b> {text}"


def _wrong(result: Result, unmeasured: str) -> str:
    error = result.error
    if error.value is None:
        return paragraph(unmeasured)
    high = ""
    if error.ci is not None:
        where = " in any tile" if error.tiles_checked is not None else ""
        high = f", at most {number(error.ci[1], 2)}{where} (99.9 % confidence)"
    asked = f"tolerance {number(result.tolerance)}"
    if result.tolerance == 0:
        asked = "tolerance 0: every effect is kept"
    law = "" if error.law is None else f" This run has {OTHER_NOISE}. {_law(error.law)}"
    kind = "of this run" if error.law is None else "in law of this run"
    return big(
        number(error.value, 2),
        f"Error {kind} against full physics{high}: {error.kind}; {asked}. It is the "
        f"price of simulating fast, and no property of the machine.{law}",
    )


def _law(law: Law) -> str:
    """The figures of an error in law, in one sentence."""
    named = (
        ("mean rate", law.mean), ("variance of a rate", law.variance),
        ("correlation of pixels", law.correlation),
    )  # fmt: skip
    figures = [
        f"{name} {number(figure.value, 1, sign=True)} ({number(figure.ci[0], 1, sign=True)} to "
        f"{number(figure.ci[1], 1, sign=True)})" for name, figure in named
    ]  # fmt: skip
    apart = law.interval_tv
    return (
        "Patches filmed with the camera of this run, against full physics, with 99.9 % limits: "
        f"{', '.join(figures)}; total variation distance of intervals {number(apart.value, 1)} "
        f"(at most {number(apart.ci[1], 1)})."
    )


def _long(run: Run, spent: float) -> str:
    result, text = run.result, ""
    if result.simulated_s > 0:
        ratio = spent / result.simulated_s
        speed = (
            f"{number(ratio, 2)} times as long as in reality" if ratio >= 1
            else f"{number(1 / ratio, 2)} times faster than in reality"
        )  # fmt: skip
        text = f"Run time for {amount(result.simulated_s, 's', 4)} of simulated time, {speed}."
    full = result.metrics.get("full_physics")
    if full is not None and full.value is not None:
        camera = result.metrics.get("camera")
        own = None if camera is None else camera.value
        took = "" if own is None else f"; in this run the camera took {elapsed(own)}"
        text += (
            f" Full physics for every pixel would take the camera about {elapsed(full.value)}, "
            f"predicted from the patches{took}."
        )
    return big(elapsed(spent), text.strip())


def _out(result: Result) -> str:
    names = [str(row["effect"]) for row in result.left_out]
    if names:
        effects = f"{count(len(names))} effect{'s' * (len(names) > 1)}"
        return big(
            effects,
            f"{', '.join(names)}. Leaving out saves time, and changes less than the tolerance "
            "allows; the section on what was left out gives the bounds and their check.",
        )
    if result.kept:
        return paragraph(f"Nothing: all {count(len(result.kept))} effects were simulated.")
    return paragraph("Nothing: there was no effect to leave out.")


def write_report(machine: Machine, run: Run) -> list[str]:
    """Writes figures and report.html into the folder of the run; returns their names."""
    begin = time.perf_counter()
    (run.folder / "figures").mkdir(exist_ok=True)
    with own_settings():
        page = machine.page(run)
    now = time.perf_counter()
    run.seconds["report"], spent = now - begin, now - run.began
    again = [*page.commands, f"viform run {shlex.quote(str(run.folder / 'scenario.toml'))}"]
    sections = [
        *page.sections,
        run_time(run.result, run.seconds, spent),
        f"<h2>Make it again</h2>{page.commands_do}<pre>{html.escape(chr(10).join(again))}</pre>",
        f"<h2>The resolved scenario</h2><pre>{html.escape(machine.toml)}</pre>",
    ]
    write_page(run.folder, page.title, summary_of_run(page, run, spent), "".join(sections))
    return [*page.files, "report.html"]
