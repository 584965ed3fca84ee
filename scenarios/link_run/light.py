"""How much light a run's cells bring, and what shines in any case: the air's own closed forms."""

from __future__ import annotations

from link.air import light_levels
from scenarios.link_run.reach import CellScene
from scenarios.linking import LinkSetting

__all__ = ["cell_scene", "transmission"]
