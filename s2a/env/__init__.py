"""Batched worlds as a vectorised environment."""
