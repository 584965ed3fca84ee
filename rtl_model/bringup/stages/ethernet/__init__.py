"""Stages of the bring-up that exist over UDP only."""
