"""Formats of mesh files, one module each: `NAME`, `ENDINGS`, `recognise(file)` and `read(file)`, which returns a `SourceMesh`.

A new format is one more module here, or in another package that registers it under the entry point group `s2a.scan.meshes`.
"""
