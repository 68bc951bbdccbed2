"""Levels of detail: fewer faces for files and for a moving camera, all of them once it rests."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import viser

from s2a.scene.scene import Mesh
from s2a.view.page.room import PagePart, PageRoom
from s2a.view.page.scene_nodes import SceneNodes

MOVING = 0.5
"""Fraction of the faces that jointed parts may have between them, before they lose any."""
MIN_CELL, MAX_SCALE = 1e-4, 1e3
"""Bounds of the cells [m] and of their scale [m^0.5]: where the search for it begins and gives up."""
STEP = 1.05
"""Factor by which cells grow from round to round at least."""


def thinned(room: PageRoom, max_faces: int) -> PageRoom:
    """Return a room whose surfaces have so many faces at most; those that move keep theirs as long as they can."""
    moving = {i: part for i, part in room.parts.items() if part.mover is not None}
    still = {i: part for i, part in room.parts.items() if part.mover is None}
    if _count(moving) + _count(still) <= max_faces:
        return room
    moving = _fewer(moving, max(int(MOVING * max_faces), max_faces - _count(still)))
    still = _fewer(still, max_faces - _count(moving))
    return replace(room, parts={i: moving.get(i) or still[i] for i in room.parts})


def clustered(mesh: Mesh, cell: float) -> Mesh:
    """Return a mesh whose vertices are the mean of those in each cell of a grid [m], with their mean colour."""
    if not len(mesh.vertices):
        return mesh
    index = np.floor((mesh.vertices - mesh.bounds[0]) / cell).astype(np.int64)
    width = index.max(axis=0) + 1
    keys = (index[:, 0] * width[1] + index[:, 1]) * width[2] + index[:, 2]
    _, owner, size = np.unique(keys, return_inverse=True, return_counts=True)
    faces = owner[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    colors = None if mesh.colors is None else np.rint(_means(mesh.colors, owner, size))
    return Mesh(_means(mesh.vertices, owner, size), faces, colors)


def _means(values: np.ndarray, owner: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return the mean of the values [n 3] of each owner."""
    return np.stack([np.bincount(owner, column, len(size)) for column in values.T], axis=1) / size[:, None]


def _fewer(parts: dict[str, PagePart], max_faces: int) -> dict[str, PagePart]:
    """Return parts with so many faces at most; a cell grows with the root of its part's size, so that small things last."""
    seen = {i: part.surface for i, part in parts.items() if len(part.surface.faces)}
    roots = {i: float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))) ** 0.5 for i, mesh in seen.items()}
    count, found = _count(parts), parts
    scale = np.sqrt(
        sum(mesh.face_areas.sum() / max(roots[i], 1e-6) ** 2 for i, mesh in seen.items()) / max(max_faces, 1)
    )
    while count > max_faces:
        meshes = {i: clustered(mesh, max(scale * roots[i], MIN_CELL)) for i, mesh in seen.items()}
        found = {i: replace(part, surface=meshes.get(i, part.surface)) for i, part in parts.items()}
        count = _count(found)
        scale = max(scale, MIN_CELL) * max(np.sqrt(count / max(max_faces, 1)), STEP)
        if not count or scale > MAX_SCALE:
            break
    return found


def _count(parts: dict[str, PagePart]) -> int:
    return sum(len(part.surface.faces) for part in parts.values())


COARSE_FACES = 12_000
"""So many the scene has at most while the camera turns: what two cores without a graphics processor draw."""
REST, LONGEST, DRAWN = 0.5, 3.0, 400_000.0
"""[s] Without a move after which a camera is at rest, at least and at most, and faces that a slow browser draws in a second:
it does not move again before an image of all faces is done. Should that take longer, a move comes just after all
faces were shown, and the time is doubled."""
AGAIN = 2.0
"""[s] Such a move comes within this time."""
FIRST = 1.5
"""[s] Such a rest of the first visitor's camera before all faces are sent: the coarse room is drawn by then."""
LOADING = 1.5
"""[s] For which the coarse room stays when all faces have been sent: the browser reads them."""


def coarse(room: PageRoom, count: int = 1) -> PageRoom | None:
    """Return a room that is drawn while the camera turns, if `count` of them stand side by side; None: it is as it is."""
    return thinned(room, COARSE_FACES // count) if room.faces * count > COARSE_FACES else None


class Detail:
    """Watches the cameras of all visitors, in a thread of its own.

    Attributes:
        fixed: All faces are shown always.
    """

    def __init__(self, server: viser.ViserServer, nodes: Sequence[SceneNodes]) -> None:
        """Begin to watch; `nodes` begin with their coarse rooms."""
        self.fixed = False
        self._nodes, self._last, self._refined = nodes, 0.0, -np.inf
        faces = sum(each.at.room.faces for each in nodes)
        self._first, self._rest = True, min(max(REST, faces / DRAWN), LONGEST)
        self._moved, self._ended = threading.Event(), threading.Event()
        server.on_client_connect(self._connected)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def moved(self) -> None:
        """Show fewer faces until nothing has moved for a while: a camera, or something that plays."""
        self._last = time.monotonic()
        self._moved.set()

    def close(self) -> None:
        """End the thread."""
        self._ended.set()
        self._moved.set()
        self._thread.join()

    def _connected(self, client: viser.ClientHandle) -> None:
        client.camera.on_update(lambda _: self.moved())

    def _run(self) -> None:
        while not self._ended.is_set():
            self._moved.wait()
            self._moved.clear()
            if not self.fixed:
                self._each(SceneNodes.coarsen)
            if time.monotonic() - self._refined < AGAIN:
                self._rest = min(2 * self._rest, LONGEST)
            if self._rests(FIRST if self._first else self._rest) and (not self._load() or self._rests(LOADING)):
                self._moved.clear()  # its moves have been waited for
                self._each(SceneNodes.refine)
                self._refined = time.monotonic()

    def _load(self) -> bool:
        """Send all faces, once they are wanted; return whether there was something to send."""
        self._first = False
        return any([nodes.load() for nodes in self._nodes])

    def _rests(self, seconds: float) -> bool:
        """Wait until nothing has moved for so long; return False at the end."""
        since = time.monotonic()
        while (left := max(self._last, since) + seconds - time.monotonic()) > 0.0:
            if self._ended.wait(left):
                return False
        return True

    def _each(self, step: Callable[[SceneNodes], None]) -> None:
        for nodes in self._nodes:
            step(nodes)
