"""Placement of an object: supports, candidates, poses, fit."""
