"""Soft values of some cells: which, how many, and the same as the detector's."""

from __future__ import annotations

import numpy as np

from link.layout import Layout
from link.mode import Mode
from link.receiving import received
from link.receiving.received import Watcher
from link.report.errors import levels_of

LAYOUT = Layout(Mode(256, 192, 2, 2, "8b10b", 32))


def test_the_least_certain_cells_and_a_lattice_are_kept(monkeypatch):
    monkeypatch.setattr(received, "VALUES", 4000)
    monkeypatch.setattr(received, "CELLS", 200)
    soft = np.random.default_rng(1).normal(20, 2, (10, LAYOUT.cells)).astype(np.float32)
    weak = np.array([7, 500, 3001])
    soft[:, weak] = 0.5
    watcher = Watcher(LAYOUT)
    assert watcher.result() is None
    watcher.add(50, soft)
    watcher.add(70, -soft)  # a gap
    kept = watcher.result()
    assert kept is not None
    assert set(weak) <= set(kept.cells)
    assert 200 < kept.cells.size <= 400 and (np.diff(kept.cells) > 0).all()
    rows = LAYOUT.data[kept.cells] // LAYOUT.shape[1]
    assert rows.min() < 10 and rows.max() > LAYOUT.shape[0] - 10
    assert kept.symbols.size * kept.cells.size <= 4000
    assert kept.symbols.tolist()[:10] == list(range(50, 60))
    np.testing.assert_allclose(kept.soft[:10], soft[:, kept.cells], rtol=1e-3)


def test_a_symbol_read_twice_counts_as_read_last():
    soft = np.ones((4, LAYOUT.cells), np.float32)
    watcher = Watcher(LAYOUT)
    watcher.add(50, soft)
    watcher.add(52, -soft)
    kept = watcher.result()
    assert kept is not None
    assert kept.symbols.tolist() == [50, 51, 52, 53, 54, 55]
    assert kept.soft[:, 0].tolist() == [1, 1, -1, -1, -1, -1]


def test_levels_keep_decisions_and_resolve_small_values():
    soft = np.array([0.0, 1e-6, -1e-6, 0.5, -3.0, 60.0, -60.0], np.float32)
    level = levels_of(soft, 60.0)
    assert ((level > 0) == (soft > 0)).all()
    half = 0.5 * np.sqrt(60.0) / 127
    np.testing.assert_allclose(
        np.sqrt(60.0) * np.abs(level[3:]) / 127.0, np.sqrt(np.abs(soft[3:])), atol=half
    )
