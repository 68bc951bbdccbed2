"""Demonstrations: what a robot saw and did, as datasets that others train on."""
