"""Fronts proposed by a network that sees the planes of a scan: their rectangles, handles and joints."""
