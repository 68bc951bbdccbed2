"""The page's controls: layers, a slider for every joint, the tree of parts, the part that is selected."""

from collections.abc import Callable
from typing import Literal

import numpy as np
import viser

from s2a.scene.articulation import open_limit
from s2a.scene.scene import Mesh
from s2a.view.page import layers
from s2a.view.page.cards import PLACE, card, noted, row, rows, step_card
from s2a.view.page.room import Coordinates, PagePart, PageRoom, unit
from s2a.view.page.scene_nodes import Detail, SceneNodes

PARALLEL = 1e-15  # [m^2] A triangle of which a ray sees less is not met


def pick(at: Coordinates, origin: np.ndarray, direction: np.ndarray) -> str | None:
    """Return the id of the part that a ray meets first, with the joints where they stand, or None.

    The still room is not shown from behind, and not met from there either. Of the boxes of a description, which hold each
    other, it is the smallest one that the ray meets.

    Args:
        at: the room, and its joints' coordinates.
        origin: where the ray begins [m], scene coordinates, shape [3].
        direction: where it leads, shape [3].
    """
    nearest, hit = np.inf, None
    backs = {mover: np.linalg.inv(at.pose(mover)) for mover in {part.mover for part in at.room.parts.values()}}
    for part_id, part in at.room.parts.items():
        limit = np.inf if at.room.boxes else nearest
        distance = _distance(part, backs[part.mover], origin, direction, limit)
        rank = float(part.surface.face_areas.sum()) if at.room.boxes and distance < np.inf else distance
        if rank < nearest:
            nearest, hit = rank, part_id
    return hit


def _distance(part: PagePart, back: np.ndarray, origin: np.ndarray, direction: np.ndarray, nearest: float) -> float:
    """Return how far along a ray [multiple of its direction] the surface of a part is; inf where it misses it."""
    if not len(part.surface.faces):
        return np.inf
    start, way = back[:3, :3] @ origin + back[:3, 3], back[:3, :3] @ direction
    if _enters(part.surface.bounds, start, way) >= nearest:
        return np.inf
    return first_face(part.surface, start, way, part.mover is not None)[0]


def _enters(box: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> float:
    """Return where a ray enters a box [2 3], 0 if it begins in it; inf where it misses it."""
    safe = np.where(direction == 0.0, 1e-30, direction)
    ends = np.sort((box - origin) / safe, axis=0)
    enter, leave = max(ends[0].max(), 0.0), ends[1].min()
    return float(enter) if enter <= leave else np.inf


def first_face(mesh: Mesh, origin: np.ndarray, direction: np.ndarray, both_sides: bool) -> tuple[float, int]:
    """Return where a ray meets a mesh first, and the face (Moeller and Trumbore, 1997); inf and -1 where it does not.

    Args:
        mesh: what is met.
        origin: where the ray begins [m], shape [3].
        direction: where it leads, shape [3]; the distance is a multiple of it.
        both_sides: Faces are met from behind, too.
    """
    corner = mesh.vertices[mesh.faces[:, 0]]
    one, other = mesh.vertices[mesh.faces[:, 1]] - corner, mesh.vertices[mesh.faces[:, 2]] - corner
    across = np.cross(direction, other)
    size = np.einsum("ij,ij->i", one, across)
    seen = np.flatnonzero((np.abs(size) if both_sides else size) > PARALLEL)
    one, other, across, size = one[seen], other[seen], across[seen], size[seen]
    offset = origin - corner[seen]
    turned = np.cross(offset, one)
    u, v = np.einsum("ij,ij->i", offset, across) / size, turned @ direction / size
    along = np.einsum("ij,ij->i", other, turned) / size
    inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (along > 0.0)
    if not inside.any():
        return np.inf, -1
    nearest = np.flatnonzero(inside)[np.argmin(along[inside])]
    return float(along[nearest]), int(seen[nearest])


MARKS = ".mantine-Slider-markLabel { margin-top: 0.4em; }"  # The numbers below a slider keep clear of its thumb
CARDS = f"""<style>
{MARKS}
.s2a-card {{ padding: 0 0.75em 0.5em; font-size: 0.875em; line-height: 1.45; overflow-wrap: anywhere; }}
.s2a-card td {{ vertical-align: top; padding-right: 1em; }}
.s2a-card td:first-child {{ color: gray; white-space: nowrap; }}
</style>"""
# Rows of the tree are viser's buttons: flat, and to the left; the yellow one is selected
ROWS = """<style>
button.mantine-Button-root:not([data-variant]), button.mantine-Button-root[data-variant="filled"] {
  background: transparent; color: inherit; font-weight: 400; height: 1.7em !important; padding: 0 0.4em; }
button.mantine-Button-root:not([data-variant="outline"]) .mantine-Button-inner { justify-content: start; }
button.mantine-Button-root:not([data-variant="outline"]):hover { background: rgba(128, 128, 128, 0.15); }
button.mantine-Button-root[style*="yellow"] { background: rgba(255, 170, 0, 0.35) !important; }
div:has(> button.mantine-Button-root:not([data-variant="outline"])) { padding-bottom: 0.1em !important; }
</style>"""
PLAIN_ROW: Literal["gray"] = "gray"
SELECTED_ROW: Literal["yellow"] = "yellow"
FEWER = "coarse in motion"
WIDTH = 380  # [pixel] of the panel


class Panel:
    """The controls beside the scene."""

    def __init__(self, server: viser.ViserServer, nodes: SceneNodes, detail: Detail | None = None) -> None:
        self._detail, self._nodes, self._room, self._server = detail, nodes, nodes.at.room, server
        self._sliders: dict[str, viser.GuiSliderHandle] = {}
        self._rows: dict[str, viser.GuiButtonHandle] = {}
        self._selected: str | None = None
        gui = server.gui
        gui.set_panel_label(self._room.name)
        gui.add_html(CARDS + ROWS)
        with gui.add_folder("Show"):
            self._add_layers()
        self._card = gui.add_html(card(self._room, None))
        tabs = gui.add_tab_group()
        with tabs.add_tab(f"Joints ({len(self._room.joints)})"):
            self._add_joints()
        if self._room.notes:
            with tabs.add_tab(f"Notes ({len(self._room.notes)})"):
                self._add_steps()
                gui.add_html(noted(self._room))
        with tabs.add_tab(f"Parts ({len(self._room.parts)})"):
            self._add_tree()
        server.scene.on_click()(self._clicked)

    def select(self, part: str | None) -> None:
        """Mark a part and show its facts; None: no part."""
        self._nodes.select(part)
        self._card.content = card(self._room, part)
        if self._selected is not None:
            self._rows[self._selected].color = PLAIN_ROW
        if part is not None:
            self._rows[part].color = SELECTED_ROW
        self._selected = part

    def _add_layers(self) -> None:
        for layer in offered(self._room):
            box = self._server.gui.add_checkbox(layer, layer == first(self._room))
            box.on_update(self._showing(layer))
            self._nodes.show(layer, box.value)
        if self._detail and self._nodes.thin:
            box = self._server.gui.add_checkbox(FEWER, True)
            box.on_update(self._fixing(self._detail))

    def _add_joints(self) -> None:
        gui = self._server.gui
        all_joints = gui.add_button_group("all joints", ("close", "half", "open"))
        all_joints.on_click(lambda event: self._move_all({"close": 0.0, "half": 0.5, "open": 1.0}[event.target.value]))
        for part, joint in self._room.joints.items():
            name, size = unit(joint)
            low, high = sorted((*joint.limits, 0.0))[::2]
            slider = gui.add_slider(f"{part} [{name}]", round(low / size, 1), round(high / size, 1), 0.1, 0.0)
            slider.on_update(self._moving(part))
            self._sliders[part] = slider

    def _add_steps(self) -> None:
        """Add a slider through the steps of an insertion: objects come one after the other."""
        taken = steps(self._room)
        if not taken:
            return
        slider = self._server.gui.add_slider("step", 0, len(taken), 1, len(taken))
        text = self._server.gui.add_html("")

        def show() -> None:
            placed = {part for part, name, _ in taken[: slider.value] if name == PLACE}
            self._nodes.hide(set(self._room.inserted) - placed)
            now = taken[slider.value - 1] if slider.value else ("", "before", "nothing is inserted yet")
            text.content = step_card(*now)
            self.select(now[0] if now[0] in placed else None)

        slider.on_update(lambda _: show())

    def _move_all(self, fraction: float) -> None:
        with self._server.atomic():
            for part, joint in self._room.joints.items():
                opened = round(fraction * open_limit(joint) / unit(joint)[1], 1)
                self._sliders[part].value = opened  # type: ignore[misc] # mypy overlooks its setter

    def _add_tree(self) -> None:
        for part, depth in rows(self._room):
            self._rows[part] = self._server.gui.add_button(row(self._room, part, depth), color=PLAIN_ROW)
            self._rows[part].on_click(self._selecting(part))

    def _showing(self, layer: str) -> Callable[[viser.GuiEvent], None]:
        return lambda event: self._nodes.show(layer, event.target.value)

    def _fixing(self, detail: Detail) -> Callable[[viser.GuiEvent], None]:
        def fix(event: viser.GuiEvent) -> None:
            detail.fixed = not event.target.value

        return fix

    def _moving(self, part: str) -> Callable[[viser.GuiEvent], None]:
        return lambda event: self._nodes.move(part, event.target.value)

    def _selecting(self, part: str) -> Callable[[viser.GuiEvent], None]:
        return lambda event: self.select(part)

    def _clicked(self, event: viser.SceneClickEvent) -> None:
        self.select(pick(self._nodes.at, np.array(event.ray_origin), np.array(event.ray_direction)))


def steps(room: PageRoom) -> list[tuple[str, str, str]]:
    """Return the steps of an insertion, object by object: id, name of the step, what it decided."""
    return [(part, name, value) for part in room.inserted for name, value in room.notes[part]]


def offered(room: PageRoom) -> list[str]:
    """Return the layers that have something to show."""
    empty = {
        layers.SURFACES: room.boxes,
        layers.COLLIDERS: not room.colliders,
        layers.WALLS: not any(hull.structure for hull in room.colliders),
        layers.GRASPS: not room.grasps,
        layers.AXES: not room.joints,
        layers.SUPPORTS: room.boxes,
        layers.REACH: not room.stands,
    }
    return [layer for layer in layers.LAYERS if not empty.get(layer, False)]


def first(room: PageRoom) -> str:
    """Return the layer that a page shows first."""
    return layers.BY_PART if room.boxes else layers.SURFACES
