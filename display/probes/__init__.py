"""Probes: small test light that a camera films and a display shows, for latency, blur, flicker."""
