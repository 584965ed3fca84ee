"""`viform doctor`: what this machine has, what is missing, and the line that mends it."""

from __future__ import annotations

import typer

from scenarios.cli.output import Json, print_document

__all__ = ["doctor"]


def doctor(json: Json = False) -> None:
    """Check this machine; exit 0 when `viform run film` would work."""
    from scenarios.cli.checks import run_checks

    checks = run_checks()
    well = all(check.ok for check in checks if check.needed)
    if json:
        print_document({"ok": well, "checks": [check.row() for check in checks]})
    else:
        for check in checks:
            mark = "ok" if check.ok else ("MISSING" if check.needed else "note")
            print(f"{mark:<8} {check.name:<12} {check.found}")
            if not check.ok:
                print(f"{'':<8} {'':<12} mend: {check.mend}")
        print("`viform run film` would work" if well else "`viform run film` would not work yet")
    if not well:
        raise typer.Exit(1)
