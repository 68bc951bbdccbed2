"""What `s2a <verb>` does: one module a verb, with its keys in `Config` and its steps in `run`."""
