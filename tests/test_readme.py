"""What the documents promise of tests is there."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def test_every_tick_of_the_peers_table_has_its_test() -> None:
    text = (ROOT / "docs/comparison.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("|") and line.count("|") == 10]
    named = {row: re.findall(r"`(test_\w+)`", row) for row in rows[2:]}
    assert len(named) >= 16
    there = {
        name
        for path in (ROOT / "tests").rglob("test_*.py")
        for name in re.findall(r"def (test_\w+)", path.read_text(encoding="utf-8"))
    }
    for row, names in named.items():
        ours = row.split("|")[8].strip()
        assert bool(names) == (ours != "no"), row
        assert set(names) <= there, row


def test_the_page_of_the_architecture_names_what_is_there() -> None:
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    paths = set(re.findall(r"`([\w/]+(?:/|\.py))`", text))
    assert len(paths) >= 30
    assert [path for path in sorted(paths) if not (ROOT / path).exists()] == []
