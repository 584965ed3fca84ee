"""Conventional imagers as whole machines: pixels, sequencer, registers, trace and report."""
