"""Annotation of a bare scan: regions, joints and handles from clicks or from a network's proposals.

In: a scan. Out: an annotated scan in Articulate3D's files.
"""
