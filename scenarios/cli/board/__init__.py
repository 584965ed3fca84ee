"""`viform board`: commands for test boards."""
