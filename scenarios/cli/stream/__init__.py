"""Commands on streams of spikes: convert and image."""
