"""The page of a run on its display: sections, figures, tables, and what films the panel."""
