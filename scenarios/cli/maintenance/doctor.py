"""`viform doctor`: checks this machine, and prints an instruction for each problem."""

from __future__ import annotations

import typer

from cosim.run.called import as_called
from scenarios.cli.output import Json, print_document, tell


def doctor(json: Json = False) -> None:
    """Check this machine; exit 0 if `viform run film` can work."""
    from scenarios.cli.maintenance.checks import run_checks

    checks = run_checks()
    ready = all(check.ok for check in checks if check.needed)
    if json:
        print_document({"ok": ready, "checks": [check.row() for check in checks]})
    else:
        for check in checks:
            mark = "ok" if check.ok else ("MISSING" if check.needed else "note")
            tell(f"{mark:<8} {check.name:<12} {check.state}")
            if not check.ok:
                tell(f"{'':<8} {'':<12} remedy: {check.remedy}")
        tell(as_called(f"`viform run film` {'can work' if ready else 'cannot work yet'}"))
    if not ready:
        raise typer.Exit(1)
