"""Command `s2a annotate`: annotate a scan in the browser, or let a network propose parts."""

import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from s2a.annotate import existing, files
from s2a.annotate.annotation import Draft, Editor, of_all
from s2a.annotate.propose import furniture
from s2a.annotate.propose.layers import ProposeConfig
from s2a.annotate.region import GrowConfig
from s2a.annotate.surface import SplitSurface
from s2a.core.bounds import AtLeast, Count
from s2a.core.check import text
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write, refuse_loss
from s2a.core.progress import report as say
from s2a.scan.evidence import Bounds
from s2a.scene.geometry.camera import OrbitCamera, framing_pose

START = np.array([1.0, 0.0, 0.0])  # From where the page's camera sees the room at first, turned by `camera`


@dataclass(frozen=True, kw_only=True)
class Config:
    """Keys of `s2a annotate`.

    Attributes:
        scan: folder of the scan; its annotation, if it has one, is read only with `edit`.
        out: folder that is written: the mesh, Articulate3D's two files, and annotate.json.
        auto: Propose fronts, joints and handles, by a network.
        edit: Begin with the scan's annotation by Articulate3D; what is not edited is written as it was.
        page: Serve the page, until Ctrl-C; without it, proposals are written as they are.
        port: port of the page's server; the next free one if it is taken.
        max_faces: maximum number of the scan's faces on the page; beyond, neighbouring vertices are merged.
        camera: first view of the page's camera.
        propose: proposals of fronts.
    """

    scan: Path
    out: Output
    auto: bool
    edit: bool
    page: bool
    port: Annotated[int, AtLeast(1, 65535)]
    max_faces: Count
    camera: OrbitCamera
    grow: GrowConfig = GrowConfig()  # how regions grow
    propose: ProposeConfig
    evidence: Bounds = Bounds()  # what the surface may say about the annotation


def run(config: Config) -> str:
    """Serve the page, or write the proposals; return what was written.

    Raises:
        InputError: no scan, keys that do nothing, or `out` is a file or a folder of something else.
    """
    if not (config.page or config.auto or config.edit):
        raise InputError(
            "keys 'page', 'auto' and 'edit' are all false, so that nothing would be annotated; give auto=true"
        )
    if config.auto and config.edit:
        raise InputError(
            "keys 'auto' and 'edit' are both true; give edit=true alone, or propose without the annotation"
        )
    scan = files.read(config.scan)
    refuse_loss(config.out, files.RECORD, [scan.files.mesh])
    surface = scan.surface
    earlier = existing.read(config.scan, scan.mesh, surface) if config.edit else None
    start = (
        earlier.start(surface) if earlier else _proposed(scan, surface, config) if config.auto else Draft(surface, ())
    )
    editor = Editor(start, config.grow)

    def save(annotation: Draft) -> str:
        with atomic_write(config.out, earlier=files.RECORD) as out:
            files.write(annotation, scan, out, earlier, annotated=str(config.scan), auto=config.auto, edit=config.edit)
        return _summary(annotation, config)

    if not config.page:
        return save(editor.annotation)
    from s2a.annotate.panel import served  # viser is of the extra "view"

    view = framing_pose(scan.mesh.vertices, START, config.camera)
    with served(
        editor, scan.files.name, save, config.evidence, config.max_faces, view, config.camera.fov, config.port
    ) as address:
        alone = "; page=false writes the proposals without a page" if config.auto else ""
        say(f"{scan.files.name} at {address}; Save writes {config.out}, Ctrl-C ends it{alone}")
        with suppress(KeyboardInterrupt):
            threading.Event().wait()
    return ""


def _proposed(scan: files.BareScan, surface: SplitSurface, config: Config) -> Draft:
    """Return proposals, their borders cut."""
    from s2a.annotate.propose.fronts import cut, propose  # torch takes seconds to load

    fronts = propose(surface, config.propose, config.grow, labels=furniture.labelled(scan))
    return cut(surface, fronts, config.grow)


def _summary(annotation: Draft, config: Config) -> str:
    """Return what was written, and what the surface says about it."""
    done = [item for item in annotation.items if item.joint is not None]
    handles = sum(len(item.handle) > 0 for item in done)
    kinds = ", ".join(f"{sum(item.name == name for item in done)} {name}" for name in sorted({i.name for i in done}))
    left = len(annotation.items) - len(done)
    summary = f"{config.out}: {len(done)} parts ({kinds or 'none'}), {handles} with a handle"
    summary += f"; {left} without a joint are left out" if left else ""
    if not done:
        return f"{summary}\n  next: draw parts on the page: s2a annotate scan={config.scan} out=..."
    return f"{summary}\n{text(of_all(annotation, config.evidence))}\n  next: s2a check scan={config.out}"
