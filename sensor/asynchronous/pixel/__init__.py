"""The asynchronous pixel: from light to the instants at which it fires."""
