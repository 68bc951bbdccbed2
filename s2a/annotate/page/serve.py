"""The annotation page as a server on this machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from s2a.annotate.editor import Editor
from s2a.annotate.page.panel import AnnotationPanel, Save
from s2a.scan.evidence.bounds import Bounds
from s2a.scene.geometry.camera import CameraPose
from s2a.scene.scene import Mesh
from s2a.view.page import glb
from s2a.view.page.room import PagePart, PageRoom
from s2a.view.page.serve import address, started
from s2a.view.page.thin import thinned

WIDTH = 400
"""[pixel] of the panel."""
SCAN = "scan"


@contextmanager
def served(
    editor: Editor, name: str, save: Save, bounds: Bounds, max_faces: int, view: CameraPose, fov: float, port: int
) -> Iterator[str]:
    """Serve the annotation page; yield its address.

    Args:
        editor: what is annotated.
        name: of the scan.
        save: writes an annotation and returns what to say about it.
        bounds: of the checks.
        max_faces: of the scan as it is shown.
        view: where the camera begins.
        fov: vertical field of view [rad].
        port: of the server; the next free one where it is taken.
    """
    with started(view, fov, port, WIDTH) as server:
        server.gui.set_panel_label(name)
        server.scene.add_glb(f"/{SCAN}", glb.encode(_fewer(editor.annotation.surface.mesh(), max_faces)))
        AnnotationPanel(server, editor, save, bounds)
        yield address(server)


def _fewer(mesh: Mesh, max_faces: int) -> Mesh:
    room = PageRoom(SCAN, {SCAN: PagePart(SCAN, mesh)}, {})
    return thinned(room, max_faces).parts[SCAN].surface
