"""`viform link`: commands for links."""
