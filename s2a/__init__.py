"""Scan to action: annotated scans of rooms become USD scenes that robots and language models can act in.

`s2a.api` is the Python API, `s2a <command>` the command line (`s2a.commands`). Each folder is a room with one purpose, and
imports only those below it; docs/architecture.md lists them from the scan to the policy.
"""
