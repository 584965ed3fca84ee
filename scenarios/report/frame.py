"""The frame of every report: what stands before and after the sections of a machine."""

from __future__ import annotations

import html
import shlex
import time

from cosim.report.figures import own_settings
from cosim.report.page import write_page
from cosim.report.parts import run_time
from cosim.run.machine import Machine, Run
from scenarios.report.summary import summary_of_run


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
