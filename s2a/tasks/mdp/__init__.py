"""Shared parts of decision processes: the World struct; rewards, observations and metrics as functions of it."""
