"""Recorded worlds, from a file of s2a evaluate or a dataset of s2a collect, for the page that plays them."""
