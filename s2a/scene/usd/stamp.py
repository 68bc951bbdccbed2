"""The result of the last validation, stamped into the stage that it is of, with the hash of what was validated."""

import hashlib
import os
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from pxr import Ar, Sdf, Usd

from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write, require_writable
from s2a.scene.usd.stage import PACKAGE, reading, refuse_deep, save_layer


def files(path: Path) -> list[Path]:
    """Return the files that a stage is composed of, its own first: its layers, what they stand over and refer to.

    Raises:
        InputError: a damaged file.
    """
    refuse_deep(path)
    with reading(path):
        stage = Usd.Stage.Open(str(path))  # its layers live as long as it does
        # Of a layer in a .usdz this is the package.
        names = [Ar.SplitPackageRelativePathOuter(layer.realPath)[0] for layer in stage.GetUsedLayers()]
        others = {Path(os.path.realpath(name)) for name in names if name}
    return [path, *sorted(others - {Path(os.path.realpath(path))})]


LAYERS = (".usd", ".usda", ".usdc", PACKAGE)  # endings; what else is in a package is images
KEY = "s2a:validation"  # In the root layer's customLayerData


@dataclass(frozen=True)
class Stamp:
    """What a validation found."""

    sha256: str  # `content_hash` of what was validated
    parts: dict[str, bool]  # by the id of each articulated part: no check failed
    valid: bool  # the stage is still what was validated


def content_hash(path: Path) -> str:
    """Return the SHA-256 of the content of all files that a stage is made of, its own without a stamp."""
    digest = hashlib.sha256(layer_hash(path).encode())
    for data in _others(path):
        digest.update(data)
    return digest.hexdigest()


def _others(path: Path) -> Iterator[bytes]:
    """Yield what the layers of a stage beside its own hold; those of a package are in it."""
    if path.suffix.lower() != PACKAGE:
        yield from (file.read_bytes() for file in files(path)[1:])
        return
    with zipfile.ZipFile(path) as package:
        yield from (package.read(name) for name in sorted(package.namelist()[1:]) if name.lower().endswith(LAYERS))


def require_stampable(path: Path) -> None:
    """Raise an InputError with what to do unless a stage can be stamped."""
    if path.suffix.lower() == PACKAGE:
        raise InputError(
            f"{path}: a package cannot be stamped; give stamp=false, or certify the stage that it was made of"
        )
    require_writable(path, "give stamp=false, or copy it to where it can be stamped")


def layer_hash(path: Path) -> str:
    """Return the SHA-256 of the content of a stage's own layer without a stamp: what physics depends on, not the visuals."""
    return hashlib.sha256(_text(path).encode()).hexdigest()


def write_stamp(path: Path, parts: Mapping[str, bool]) -> None:
    """Stamp verdicts into a stage's own layer, beside those of other parts of the same content."""
    earlier, digest = read_stamp(path), content_hash(path)
    earlier_parts = earlier.parts if earlier and earlier.valid else {}
    with atomic_write(path) as out:
        layer = _copy(path)
        verdicts = {part: bool(passed) for part, passed in {**earlier_parts, **parts}.items()}
        layer.customLayerData = {**layer.customLayerData, KEY: {"sha256": digest, "parts": verdicts}}
        save_layer(layer, out, (path.suffix,))


def read_stamp(path: Path) -> Stamp | None:
    """Return the stamp of a stage; None where there is none, or none that can be read."""
    with reading(path):
        record = _open(path).customLayerData.get(KEY)
    if not isinstance(record, dict) or not isinstance(record.get("parts"), dict):
        return None
    parts = {str(part): bool(passed) for part, passed in record["parts"].items()}
    digest = str(record.get("sha256"))
    return Stamp(digest, parts, digest == content_hash(path))


def _open(path: Path) -> Sdf.Layer:
    layer = Sdf.Layer.FindOrOpen(str(path))
    if layer is None:
        raise InputError(f"{path}: not a USD file, or a damaged one; write it again with s2a prepare")
    layer.Reload(force=True)
    return layer


def _copy(path: Path) -> Sdf.Layer:
    copy = Sdf.Layer.CreateAnonymous(".usda" if path.suffix.lower() == PACKAGE else path.suffix)
    with reading(path):
        copy.TransferContent(_open(path))
    return copy


def _text(path: Path) -> str:
    """Return a layer as text, without a stamp."""
    layer = _copy(path)
    data = {key: value for key, value in layer.customLayerData.items() if key != KEY}
    if data:
        layer.customLayerData = data
    else:
        layer.ClearCustomLayerData()
    return layer.ExportToString()
