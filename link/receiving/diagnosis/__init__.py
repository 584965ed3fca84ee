"""Why nothing, or not all, arrived: one cause, the figures that show it, and what to do."""
