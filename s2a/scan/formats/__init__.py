"""Formats of annotated scans, one module each: `NAME`, `recognise(folder)` and `read(folder)`, which returns a `Scene`.

A new format is one more module here, or in another package that registers it under the entry point group `s2a.scan.formats`
(docs/own_scan.md). `PRIORITY` says who is asked first: 30 and 20 have joints, 0 objects or a mesh that nobody annotated.
"""
