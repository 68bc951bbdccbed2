"""Results that take seconds, kept by what they were made of: the same surfaces, settings and code give the same result.

Entries lie below ~/.cache/s2a, or $S2A_CACHE; any of them may be deleted at any time.
"""

import contextlib
import hashlib
import os
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Protocol

import numpy as np

Arrays = dict[str, np.ndarray]


class Triangles(Protocol):
    """A triangle mesh, as `s2a.scene.scene.Mesh` is one."""

    @property
    def vertices(self) -> np.ndarray: ...  # noqa: D102
    @property
    def faces(self) -> np.ndarray: ...  # noqa: D102
    @property
    def colors(self) -> np.ndarray | None: ...  # noqa: D102


Key = Sequence[Triangles | np.ndarray | str]  # What a result depends on, beside the code
# Those whose version changes what is kept
LIBRARIES = ("coacd", "vhacdx", "numpy", "scipy", "trimesh", "pyfqmr", "warp-lang", "newton", "usd-core")
# What reading a damaged or foreign entry raises
UNREADABLE = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)


def folder() -> Path:
    """Return where entries lie."""
    return Path(os.environ.get("S2A_CACHE") or Path.home() / ".cache" / "s2a")


def recall(kind: str, of: Key, make: Callable[[], Mapping[str, np.ndarray]]) -> Arrays:
    """Return named arrays from the cache, or make them and keep them.

    An entry that cannot be read is made again, and one that cannot be written is not kept. Several processes may write
    the same entry at once: each writes aside and renames.

    Args:
        kind: what is made; entries of one kind lie in a folder of that name.
        of: all that the result depends on, beside the code.
        make: makes it.
    """
    arrays = find(kind, of)
    if arrays is None:
        arrays = dict(make())
        keep(kind, of, arrays)
    return arrays


def find(kind: str, of: Key) -> Arrays | None:
    """Return an entry of the cache; None where there is none that can be read."""
    try:
        with np.load(_path(kind, of), allow_pickle=False) as entry:
            return dict(entry)
    except UNREADABLE:
        return None


def keep(kind: str, of: Key, made: Mapping[str, np.ndarray]) -> None:
    """Keep an entry in the cache, if it can be written."""
    _keep(_path(kind, of), dict(made))


def key(of: Key) -> str:
    """Return the digest of meshes, arrays and words, in their order, and of the code that works on them."""
    digest = hashlib.blake2b(_code(), digest_size=20)
    for item in of:
        arrays = [item] if isinstance(item, (str, np.ndarray)) else [item.vertices, item.faces, item.colors]
        for value in arrays:
            array = np.ascontiguousarray(value) if isinstance(value, np.ndarray) else np.array(str(value))
            digest.update(f"{array.dtype} {array.shape} ".encode())
            digest.update(array.tobytes())
    return digest.hexdigest()


def _path(kind: str, of: Key) -> Path:
    return folder() / kind / f"{key(of)}.npz"


def _keep(path: Path, arrays: Arrays) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as file:
            try:
                np.savez(file, **arrays)  # type: ignore[arg-type]
                file.close()
                os.replace(file.name, path)
            except BaseException:
                os.unlink(file.name)
                raise
    except OSError:
        return  # a full or read-only disk costs time, not the result


@cache
def _code() -> bytes:
    """Return the digest of all code of the package, and of the libraries whose results are kept: other code, other results."""
    package, digest = Path(__file__).parents[1], hashlib.blake2b()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.read_bytes())
    for name in LIBRARIES:
        with contextlib.suppress(PackageNotFoundError):
            digest.update(f"{name} {version(name)} ".encode())
    return digest.digest()
