"""An imager's run: planned, filmed, checked and judged."""
