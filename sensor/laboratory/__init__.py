"""Cameras measured as a laboratory would: photon transfer in the manner of EMVA 1288."""
