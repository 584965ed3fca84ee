"""The event path: first spikes of a pixel array as packets, in hardware, and the way back."""
