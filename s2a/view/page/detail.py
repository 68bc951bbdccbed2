"""Level of detail of a page: fewer faces while the camera turns, all of them once it rests."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence

import numpy as np
import viser

from s2a.view.page.room import PageRoom
from s2a.view.page.scene_nodes import SceneNodes
from s2a.view.page.thin import thinned

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
