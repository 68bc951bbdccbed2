"""What of a room does not move: its colliders, and what is seen of it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from s2a.core.progress import track
from s2a.prepare.colliders.room import RoomConfig, part_hulls
from s2a.prepare.target import bodies
from s2a.scene.geometry.simplify import DecimateConfig, Decimated, decimate_room
from s2a.scene.scene import Scene
from s2a.scene.usd.sim_scene import Collider


class StaticRoom:
    """The static room of a scene; what was made of it once is kept."""

    def __init__(self, scene: Scene, room: RoomConfig, decimate: DecimateConfig) -> None:
        self._scene, self._room, self._decimate = scene, room, decimate
        self._hulls: dict[tuple[str, int], tuple[Collider, ...]] = {}
        self._visuals: dict[tuple[str, ...], Decimated] = {}

    def ahead(self, articulated: Sequence[str]) -> None:
        """Make it as it is if all these parts can be prepared and no object is extracted."""
        static = [i for i, owner in bodies(self._scene, articulated).items() if owner is None]
        self.visual(static)
        self.colliders(static)

    def colliders(self, parts: Sequence[str], fine: Collection[str] = ()) -> list[Collider]:
        """Return the convex hulls of static parts, named after these; more of those that are `fine`."""
        found = []
        for part in track([i for i in parts if len(self._scene.parts[i].mesh.faces)], "room colliders"):
            config = replace(self._room, part_hulls=self._room.furniture_hulls) if part in fine else self._room
            if (key := (part, config.part_hulls)) not in self._hulls:
                self._hulls[key] = part_hulls(self._scene.parts[part], config)
            found += [Collider(part, hull.mesh, hull.structure) for hull in self._hulls[key]]
        return found

    def visual(self, parts: Sequence[str]) -> Decimated:
        """Return static parts as one mesh with fewer faces."""
        asked = tuple(parts)
        if asked not in self._visuals:
            self._visuals[asked] = decimate_room(self._scene, parts, self._decimate)
        return self._visuals[asked]
