"""Untrusted scripts: a policy on their text, a sandbox for their process, a comparison of their result with the plan."""
