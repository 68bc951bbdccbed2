"""The page as one file without a server: viser's own player, in which every joint opens and closes once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import viser

from s2a.scene.articulation import open_limit
from s2a.scene.geometry.orbit_camera import CameraPose
from s2a.view.page.layers import LARGE
from s2a.view.page.panel import first, offered
from s2a.view.page.room import PageRoom, unit
from s2a.view.page.scene_nodes import SceneNodes
from s2a.view.page.serve import HOST, set_up

PORT = 8090
"""The player is written by a server that nobody visits."""
SECONDS, FRAMES = 2.0, 30
"""Time that a joint takes to open and close, and its frames."""
PAUSE = 0.5
"""[s] before each joint."""
TITLE = "<title>Viser</title>"


def write(room: PageRoom, view: CameraPose, fov: float, path: Path) -> None:
    """Write a room to one self-contained HTML file: all layers, and a time line on which its joints open one by one.

    Args:
        room: what is shown.
        view: where its camera begins.
        fov: vertical field of view [rad].
        path: the file.
    """
    server = viser.ViserServer(HOST, PORT, verbose=False)
    try:
        set_up(server, view, fov)
        nodes = SceneNodes(server.scene, room)
        for layer in (each for each in offered(room) if each not in LARGE):
            nodes.show(layer)
            nodes.show(layer, layer == first(room))
        names = {part: server.scene.add_label(f"/names/{part}", part, visible=False) for part in room.joints}
        serializer = server.get_scene_serializer()
        for part, fractions in timeline(room):
            serializer.insert_sleep(PAUSE)
            names[part].position, names[part].visible = _top(room, part), True
            for fraction in fractions:
                nodes.move(part, fraction * open_limit(room.joints[part]) / unit(room.joints[part])[1])
                serializer.insert_sleep(SECONDS / FRAMES)
            names[part].visible = False
        path.write_text(serializer.as_html().replace(TITLE, f"<title>{room.name}</title>"))
    finally:
        server.stop()


def timeline(room: PageRoom) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the jointed parts with the fractions of their open limit through which they pass, 0 at the end."""
    for part in room.joints:
        yield part, 0.5 - 0.5 * np.cos(np.linspace(0.0, 2.0 * np.pi, FRAMES + 1)[1:])


def _top(room: PageRoom, part: str) -> np.ndarray:
    """Return the place of a part's name [m], shape [3]: above its middle; on its joint where it has no surface."""
    low, high = room.parts[part].surface.bounds
    return np.array(room.joints[part].origin) if np.isnan(low).any() else np.array([*(low + high)[:2] / 2, high[2]])
