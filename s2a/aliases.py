"""Names of configuration keys that have changed, so that an old command line says what to write instead."""

from __future__ import annotations

from collections.abc import Collection

RENAMED = {
    "picture": "image",
    "look": "camera",
    "see_through": "backface_culling",
    "confinement": "sandbox",
    "mechanisms": "layers",
    "needs": "required_guarantees",
    "pieces": "hulls",
    "full": "min_fill_fraction",
    "vertices": "max_vertices",
    "settle": "drop_test",
    "longest": "max_tokens",
    "bytes": "max_response_bytes",
}
"""Old name of one segment of a dotted key -> its present name."""


def current(key: str, known: Collection[str]) -> str | None:
    """Return the present name of a dotted key that had another one, if it is among the known keys or their groups; else None."""
    renamed = ".".join(RENAMED.get(segment, segment) for segment in key.split("."))
    exists = any(name == renamed or name.startswith(f"{renamed}.") for name in known)
    return renamed if renamed != key and exists else None
