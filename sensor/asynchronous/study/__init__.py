"""The documents of `viform plan` and `viform accuracy` for an asynchronous camera."""
