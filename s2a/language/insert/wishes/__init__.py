"""Wishes in words: parsed into relations, and checked on the result."""
