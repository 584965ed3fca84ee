"""Evaluation of a transmission: errors, rates, delays, eye diagram, delivery."""
