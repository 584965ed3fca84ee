"""The explorer of a stream behind a local server."""
