"""From a file to the planes that a panel shows."""
