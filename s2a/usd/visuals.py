"""What there is to see in a scan or a stage: its surfaces, or what stands for them in contacts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pxr import Usd, UsdPhysics

from s2a import scan
from s2a.errors import InputError
from s2a.scene import Mesh, Scene
from s2a.usd import geometric, sim_stage
from s2a.usd.stage import open_stage, read_attribute, read_mesh, reading


@dataclass(frozen=True)
class Visible:
    """Surfaces in scene coordinates.

    Attributes:
        name: of the scan.
        surfaces: what is seen, by the id of its part or the name of its prim.
        colliders: convex pieces with the part each stands for; none but in a simulation-ready stage.
        jointed: ids of the parts that move.
    """

    name: str
    surfaces: dict[str, Mesh]
    colliders: tuple[tuple[str, Mesh], ...]
    jointed: tuple[str, ...]

    def part(self, part_id: str) -> list[Mesh]:
        """Return the surfaces that bear a part's name, or else its colliders; InputError where it has neither."""
        pieces = [mesh for part, mesh in self.colliders if part == part_id]
        found = [self.surfaces[part_id]] if part_id in self.surfaces else pieces
        found = [mesh for mesh in found if len(mesh.faces)]
        if not found:
            known = dict.fromkeys([*self.surfaces, *(part for part, _ in self.colliders)])
            raise InputError(f"part {part_id!r} has no surface in {self.name!r}; those with one: {', '.join(known)}")
        return found


def visible(path: Path) -> Visible:
    """Read what there is to see in a scan's folder, a geometric or a simulation-ready stage.

    Raises:
        InputError: another file, or a damaged one.
    """
    if path.is_dir():
        return _scene(scan.read(path))
    with reading(path):
        stage = open_stage(path)
        flavour = read_attribute(stage.GetDefaultPrim(), "flavour", str)
        if flavour == geometric.FLAVOUR:
            return _scene(geometric.read(path))
        if flavour == sim_stage.FLAVOUR:
            return _simready(stage.GetDefaultPrim())
    raise InputError(f"{path}: holds no surfaces; give a scan's folder, a geometric or a simulation-ready stage")


def _scene(scene: Scene) -> Visible:
    return Visible(scene.name, {i: part.mesh for i, part in scene.parts.items()}, (), scene.movable)


def _simready(root: Usd.Prim) -> Visible:
    visuals = {prim.GetName(): prim.GetChild("visual") for prim in root.GetChildren() if prim.GetChild("visual")}
    pieces = [prim for prim in Usd.PrimRange(root) if prim.HasAPI(UsdPhysics.CollisionAPI)]
    return Visible(
        read_attribute(root, "name", str, ""),
        {name: read_mesh(prim) for name, prim in visuals.items()},
        tuple((read_attribute(prim, "part", str, "?"), read_mesh(prim)) for prim in pieces),
        (read_attribute(root, "target", str, ""),),
    )
