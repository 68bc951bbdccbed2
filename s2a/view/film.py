"""Short videos of what worlds did, for a report: the project's own images of the room and the robot, frame by frame."""

import io
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np

from s2a.core.errors import InputError
from s2a.core.workers import in_parallel
from s2a.robot.tool_path import matrices
from s2a.scene.geometry.camera import CameraPose, OrbitCamera
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.render import render
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.sim.camera import first_free, places_around
from s2a.view import states
from s2a.view.page.glb import thinned
from s2a.view.page.room import Coordinates, PageRoom, Played, PlayedWorld, of_sim_room, unit
from s2a.view.states import States

# As of `s2a evaluate images=`; walls that stand between are seen through from behind
CAMERA = OrbitCamera(560, 352, 1, 0.8, 1.1, 0.45, 1.0, True)
DISTANCE = 2.0  # [m] From the middle between the robot and what it moves
RATE, SECONDS = 8, 6.0  # Images a second; what takes longer is shown faster, so that it takes so many seconds at most
HELD = 0.7  # [s] For which the last image stays
MAX_BYTES = 1_500_000
QUALITIES = (26, 32, 38, 44, 51)  # H.264's quantizers, tried in this order until a video is small enough
MAX_FACES = 200_000  # Of the room that is rendered: a pixel shows no smaller ones


@dataclass(frozen=True)
class Film:
    """A video."""

    caption: str  # which world, how it ended, how fast it is shown
    data: bytes  # an mp4 file (H.264)


def films(path: Path, stage: Path) -> list[Film]:
    """Return a video of one world that succeeded and of one that did not, as far as there are both.

    `path`: states of s2a evaluate, or a dataset of s2a collect.

    Raises:
        InputError: a file that does not exist, is another or damaged, or another room.
    """
    for key, file in (("states", path), ("stage", stage)):
        if not file.exists():
            raise InputError(
                f"key {key!r}: {file} does not exist; give states=FILE.npz of s2a evaluate and its stage=ROOM.usd"
            )
    record = states.one_of_each(path, stage)
    content = sim_stage.read(stage)
    room, shown = thinned(of_sim_room(content), MAX_FACES), states.of_states(record, content)
    return [_film(room, shown, world, record, k) for k, world in enumerate(shown.worlds)]


def _film(room: PageRoom, shown: Played, world: PlayedWorld, record: States, k: int) -> Film:
    speed, chosen = timed(world.frames, shown.rate)
    data = encoded(_images(room, shown, world, chosen), RATE)
    ended = {None: "outcome not kept", True: "success", False: "failure"}[record.success[k] if record.success else None]
    opened = [
        f"{part} {q[-1] / unit(room.joints[part])[1]:.0f} {unit(room.joints[part])[0]} at the end"
        for part, q in world.q.items()
    ]
    faster = f"shown {speed:.1f} times as fast" if speed > 1.0 else "in real time"
    return Film(", ".join([f"{world.name}: {ended}", *opened, f"{world.frames / shown.rate:.1f} s", faster]), data)


def timed(frames: int, rate: float) -> tuple[float, list[int]]:
    """Return how many times as fast a video shows some frames, `rate` a second, and which frame each of its images shows."""
    speed = max(1.0, frames / rate / SECONDS)
    count = max(1, round(frames / rate / speed * RATE))
    chosen = (np.arange(count) * rate * speed / RATE).astype(int)
    return speed, [*np.minimum(chosen, frames - 1).tolist(), *[frames - 1] * round(HELD * RATE)]


def _images(room: PageRoom, shown: Played, world: PlayedWorld, frames: list[int]) -> list[np.ndarray]:
    """Return images of some frames, shape [row column 3] each."""
    room = room.with_movers(world.moved)
    groups: dict[str | None, list[Mesh]] = {}
    for part in room.parts.values():
        groups.setdefault(part.mover, []).append(part.surface)
    surfaces, view = {mover: merge(each) for mover, each in groups.items()}, viewpoint(room, world)

    def image(k: int) -> np.ndarray:
        q = {part: float(each[k]) for part, each in world.q.items()}
        at = Coordinates(room, q, {part: poses[k] for part, poses in world.moved.items()})
        meshes = [_posed(mesh, at.pose(mover)) for mover, mesh in surfaces.items()]
        links = [_posed(mesh, pose) for mesh, pose in zip(shown.links, matrices(world.links[k]), strict=True)]
        return render([*meshes, *links], view, CAMERA)

    different = list(dict.fromkeys(frames))
    images = dict(zip(different, in_parallel(image, different), strict=True))
    return [images[k] for k in frames]


def viewpoint(room: PageRoom, world: PlayedWorld) -> CameraPose:
    """Return a camera on the robot's side, from which what the robot moves is seen past the room, at first and at the end."""
    base = world.links[0, 0, :3]
    tips = world.links[:, -1, :3]
    moving = [part for part, q in world.q.items() if np.ptp(q) > 0.0] or [*world.q]
    points = [room.parts[part].surface.vertices for part in moving if len(room.parts[part].surface.vertices)]
    handled = np.concatenate(points).mean(axis=0) if points else tips.mean(axis=0)
    middle = 0.5 * (base + handled) + [0.0, 0.0, 0.2]
    back = base - handled
    still = merge([part.surface for part in room.parts.values() if part.mover not in moving])
    seen = np.stack([tips[0], tips[len(tips) // 2], tips[-1], base + [0.0, 0.0, 0.3]])
    places = places_around(middle, float(np.arctan2(back[1], back[0])), DISTANCE, CAMERA.azimuth, CAMERA.elevation)
    place = first_free(places, seen, still)
    return CameraPose(tuple(place), tuple(middle))


def encoded(images: list[np.ndarray], rate: int) -> bytes:
    """Return images [row column 3], uint8, as an mp4 file of MAX_BYTES at most."""
    data = b""
    for quality in QUALITIES:
        data = _mp4(images, rate, quality)
        if len(data) <= MAX_BYTES:
            break
    return data


def _mp4(images: list[np.ndarray], rate: int, quality: int) -> bytes:
    file = io.BytesIO()
    with av.open(file, "w", format="mp4") as container:
        stream = container.add_stream(
            "libx264", rate=rate, options={"crf": str(quality), "preset": "slow", "g": str(2 * RATE), "threads": "1"}
        )
        stream.height, stream.width = images[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for image in images:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
    return file.getvalue()


def _posed(mesh: Mesh, pose: np.ndarray) -> Mesh:
    if np.array_equal(pose, np.eye(4)):
        return mesh
    return Mesh(mesh.vertices @ pose[:3, :3].T + pose[:3, 3], mesh.faces, mesh.colors)
