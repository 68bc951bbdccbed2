"""Evidence from the scanned surface about annotated parts and joints, for `s2a check` and for validation reports.

Every function compares an annotation with what was scanned, never with what was derived from the same annotation.
"""
