"""Command `s2a view`: show a scan or a stage: its tree as text, an image, or a page in the browser."""

import shutil
import threading
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

import s2a.view.report  # noqa: F401  registers what s2a report takes, which is named for a path that is not shown
from s2a.core.bounds import AtLeast, Count
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write, require_png
from s2a.core.progress import report
from s2a.scan.visuals import Visible, fitted, tree, visible
from s2a.scene.geometry.camera import CameraPose, OrbitCamera, framing_pose, front_of
from s2a.scene.geometry.mesh_ops import merge, painted
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.stage import ENCODINGS
from s2a.view.page import cards
from s2a.view.page.glb import thinned
from s2a.view.page.room import PageRoom, hue, read

FILE_FACES = 320_000  # Faces that a file of 10 MB has room for, with and without their scanned colours

# [pixel] What a window of 1280 x 800 leaves beside the panel of a page; the room fits into that, and so into wider ones
PAGE_IMAGE = (900, 800)


@dataclass(frozen=True)
class Config:
    """Keys of `s2a view`.

    Attributes:
        path: a scan's folder, a stage, or a folder of s2a certify or s2a insert; to be played: states of s2a evaluate, or a
            dataset of s2a collect.
        stage: the room of what is played, or null.
        first: index of the first world or episode that is played.
        worlds: maximum number that are played side by side.
        text: Print the tree; null prints it unless an image or a page is requested.
        image: PNG file to write, or null.
        page: Serve a page for the browser, until Ctrl-C: parts, a slider for every joint, colliders, grasp regions, axes.
        port: port of the page's server; the next free one if it is taken.
        html: file to write with the page as a recording in which every joint opens once, or null.
        max_faces: maximum number of faces on the page; beyond, vertices are merged. null: all, and 320,000 in the file.
        part: id of the part at the centre of the image or page, or null for the whole room.
        photo: pixel size [m] of an orthophoto of the part or the rectangle, from the photos of a scan that was imported from a
            recording; null: a rendering.
        rectangle: upright rectangle of the orthophoto: centre x, y, z [m], the angle of its normal about z [rad], width and
            height [m]; null: that around the part.
        colliders: Render the collision hulls instead of the surfaces, each in its own colour, in the image.
        camera: intrinsics and framing of the image; those of the page where it begins.
    """

    path: Path
    stage: Path | None
    first: Annotated[int, AtLeast(0)]
    worlds: Count
    text: bool | None
    image: Output | None
    page: bool
    port: Annotated[int, AtLeast(1, 65535)]
    html: Output | None
    max_faces: Count | None
    part: str | None
    photo: Annotated[float, AtLeast(0.0005, 0.1)] | None
    rectangle: tuple[float, float, float, float, float, float] | None
    colliders: bool
    camera: OrbitCamera


def run(config: Config) -> str:
    """Write the image and the recording and serve the page that are requested; return the tree of the file, or lines about them.

    Raises:
        InputError: no such file, nothing requested, or an image file that is not PNG.
    """
    if not config.path.exists():
        raise InputError(f"{config.path}: does not exist; give a scan's folder, or a {', '.join(ENCODINGS)} file")
    if config.stage:
        return _play(config, config.stage)
    stage, noted = cards.of_path(config.path)
    inserted = cards.inserted(config.path, noted)
    config = replace(config, path=stage)
    if config.image:
        require_png(config.image)
    _refuse_keys(config)
    room = None
    if config.page or config.html:
        room = replace(_page_room(config), notes=noted).with_inserted(inserted)
    outputs = []
    if config.image:
        draw = _orthophoto if config.photo else _image
        outputs.append(draw(visible(config.path), config, config.image))
    if room and config.html:
        outputs.append(_recording(room, config, config.html))
    if config.text or (config.text is None and not config.image and not room):
        outputs.append(fitted(tree(config.path), shutil.get_terminal_size((120, 24)).columns))
    if room and config.page:
        _serve(room, config)
    elif not outputs:
        raise InputError(
            "key 'text' is false and nothing else is requested; give image=FILE.png, page=true or text=true"
        )
    return "\n".join(outputs)


def _play(config: Config, stage: Path) -> str:
    """Serve the page of worlds that move, until somebody interrupts."""
    if not config.page or config.image or config.html:
        raise InputError(f"{config.path} plays only on the page; give page=true, without image or html")
    room = _page_room(replace(config, path=stage))
    from s2a.view import states  # of the extra "sim"
    from s2a.view.page import serve  # viser is of the extra "view"

    recording = states.of_states(
        states.read_played(config.path, stage, config.first, config.worlds), sim_stage.read(stage, visuals=False)
    )
    room = thinned(room, config.max_faces) if config.max_faces else room
    view = _page_view(room, config)
    if config.part is None:  # a part is seen in the first world: others are a room away
        view = serve.whole(view, room, len(recording.worlds))
    with serve.served_worlds(room, recording, view, config.camera.fov, config.port) as address:
        report(
            f"{config.path}: {len(recording.worlds)} worlds, {recording.frames} frames, at {address}; Ctrl-C ends it"
        )
        with suppress(KeyboardInterrupt):
            threading.Event().wait()
    return ""


def _refuse_keys(config: Config) -> None:
    """Raise an InputError for a key that would change nothing, or a file of another kind."""
    if config.rectangle and not config.photo:
        raise InputError("key 'rectangle' applies to an orthophoto, and none is requested; give photo=0.002")
    if config.photo and (not config.image or config.colliders or bool(config.part) == bool(config.rectangle)):
        raise InputError(
            "key 'photo' needs image=FILE.png and either part=ID or rectangle=[x,y,z,yaw,width,height], without colliders"
        )
    if config.colliders and not config.image:
        raise InputError("key 'colliders' applies to an image, and none is requested; give image=FILE.png")
    if config.html and config.html.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"key 'html' is {str(config.html)!r}; expected an HTML file: give html=FILE.html")
    if config.part and not (config.image or config.page or config.html):
        raise InputError(
            "key 'part' applies to an image or a page, and none is requested; give image=FILE.png or page=true"
        )


def _page_room(config: Config) -> PageRoom:
    room = read(config.path)
    if config.part and config.part not in room.parts:
        raise InputError(f"part {config.part!r} is not in {room.name!r}; s2a view path={config.path} lists its parts")
    return room


def _serve(room: PageRoom, config: Config) -> None:
    """Serve the page until somebody interrupts."""
    from s2a.view.page.serve import served  # viser is of the extra "view"

    room = thinned(room, config.max_faces) if config.max_faces else room
    with served(room, _page_view(room, config), config.camera.fov, config.port) as address:
        report(f"{room.name} at {address}; Ctrl-C ends it")
        with suppress(KeyboardInterrupt):
            threading.Event().wait()


def _recording(room: PageRoom, config: Config, path: Path) -> str:
    from s2a.view.page.serve import write  # viser is of the extra "view"

    total, room = room.faces, thinned(room, config.max_faces or FILE_FACES)
    with atomic_write(path) as file:
        write(room, _page_view(room, config), config.camera.fov, file)
        size = file.stat().st_size
    faces = f"{room.faces:,} of {total:,} faces" if room.faces < total else f"{total:,} faces"
    return f"{path}: {room.name}, {faces}, {len(room.joints)} joints open one after the other; {size / 1e6:.1f} MB"


def _page_view(room: PageRoom, config: Config) -> CameraPose:
    """Return where a page begins."""
    width, height = PAGE_IMAGE
    config = replace(config, camera=replace(config.camera, width=width, height=height))
    parts = [room.parts[config.part]] if config.part else list(room.parts.values())
    return _camera_pose([part.surface for part in parts], [room.parts[i].surface for i in room.joints], config)


def _image(scene: Visible, config: Config, path: Path) -> str:
    # Loads Warp, which the tree does not need.
    from s2a.scene.geometry.render import render, write_png

    meshes = list(scene.surfaces.values())
    if config.colliders:
        if not scene.colliders:
            raise InputError(f"{config.path} has no colliders; give a sim.usd, which s2a prepare writes")
        meshes = [painted(mesh, hue(i)) for i, (_, mesh) in enumerate(scene.colliders)]
    jointed = [scene.surfaces[part] for part in scene.jointed if part in scene.surfaces]
    view = _camera_pose(scene.part(config.part) if config.part else meshes, jointed, config)
    with atomic_write(path) as room:
        write_png(render(meshes, view, config.camera), room)
    return f"{path}: {config.camera.width} x {config.camera.height} pixels of {config.part or scene.name}"


def _orthophoto(scene: Visible, config: Config, path: Path) -> str:
    # Loads Warp, which the tree does not need.
    from s2a.scan import orthophoto
    from s2a.scene.geometry.render import write_png

    keyframes = orthophoto.read_keyframes(config.path)
    pixel = config.photo
    assert pixel is not None
    if config.rectangle:
        *center, yaw, width, height = config.rectangle
        if min(width, height) <= 0:
            raise InputError(f"key 'rectangle' is {list(config.rectangle)}; its width and height must be above 0")
        rectangle = orthophoto.upright(center, yaw, (width, height))
    else:
        rectangle = orthophoto.around(merge(scene.part(str(config.part))))
    photo = orthophoto.orthophoto(keyframes, rectangle, merge(list(scene.surfaces.values())), pixel)
    with atomic_write(path) as file:
        write_png(photo.image, file)
    size = f"{photo.image.shape[1]} x {photo.image.shape[0]} pixels of {1000 * pixel:g} mm"
    return f"{path}: {size} from {len(photo.used)} of {len(keyframes)} photos; {100 * photo.seen.mean():.0f} % covered"


def _camera_pose(shown: list[Mesh], jointed: list[Mesh], config: Config) -> CameraPose:
    """Return the view of some surfaces from their front; a room and closed surfaces have that of the parts that move."""
    points = np.concatenate([mesh.vertices for mesh in shown])
    if not len(points):
        raise InputError(f"{config.path}: there is no surface to show{f' of part {config.part!r}' * bool(config.part)}")
    front = front_of(shown) if config.part else None
    front = front_of(jointed) if front is None else front
    return framing_pose(points, np.array([1.0, 0.0, 0.0]) if front is None else front, config.camera)
