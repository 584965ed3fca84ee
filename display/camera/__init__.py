"""A camera with a rolling shutter that films a panel: its frames, banding and flicker."""
