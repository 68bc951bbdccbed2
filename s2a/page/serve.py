"""The page as a server on this machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import viser

from s2a.geometry.orbit_camera import CameraPose
from s2a.page.panel import WIDTH, Panel
from s2a.page.room import PageRoom
from s2a.page.scene_nodes import SceneNodes

HOST = "127.0.0.1"
"""Nobody but this machine's users sees the page; from elsewhere: ssh -L 8080:localhost:8080 HOST."""


@contextmanager
def served(room: PageRoom, view: CameraPose, fov: float, port: int) -> Iterator[str]:
    """Serve the page of a room; yield its address.

    Args:
        room: what is shown.
        view: where its camera begins.
        fov: vertical field of view [rad].
        port: of the server; the next free one where it is taken.
    """
    server = viser.ViserServer(HOST, port, verbose=False)
    try:
        set_up(server, view, fov)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(WIDTH)
        Panel(server, SceneNodes(server.scene, room))
        yield f"http://localhost:{server.get_port()}"
    finally:
        server.stop()


def set_up(server: viser.ViserServer, view: CameraPose, fov: float) -> None:
    """Place camera and lights: the scan's colours hold its light already, so that much of it comes from everywhere."""
    server.scene.set_up_direction("+z")
    server.scene.configure_default_lights(cast_shadow=False)
    server.initial_camera.position, server.initial_camera.look_at = view.eye, view.target
    server.initial_camera.fov = fov
