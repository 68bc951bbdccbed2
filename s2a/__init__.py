"""Scan to action: annotated scans of rooms become USD scenes that robots and language models can act in."""
