"""The common base: errors, configuration, outputs, progress, provenance, caches, worker processes.

In: values, files and terminals. Out: the same, checked; nothing here reads a room.
"""
