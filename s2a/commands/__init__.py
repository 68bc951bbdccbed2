"""Commands of the command line: one module per command, its keys in `Config`, its steps in `run`."""
