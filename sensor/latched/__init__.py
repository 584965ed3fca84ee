"""The latched pixel: settings, tiers, effects, and the camera as a stage."""
