"""Uploads of the pattern memory, counted."""

from __future__ import annotations

from typing import Any

import pytest

from rtl_model.host import Board, pattern


def counted_uploads(monkeypatch: pytest.MonkeyPatch) -> list[Board]:
    """A list that grows by the board of each upload from now on."""
    boards: list[Board] = []
    real = pattern.upload

    def upload(board: Board, *given: Any, **named: Any) -> int:
        boards.append(board)
        return real(board, *given, **named)

    monkeypatch.setattr(pattern, "upload", upload)
    return boards
