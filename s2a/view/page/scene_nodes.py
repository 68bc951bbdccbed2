"""The layers of a page in viser's scene: nodes that move with their joints, and can be shown and hidden."""

import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from threading import RLock

import numpy as np
import viser
import viser.transforms

from s2a.view.page import glb, layers
from s2a.view.page.glb import thinned
from s2a.view.page.layers import AXES, BY_PART, COLLIDERS, GRASPS, SURFACES, WALLS
from s2a.view.page.room import Coordinates, PageRoom

MAKERS = {
    SURFACES: layers.surfaces,
    BY_PART: layers.colored,
    COLLIDERS: layers.colliders,
    WALLS: layers.walls,
    GRASPS: layers.grasps,
    layers.SUPPORTS: layers.supports,
    layers.REACH: layers.reach,
}
TRANSLUCENT = 0.3  # Opacity of a description's boxes
ARROW_COLORS = {"prismatic": (30, 110, 255), "revolute": (210, 30, 200)}
SHAFT, HEAD, HEAD_LENGTH = 0.008, 0.02, 0.05  # [m] Radii of an arrow's shaft and head, and the length of its head
MARKED, MARK_OPACITY = (1.0, 0.5, 0.0), 0.7  # Linear RGB and opacity of the part that is selected
SELECTED, COARSE = "/selected", "coarse"
THINNED = (SURFACES, BY_PART)  # Layers that a coarse room can stand for


class SceneNodes:
    """What of a room is in viser's scene. A layer is sent when it is shown first; any thread may call.

    The still room is shown from its front only, which opens it to a camera outside; what moves is shown from behind, too.

    Attributes:
        at: the room, and where its joints stand.
        thin: the room with fewer faces, or None.
    """

    def __init__(self, scene: viser.SceneApi, room: PageRoom, root: str = "", coarse: PageRoom | None = None) -> None:
        """Show a room below a node; "": where its coordinates say.

        `coarse`: the room with fewer faces, which is sent first and shown until `refine`; None: the room alone.
        """
        self.at = Coordinates(room)
        self._scene, self._root = scene, root
        self.thin, self._coarse = coarse, coarse is not None
        self._shown: dict[str, bool] = {}
        self._lock = RLock()  # viser calls from several threads
        self._movers: dict[str, str | None] = {}
        self._hidden: set[str | None] = set()
        self._handles: dict[str, viser.SceneNodeHandle] = {}
        self._layers: dict[str, viser.SceneNodeHandle] = {}

    def show(self, layer: str, visible: bool = True) -> None:
        """Show or hide one of `layers.LAYERS`."""
        with self._lock:
            self._shown[layer] = visible
            self._update(layer)

    def coarsen(self) -> None:
        """Show fewer faces from now on, where there is a coarse room."""
        self._set_coarse(self.thin is not None)

    def load(self) -> bool:
        """Send what `refine` would show, hidden; return whether there was something to send."""
        with self._lock:
            missing = [layer for layer, shown in self._shown.items() if shown and layer not in self._layers]
            for layer in missing:
                self._send(layer, layer, self.at.room)
                self._layers[layer].visible = False
            return bool(missing)

    def refine(self) -> None:
        """Show all faces from now on."""
        self._set_coarse(False)

    def _set_coarse(self, coarse: bool) -> None:
        with self._lock:
            if coarse != self._coarse:
                self._coarse = coarse
                for layer in THINNED:
                    self._update(layer)

    def _update(self, layer: str) -> None:
        """Show and hide the two forms of a layer as they are now asked for."""
        coarse = self._coarse and layer in THINNED
        for key, room, wanted in ((layer, self.at.room, not coarse), (f"{COARSE}/{layer}", self.thin, coarse)):
            visible = wanted and self._shown.get(layer, False)
            if visible and key not in self._layers and room:
                self._send(key, layer, room)
            if key in self._layers:
                self._layers[key].visible = visible

    def _send(self, key: str, layer: str, room: PageRoom) -> None:
        self._layers[key] = self._scene.add_frame(self._path(key), show_axes=False)
        self._add(key, layer, room)

    def move(self, part: str, shown: float) -> None:
        """Move a joint, and what hangs on it, to a coordinate [mm] or [deg]."""
        with self._lock:
            self.at.set(part, shown)
            self._place(self.at.room.carried(part))

    def hide(self, movers: Iterable[str]) -> None:
        """Hide what moves with some parts, and show all else."""
        with self._lock:
            self._hidden = set(movers)
            for name, mover in self._movers.items():
                self._handles[name].visible = mover not in self._hidden

    def put(self, q: Mapping[str, float], moved: Mapping[str, np.ndarray]) -> None:
        """Put all joints at coordinates [m] or [rad], and free objects at displacements [4 4]."""
        with self._lock:
            self.at.q, self.at.moved = dict(q), dict(moved)
            self._place({i for part in q for i in self.at.room.carried(part)} | set(moved))

    def _place(self, movers: Iterable[str]) -> None:
        """Put the nodes that move with some jointed parts where their joints stand."""
        poses: Mapping[str | None, np.ndarray] = {mover: self.at.pose(mover) for mover in movers}
        for name, mover in self._movers.items():
            if mover in poses:
                turned, position = _pose(poses[mover])
                self._handles[name].wxyz = turned
                self._handles[name].position = position

    def select(self, part: str | None) -> None:
        """Mark a part; None: no part."""
        with self._lock:
            self._select(part)

    def _select(self, part: str | None) -> None:
        self._forget(self._root + SELECTED)
        if part is None or not len(self.at.room.parts[part].surface.faces):
            return
        chosen = self.at.room.parts[part]
        mark = glb.encode(layers.lifted(chosen.surface), MARKED, MARK_OPACITY, chosen.mover is not None)
        self._mesh(self._root + SELECTED, chosen.mover, mark)

    def _add(self, key: str, layer: str, room: PageRoom) -> None:
        if layer == AXES:
            for arrow in layers.arrows(room):
                self._arrow(f"{self._path(AXES)}/{arrow.name}", arrow, room.joints[arrow.name].kind)
            return
        opacity = TRANSLUCENT if room.boxes else 1.0
        baked = layer in THINNED and not room.boxes
        for node in MAKERS[layer](room):
            data = glb.encode(node.mesh, opacity=opacity, both_sides=node.mover is not None, baked=baked)
            self._mesh(f"{self._path(key)}/{node.name}", node.mover, data)

    def _mesh(self, name: str, mover: str | None, data: bytes) -> None:
        turned, position = _pose(self.at.pose(mover))
        self._keep(
            name,
            mover,
            self._scene.add_glb(name, data, wxyz=turned, position=position, cast_shadow=False, receive_shadow=False),
        )

    def _arrow(self, name: str, arrow: layers.Arrow, kind: str) -> None:
        turned, position = _pose(self.at.pose(arrow.mover))
        handle = self._scene.add_arrows(
            name,
            arrow.ends[None],
            ARROW_COLORS[kind],
            shaft_radius=SHAFT,
            head_radius=HEAD,
            head_length=HEAD_LENGTH,
            wxyz=turned,
            position=position,
        )
        self._keep(name, arrow.mover, handle)

    def _keep(self, name: str, mover: str | None, handle: viser.SceneNodeHandle) -> None:
        self._movers[name], self._handles[name] = mover, handle
        if mover in self._hidden:
            handle.visible = False

    def _forget(self, name: str) -> None:
        if handle := self._handles.pop(name, None):
            handle.remove()
            del self._movers[name]

    def _path(self, key: str) -> str:
        return f"{self._root}/{key}"


def _pose(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a displacement [4 4] as viser takes it: quaternion wxyz, position [m]."""
    return viser.transforms.SO3.from_matrix(matrix[:3, :3]).wxyz, matrix[:3, 3]


# So many the scene has at most while the camera turns: what two cores without a graphics processor draw
COARSE_FACES = 12_000
# [s] Without a move after which a camera is at rest, at least and at most, and faces that a slow browser draws in a
# second: it does not move again before an image of all faces is done. Should that take longer, a move comes just
# after all faces were shown, and the time is doubled
REST, LONGEST, DRAWN = 0.5, 3.0, 400_000.0
AGAIN = 2.0  # [s] Such a move comes within this time
FIRST = 1.5  # [s] Such a rest of the first visitor's camera before all faces are sent: the coarse room is drawn by then
LOADING = 1.5  # [s] For which the coarse room stays when all faces have been sent: the browser reads them


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
