"""Events after the pixels: the shared channel, the recording, and what is estimated from it."""
