"""A display behind any source: its stages, its outcome, its page, and the camera that films it."""
