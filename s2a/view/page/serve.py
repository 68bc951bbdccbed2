"""The page as a server on this machine, and as one file that needs none."""

from __future__ import annotations

import html
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import viser

from s2a.scene.articulation import open_limit
from s2a.scene.geometry.camera import CameraPose
from s2a.view.page.glb import AMBIENT, LIGHTS
from s2a.view.page.layers import LARGE
from s2a.view.page.panel import WIDTH, Panel, first, offered
from s2a.view.page.room import PageRoom, unit
from s2a.view.page.scene_nodes import Detail, SceneNodes, coarse

HOST = "127.0.0.1"
"""Nobody but this machine's users sees the page; from elsewhere: ssh -L 8080:localhost:8080 HOST."""

NEAR = 0.05
"""[m] Nearer surfaces are cut; a smaller distance leaves far ones to flicker."""


@contextmanager
def served(room: PageRoom, view: CameraPose, fov: float, port: int) -> Iterator[str]:
    """Serve the page of a room; yield its address.

    Args:
        room: what is shown.
        view: where its camera begins.
        fov: vertical field of view [rad].
        port: of the server; the next free one where it is taken.
    """
    with started(view, fov, port, WIDTH) as server:
        nodes = SceneNodes(server.scene, room, coarse=coarse(room))
        detail = Detail(server, [nodes])
        Panel(server, nodes, detail)
        try:
            yield address(server)
        finally:
            detail.close()


@contextmanager
def started(view: CameraPose, fov: float, port: int, width: int) -> Iterator[viser.ViserServer]:
    """Start a server with camera, lights and an empty panel of `width` pixels at the right, as `served`; stop it at the end."""
    server = viser.ViserServer(HOST, port, verbose=False)
    try:
        set_up(server, view, fov)
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(width)
        yield server
    finally:
        server.stop()


def address(server: viser.ViserServer) -> str:
    """Return where a browser on this machine finds it."""
    return f"http://localhost:{server.get_port()}"


def set_up(server: viser.ViserServer, view: CameraPose, fov: float) -> None:
    """Place camera and lights: the scan's colours hold its light already, so that most of it comes from everywhere.

    An environment map would take software renderers many seconds to prepare.
    """
    scene = server.scene
    scene.set_up_direction("+z")
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_ambient("/light/all_around", intensity=AMBIENT)
    for name, intensity, direction in LIGHTS:
        scene.add_light_directional(f"/light/{name}", intensity=intensity, position=direction)
    server.initial_camera.position, server.initial_camera.look_at = view.eye, view.target
    server.initial_camera.fov, server.initial_camera.near = fov, NEAR


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
        title = f"<title>{html.escape(room.name)}</title>"
        path.write_text(serializer.as_html().replace(TITLE, title), encoding="utf-8")
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
