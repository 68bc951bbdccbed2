"""The controls of the annotation page, and what clicks in the scene do."""

import html
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from threading import RLock, Thread
from typing import Any

import numpy as np
import viser
import viser.transforms

from s2a.annotate import shown as pick
from s2a.annotate.annotation import Draft, Editor, Item, of_part
from s2a.annotate.handle import SHAPES
from s2a.annotate.shown import Shown
from s2a.core.check import Check, doubtful
from s2a.core.errors import InputError
from s2a.scan.evidence import Bounds
from s2a.scene.geometry.camera import CameraPose
from s2a.scene.scene import Mesh
from s2a.view.page import glb, panel
from s2a.view.page.glb import thinned
from s2a.view.page.room import PagePart, PageRoom, unit
from s2a.view.page.serve import address, started

# What the next click, or drag, means
FRONT, HINGE, LINE, HANDLE, RECTANGLE = "front", "hinge", "line", "handle", "rectangle"
HINTS = {
    FRONT: "Click a front. Shift and drag: a rectangle around it.",
    HINGE: "Click the edge about which it turns.",
    LINE: "Click two points of the hinge line.",
    HANDLE: "Click the handle, or the place where one is.",
    RECTANGLE: "Shift and drag a rectangle around the front.",
}
MARKS = {"pass": "\u2713", "warn": "\u26a0", "fail": "\u2717", "skipped": "?"}
COLORS = {"pass": "seagreen", "warn": "darkorange", "fail": "crimson", "skipped": "gray"}
NONE = "none"
STYLE = f"""<style>
{panel.MARKS}
.s2a-card {{ padding: 0 0.75em 0.3em; font-size: 0.875em; line-height: 1.4; overflow-wrap: anywhere; }}
.s2a-hint {{ font-weight: 600; }}
</style>"""


def hint_text(mode: str, item: Item | None) -> str:
    """Return what to do next, as HTML."""
    text = HINTS[mode]
    if mode == FRONT and item is not None and item.joint is None:
        text = "Does it slide or turn? If the region is wrong: shift and drag a rectangle."
    elif mode == FRONT and item is not None and item.proposed:
        text = "A proposal: accept it, edit it, or remove it."
    return f"<div class='s2a-card s2a-hint'>{html.escape(text)}</div>"


def row(index: int, item: Item) -> str:
    """Return a part's entry in the list of parts."""
    moves = {None: "joint?", "prismatic": "slides", "revolute": "turns"}[item.joint.kind if item.joint else None]
    handle = item.completed and f"{item.completed} added" or ("handle" if len(item.handle) else "no handle")
    return f"{index + 1} {item.name}: {moves}, {handle}" + (" (proposed)" if item.proposed else "")


def part_rows(annotation: Draft) -> tuple[str, ...]:
    """Return the entries of all parts, after the one for no part."""
    return (NONE, *(row(i, item) for i, item in enumerate(annotation.items)))


def facts_text(item: Item | None) -> str:
    """Return size and motion of the selected part, as HTML."""
    if item is None:
        return ""
    width, height = item.region.size
    text = f"{1000 * width:.0f} x {1000 * height:.0f} mm, {len(item.front):,} faces"
    if item.joint is not None:
        name, size = unit(item.joint)
        text += f"; opens by {item.joint.limits[1] / size:.0f} {name}"
    return f"<div class='s2a-card'>{text}</div>"


def check_text(checks: Sequence[Check]) -> str:
    """Return checks as HTML: those that fail or warn in full, of the others the names."""
    lines = [
        _line(check.status, f"{check.name}: {check.message}" + (f"; {check.remedy}" if check.remedy else ""))
        for check in doubtful(checks)
    ]
    for status in ("pass", "skipped"):
        if names := [check.name for check in checks if check.status == status]:
            lines.append(_line(status, ", ".join(names)))
    return f"<div class='s2a-card'>{''.join(lines)}</div>"


def _line(status: str, text: str) -> str:
    return f"<div><span style='color:{COLORS[status]}'>{MARKS[status]}</span> {html.escape(text)}</div>"


SCANNED = "as scanned, or a bar"
SLIDES = {"slides out": "out", "left": "left", "right": "right"}
TURNS = {"turns: edge": HINGE, "turns: line": LINE}
Save = Callable[[Draft], str]


class AnnotationPanel:
    """The controls beside the scan. viser calls from several threads; one edit is made at a time."""

    def __init__(self, server: viser.ViserServer, editor: Editor, save: Save, bounds: Bounds) -> None:
        self._server, self._editor, self._save, self._bounds = server, editor, save, bounds
        self._lock, self._checking = RLock(), RLock()
        self._shown = Shown(server.scene)
        self._mode, self._points = FRONT, list[np.ndarray]()
        self._clicked: tuple[Draft, Mesh] | None = None
        self._edits, self._filling = 0, False
        self._add_controls()
        server.scene.on_click()(self._click)
        server.scene.on_rect_select(modifier="shift")(self._drag)
        self._refresh()

    def _add_controls(self) -> None:
        gui = self._server.gui
        gui.add_html(STYLE)
        self._hint = gui.add_html("")
        self._group(
            "file", {"undo": self._undo, "save": self._write, "accept all": self._edit(self._editor.accept_all)}
        )
        self._parts = gui.add_dropdown("part", (NONE,))
        self._parts.on_update(lambda event: self._choose(event.target.value))
        self._facts = gui.add_html("")
        self._group("part is", {"accept": self._edit(self._editor.accept), "remove": self._edit(self._editor.remove)})
        self._group("view", {"face it": self._face, "redraw": lambda event: self._set(RECTANGLE)})
        self._group("motion", {name: self._sliding(way) for name, way in SLIDES.items()})
        self._group("hinge", {name: self._asking(mode) for name, mode in TURNS.items()})
        self._group("click", {"handle": self._asking(HANDLE), "next front": self._next})
        self._shape = gui.add_dropdown("handle is", (SCANNED, *SHAPES))
        self._label = gui.add_text("label", "")
        self._label.on_update(lambda event: self._fill(lambda: self._editor.label(event.target.value)))
        self._limit = gui.add_number("opens by", 0.0, min=0.0, step=1.0)
        self._limit.on_update(lambda event: self._fill(lambda: self._set_limit(float(event.target.value))))
        self._open = gui.add_slider("open [%]", 0, 100, 1, 0)
        self._open.on_update(lambda event: self._watch(float(event.target.value)))
        self._checks = gui.add_html("")
        self._said = gui.add_html("")

    def _group(self, label: str, actions: dict[str, Callable[[viser.GuiEvent], None]]) -> None:
        buttons = self._server.gui.add_button_group(label, tuple(actions))
        buttons.on_click(lambda event: actions[event.target.value](event))

    def _edit(self, change: Callable[[], object]) -> Callable[[viser.GuiEvent], None]:
        def do(event: viser.GuiEvent) -> None:
            with self._lock:
                change()
                self._mode = FRONT
                self._refresh()

        return do

    def _undo(self, event: viser.GuiEvent) -> None:
        self._edit(self._editor.undo)(event)

    def _sliding(self, way: str) -> Callable[[viser.GuiEvent], None]:
        def do(event: viser.GuiEvent) -> None:
            with self._lock:
                self._editor.slide(way)  # type: ignore[arg-type]
                self._after_joint()

        return do

    def _asking(self, mode: str) -> Callable[[viser.GuiEvent], None]:
        return lambda event: self._set(mode)

    def _set(self, mode: str) -> None:
        with self._lock:
            self._mode, self._points = mode if self._editor.item else FRONT, []
            self._tell()

    def _next(self, event: viser.GuiEvent) -> None:
        self._choose(NONE)

    def _choose(self, row: str) -> None:
        with self._lock:
            listed = part_rows(self._editor.annotation)
            index = listed.index(row) - 1 if row in listed else -1
            if not self._filling and index != (-1 if self._editor.selected is None else self._editor.selected):
                self._editor.select(None if index < 0 else index)
                self._mode = FRONT
                self._refresh()

    def _fill(self, change: Callable[[], None]) -> None:
        """Make an edit that a field asks for, unless the page itself filled the field."""
        with self._lock:
            if not self._filling:
                change()
                self._refresh()

    def _set_limit(self, shown: float) -> None:
        item = self._editor.item
        if item is not None and item.joint is not None and shown > 0:
            self._editor.limit(shown * unit(item.joint)[1])

    def _after_joint(self) -> None:
        item = self._editor.item
        self._mode = HANDLE if item is not None and not len(item.handle) else FRONT
        self._refresh()

    def _click(self, event: viser.SceneClickEvent) -> None:
        with self._lock:
            hit = pick.place(self._mesh(), np.array(event.ray_origin), np.array(event.ray_direction))
            if hit is not None:
                self._at(*hit)

    def _at(self, face: int, point: np.ndarray) -> None:
        """Do what a click at a place of the scan means now."""
        if self._mode in (HINGE, LINE):
            self._points.append(point)
            if len(self._points) == (1 if self._mode == HINGE else 2):
                self._editor.hinge(np.array(self._points))
                self._after_joint()
        elif self._mode == HANDLE:
            shape = self._shape.value
            self._editor.handle(point, None if shape == SCANNED else shape)  # type: ignore[arg-type]
            self._mode = FRONT
            self._refresh()
        else:
            self._editor.click_front(face)
            self._refresh()

    def _drag(self, event: viser.SceneRectSelectEvent) -> None:
        with self._lock:
            camera = event.client.camera
            rotation = viser.transforms.SO3(np.array(camera.wxyz)).as_matrix()
            view = pick.CameraView(np.array(camera.position), rotation, camera.fov, camera.aspect)
            item = self._editor.item
            edits = item is not None and (self._mode == RECTANGLE or item.joint is None)
            if item is None or not edits:
                faces = pick.seen(view, self._mesh(), event.screen_min, event.screen_max)
                if not len(faces):
                    return
                self._editor.rectangle_around(
                    faces, lambda r: pick.corners(view, event.screen_min, event.screen_max, r)
                )
            elif (corners := pick.corners(view, event.screen_min, event.screen_max, item.region)) is not None:
                self._editor.rectangle(corners)
            self._mode = FRONT
            self._refresh()

    def _face(self, event: viser.GuiEvent) -> None:
        with self._lock:
            if self._editor.item is not None and event.client is not None:
                eye, target = pick.facing(self._editor.item.region, event.client.camera.fov)
                with event.client.atomic():
                    event.client.camera.position, event.client.camera.look_at = eye, target

    def _watch(self, percent: float) -> None:
        with self._lock:
            if not self._filling and self._editor.selected is not None:
                self._shown.open(self._editor.annotation, self._editor.selected, percent / 100)

    def _write(self, event: viser.GuiEvent) -> None:
        with self._lock:
            try:
                text = self._save(self._editor.annotation)
            except (InputError, OSError) as error:
                text = f"not saved: {error}"
            self._said.content = (
                f"<div class='s2a-card'><pre style='white-space: pre-wrap'>{html.escape(text)}</pre></div>"
            )

    def _mesh(self) -> Mesh:
        """Return what can be clicked, made once for every annotation."""
        annotation = self._editor.annotation
        if self._clicked is None or self._clicked[0].surface is not annotation.surface:
            self._clicked = (annotation, annotation.surface.mesh())
        return self._clicked[1]

    def _refresh(self) -> None:
        """Show the annotation as it stands, and let the checks of the selected part run."""
        editor = self._editor
        self._filling = True
        self._shown.update(editor.annotation, editor.selected)
        rows = part_rows(editor.annotation)
        self._parts.options = rows
        item = editor.item
        limit = round(item.joint.limits[1] / unit(item.joint)[1], 1) if item and item.joint else 0.0
        _fill(self._parts, rows[0 if editor.selected is None else editor.selected + 1])
        _fill(self._label, item.name if item else "")
        _fill(self._limit, limit)
        _fill(self._open, 0)
        self._facts.content = facts_text(item)
        self._tell()
        self._filling = False
        self._edits += 1
        self._checks.content = ""
        if item is not None and item.joint is not None:
            Thread(target=self._check, args=(self._edits, editor.annotation, editor.selected), daemon=True).start()

    def _tell(self) -> None:
        self._hint.content = hint_text(self._mode, self._editor.item)

    def _check(self, edit: int, annotation: Draft, index: int) -> None:
        with self._checking:
            if edit == self._edits:  # a newer edit has its own
                text = check_text(of_part(annotation, index, self._bounds))
                if edit == self._edits:
                    self._checks.content = text


def _fill(field: viser.GuiInputHandle[Any], value: object) -> None:
    """Set a field of the page."""
    field.value = value  # type: ignore[misc] # mypy overlooks its setter


WIDTH = 400  # [pixel] of the panel
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
        max_faces: number of faces of the scan as it is shown.
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
