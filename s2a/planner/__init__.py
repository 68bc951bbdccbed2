"""Tool paths to joint paths."""
