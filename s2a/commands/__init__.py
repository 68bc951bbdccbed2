"""The command line: one thin module a command, its keys in `Config`, its steps in `run`.

In: `key=value` arguments. Out: a call of the library, and one line for the terminal.
"""
