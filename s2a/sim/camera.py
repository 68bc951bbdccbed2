"""Camera images with the scan's colours as a texture: of one world, and of all worlds at once from before and from the wrist."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import newton
import numpy as np
import torch
import warp as wp
from newton.sensors import SensorCamera
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.core.bounds import Above, Count, NotNegative, Positive
from s2a.robot.model import add_robot
from s2a.scene.geometry.mesh_ops import bake, merge
from s2a.scene.geometry.mesh_query import RayMesh, first_hits, ray_mesh
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom, in_scene
from s2a.scene.usd.stage import ROOT
from s2a.sim.room import add_room, pedestal
from s2a.sim.world import SimStage

# Fractions of the requested azimuth that are tried, in this order at each distance
AZIMUTHS = (1.0, -1.0, 0.7, -0.7, 1.3, -1.3, 0.4, -0.4)
NEARER = (1.0, 0.85, 0.7, 0.55)  # Fractions of the requested distance
HIGHER = (1.0, 0.5, 1.6)  # Fractions of the requested elevation
BEFORE = 0.05  # [m] So much before what is looked at, a surface no longer hides it: it may be its own


def viewpoint(stage: SimStage, distance: float, azimuth: float, elevation: float) -> tuple[np.ndarray, np.ndarray]:
    """Return where a camera stands and the point in the middle of its image [m], shape [3] each, scene frame.

    The first place that sees all of grasp, gripper before it and shoulder; else the one that sees most of them.

    Args:
        stage: what is looked at.
        distance: distance from the middle between robot and handle [m].
        azimuth: to the side of the line from handle to robot, turned about z [rad].
        elevation: angle above the horizon [rad].
    """
    base, grasp = stage.base[:3], stage.grasp[:3]
    middle = 0.5 * (base + grasp) + [0.0, 0.0, 0.2]
    back = base - grasp
    shoulder = base + [0.0, 0.0, robot.load(stage.robot).base.shoulder_height]
    seen = np.stack([grasp, grasp + 0.15 * back / np.linalg.norm(back), shoulder])
    places = places_around(middle, float(np.arctan2(back[1], back[0])), distance, azimuth, elevation)
    room = sim_stage.read(stage.path)
    still = (body for body in (*room.bodies.values(), *room.free.values()) if body.id != stage.target)
    meshes = [Mesh(in_scene(body, body.visual), body.visual.faces) for body in still]
    return first_free(
        places, seen, merge([*meshes, Mesh(room.static_visual.vertices, room.static_visual.faces)])
    ), middle


def first_free(places: Iterable[np.ndarray], seen: np.ndarray, room: Mesh) -> np.ndarray:
    """Return the first place [3] from which all points [point 3] are seen past a surface, else the best."""
    best, most, surface = np.zeros(3), -1, ray_mesh(room.vertices, room.faces)
    for place in places:
        free = int((~blocked(place, seen, surface)).sum())
        if free > most:
            best, most = place, free
        if most == len(seen):
            break
    return best


def blocked(start: np.ndarray, points: np.ndarray, surface: RayMesh) -> np.ndarray:
    """Return which points a surface, seen from either side, hides from another one, shape [point].

    Args:
        start: from where they are looked at [m], shape [3].
        points: [m], shape [point 3].
        surface: of `s2a.scene.geometry.mesh_query.ray_mesh`.
    """
    far = np.linalg.norm(points - start, axis=1)
    directions = (points - start) / np.maximum(far, 1e-9)[:, None]
    return first_hits(surface, np.broadcast_to(start, points.shape), directions) < far - BEFORE


def places_around(
    middle: np.ndarray, heading: float, distance: float, azimuth: float, elevation: float
) -> Iterator[np.ndarray]:
    """Yield places around a point [m], shape [3] each, the requested one first; they come nearer and go to other sides.

    Args:
        middle: the point [m], shape [3].
        heading: angle about z of the direction from the point to a camera without azimuth [rad].
        distance: of the first ones [m].
        azimuth: to the side of the heading [rad].
        elevation: angle above the horizon [rad].
    """
    for near, high, around in itertools.product(NEARER, HIGHER, AZIMUTHS):
        turn, up = heading + around * azimuth, min(high * elevation, 1.4)
        level = np.array([np.cos(turn), np.sin(turn), 0.0]) * np.cos(up)
        yield middle + near * distance * (level + [0.0, 0.0, np.sin(up)])


@dataclass(frozen=True)
class CameraConfig:
    """An image of the robot and what it opens, from the first place near the one asked for that sees both.

    Attributes:
        width: [pixel].
        height: [pixel].
        fov: vertical field of view [rad].
        distance: distance from the middle between robot and handle [m].
        azimuth: angle of the camera to the side of the line from robot to furniture, turned about z [rad].
        elevation: angle above the horizon [rad].
    """

    width: Count
    height: Count
    fov: Annotated[float, Above(0.0, 3.0)]
    distance: Positive
    azimuth: float
    elevation: float


class Camera:
    """A camera on one world of a stage; it has a model of its own, with everything that can be seen."""

    def __init__(self, stage: SimStage, config: CameraConfig, still: Sequence[Mesh] = ()) -> None:
        """Load the visuals, and surfaces that stand still; takes seconds, so make one camera and take many images."""
        with wp.ScopedDevice("cpu"):
            builder = visible_model(stage)
            for mesh in still:
                _add_visual(builder, -1, mesh, "still")
            self._model = builder.finalize()
            self._state = self._model.state()
            self._camera = _sensor(self._model)
            self._camera.set_ambient_light((0.5, 0.5, 0.5))
            self._rays = SensorCamera.compute_camera_rays_pinhole(config.width, config.height, camera_fov=config.fov)
            self._image = self._camera.allocate_image_color(1, config.width, config.height)
            self._pose = wp.array([camera_pose(stage, config)], dtype=wp.transformf)

    @property
    def coordinates(self) -> int:
        """Number of joint coordinates that an image needs."""
        return int(self._model.joint_coord_count)

    def image(self, joint_q: torch.Tensor) -> np.ndarray:
        """Return RGB [height width 3], uint8, for the joint coordinates of a world, shape [coord]."""
        with wp.ScopedDevice("cpu"):
            self._model.joint_q.assign(joint_q.cpu().numpy())
            newton.eval_fk(self._model, self._model.joint_q, self._model.joint_qd, self._state)
            # Without this the camera sees every body where the builder put it.
            self._model.bvh_refit_shapes(self._state)
            self._camera.update(self._state, self._pose, self._rays, color_image=self._image)
            rgba = self._image.numpy()[0].copy().view(np.uint8).reshape(*self._image.shape[1:], 4)
        return rgba[..., :3]


def _sensor(model: newton.Model) -> SensorCamera:
    """Return a camera on a model: scans are open shells with light from everywhere, so no shadows, both sides visible."""
    camera = SensorCamera(model)
    camera.create_default_light(enable_shadows=False)
    camera.default_render_config.enable_textures = True
    camera.default_render_config.enable_backface_culling = False
    # Neighbouring threads trace neighbouring rays; the default gives them the same pixel of different worlds.
    camera.default_render_config.render_order = SensorCamera.RenderOrder.TILED
    return camera


SEEN = "seen/"  # What the labels of the room's visible shapes begin with, before the id of their part


def visible_model(stage: SimStage, by_part: bool = False) -> newton.ModelBuilder:
    """Return a world with everything that can be seen; its coordinates are those of the simulation's worlds.

    `by_part`: what does not move is a shape for each part, by which images can tell them apart, instead of one.
    """
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    add_robot(builder, robot.load(stage.robot), wp.transform(*stage.base[:3], *stage.base[3:]), visuals=True)
    file = sim_stage.open_physics(stage.path)
    add_room(builder, stage.room, file, stage.active, static=False, hide_collision_shapes=True, load_sites=False)
    _add_visuals(builder, stage, by_part)
    return builder


def _add_visuals(builder: newton.ModelBuilder, stage: SimStage, by_part: bool) -> None:
    """Add the visible surfaces of the room to the bodies that they move with; nothing of them collides."""
    room = sim_stage.read(stage.path)
    moving = {label.split("/")[-1]: i for i, label in enumerate(builder.body_label) if label.startswith(f"{ROOT}/")}
    for body in (*room.bodies.values(), *room.free.values()):
        carriers = (body.id, *(room.carriers(body.id) if body.id in room.articulations else ()))
        index = next((moving[i] for i in carriers if i in moving), -1)
        points = body.visual.vertices if body.id in moving else in_scene(body, body.visual)
        _add_visual(builder, index, Mesh(points, body.visual.faces, body.visual.colors), body.id)
    for part, mesh in _still(room) if by_part else [("room", room.static_visual)]:
        _add_visual(builder, -1, mesh, part)
    if (column := pedestal(stage.base, *stage.pedestal)) is not None:
        _add_visual(builder, -1, column, "pedestal")


def _still(room: SimRoom) -> Iterator[tuple[str, Mesh]]:
    """Yield the parts that do not move and their surfaces, with the vertices that they need."""
    mesh, owners = room.static_visual, room.static_face_part
    if owners is None or not len(room.static_parts):
        yield "room", mesh
        return
    for k, part in enumerate(room.static_parts):
        used, faces = np.unique(mesh.faces[owners == k], return_inverse=True)
        colors = None if mesh.colors is None else mesh.colors[used]
        yield part, Mesh(mesh.vertices[used], faces.reshape(-1, 3), colors)


def _add_visual(builder: newton.ModelBuilder, body: int, mesh: Mesh, part: str) -> None:
    """Add a surface of a part to a body, its colours as a texture; -1 is the world."""
    if not len(mesh.faces):
        return
    seen = newton.ModelBuilder.ShapeConfig(density=0.0, has_shape_collision=False, has_particle_collision=False)
    uv, texture = bake(mesh.faces, mesh.colors)
    points = mesh.vertices[mesh.faces].reshape(-1, 3)
    surface = newton.Mesh(
        points, np.arange(len(points)), uvs=uv, texture=texture, compute_inertia=False, is_solid=False
    )
    # Without a colour, one of a palette tints the texture.
    builder.add_shape_mesh(body, mesh=surface, cfg=seen, color=(1.0, 1.0, 1.0), label=f"{SEEN}{part}")


def camera_pose(stage: SimStage, config: CameraConfig) -> wp.transformf:
    """Return the pose of a camera that looks along -z, y up, at the space between the robot and the handle."""
    place, middle = viewpoint(stage, config.distance, config.azimuth, config.elevation)
    back = (place - middle) / np.linalg.norm(place - middle)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    rotation = Rotation.from_matrix(np.stack([right, np.cross(back, right), back], axis=1))
    return wp.transformf(wp.vec3(*place), wp.quat(*rotation.as_quat()))


CAMERAS = ("scene", "wrist")
# Camera in the frame of the gripper's body: place [m]; Euler angles x, y, z [rad]; it looks along the fingers
WRIST = (0.06, 0.0, 0.02, 0.0, np.pi, -np.pi / 2)
FARTHEST = 65.0  # [m] Beyond it depth is 0: it is kept in millimetres, in 16 bits


@dataclass(frozen=True)
class ViewsConfig:
    """Two cameras.

    Attributes:
        width: [pixel].
        height: [pixel].
        wrist_fov: vertical field of view of the wrist's camera [rad].
        scene: the camera before the furniture; its width and height are not used.
        jitter: maximum shift of the scene's camera in each direction [m]; drawn for each episode.
        light: minimum and maximum brightness of the ambient light, drawn for each batch of episodes.
    """

    width: Count
    height: Count
    wrist_fov: Annotated[float, Above(0.0, 3.0)]
    scene: CameraConfig
    jitter: NotNegative
    light: tuple[float, float]


class Views:
    """Cameras on all worlds of a stage; they have a model of their own, with everything that can be seen.

    Attributes:
        instances: what the numbers of an image of instances mean: nothing, the robot, and ids of parts.
    """

    def __init__(self, stage: SimStage, config: ViewsConfig, num_envs: int, device: str) -> None:
        self._config, self._stage, self._count = config, stage, num_envs
        world = visible_model(stage, by_part=True)
        builder = newton.ModelBuilder()
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        builder.replicate(world, num_envs)
        self._device, fov = device, {"scene": config.scene.fov, "wrist": config.wrist_fov}
        bodies = [label.split("/")[-1] for label in world.body_label]
        self._hand, self._bodies = bodies.index(robot.load(stage.robot).gripper.body), len(bodies)
        with wp.ScopedDevice(device):
            self._model = builder.finalize()
            self._state = self._model.state()
            self._joint_q = wp.to_torch(self._model.joint_q).view(num_envs, -1)
            self._camera = _sensor(self._model)
            rays = SensorCamera.compute_camera_rays_pinhole
            self._rays = {name: rays(config.width, config.height, camera_fov=fov[name]) for name in CAMERAS}
            size = (num_envs, config.width, config.height)
            self._image = self._camera.allocate_image_color(*size)
            self._depth = self._camera.allocate_image_depth_forward(*size)
            self._shape = self._camera.allocate_image_shape_index(*size)
            self._scene = np.tile(np.array(camera_pose(stage, config.scene)), (num_envs, 1))
            self._places = {name: wp.array(self._scene, dtype=wp.transformf) for name in CAMERAS}
            self._wrist = wp.transformf(WRIST[:3], Rotation.from_euler("xyz", WRIST[3:]).as_quat())
        self.instances, numbers = _instances(world, stage.robot)
        # The shape of a ray that meets nothing is the largest number: the last one of the table.
        self._numbers = torch.tensor([*np.tile(numbers, num_envs), 0], dtype=torch.int16, device=device)

    def begin(self, random: np.random.Generator) -> None:
        """Shift the scene's cameras and draw the light, for the episodes that begin."""
        places = self._scene.copy()
        places[:, :3] += random.uniform(-self._config.jitter, self._config.jitter, (self._count, 3))
        bright = float(random.uniform(*self._config.light))
        with wp.ScopedDevice(self._device):
            self._places["scene"].assign(places)
            self._camera.set_ambient_light((bright, bright, bright))

    def render(self, joint_q: torch.Tensor, instances: bool = True) -> Iterator[str]:
        """Render one camera after the other, of all worlds; `images` then reads the one that was yielded.

        `joint_q`: joint coordinates of all worlds, shape [world coord].
        """
        with wp.ScopedDevice(self._device):
            self._joint_q.copy_(joint_q)
            newton.eval_fk(self._model, self._model.joint_q, self._model.joint_qd, self._state)
            # Without this the camera sees every body where the builder put it.
            self._model.bvh_refit_shapes(self._state)
            inputs = [self._state.body_q, self._bodies, self._hand, self._wrist, self._places["wrist"]]
            wp.launch(_follow, dim=self._count, inputs=inputs)
            for name in CAMERAS:
                self._camera.update(
                    self._state,
                    self._places[name],
                    self._rays[name],
                    color_image=self._image,
                    forward_depth_image=self._depth,
                    shape_index_image=self._shape if instances else None,
                )
                yield name

    def images(self) -> dict[str, torch.Tensor]:
        """Return what the camera that was rendered last sees, on the cameras' device.

        Returns:
            "image": colours, shape [world height width 3], uint8; "depth": along the camera's axis [mm], shape
            [world height width], 16 bits without sign, 0 where nothing is seen or farther than FARTHEST; "instances": index of
            `instances`, likewise.
        """
        color, depth, shape = map(wp.to_torch, (self._image, self._depth, self._shape))
        millimetres = torch.where((depth > 0.0) & (depth < FARTHEST), torch.round(1000.0 * depth), 0.0).to(torch.int32)
        shown = shape.to(torch.int64).clamp(max=len(self._numbers) - 1)
        shown = torch.where(shown < 0, len(self._numbers) - 1, shown)
        return {
            "image": color.view(torch.uint8).unflatten(2, (-1, 4))[..., :3],
            "depth": millimetres.to(torch.int16),
            "instances": self._numbers[shown],
        }


def _instances(world: newton.ModelBuilder, robot_name: str) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the names of what can be seen, and for each shape of a world the index of its name."""
    shown = [label.removeprefix(SEEN) if label.startswith(SEEN) else robot_name for label in world.shape_label]
    names = ("nothing", *dict.fromkeys([robot_name, *shown]))
    return names, np.array([names.index(name) for name in shown])


@wp.kernel
def _follow(
    body_q: wp.array(dtype=wp.transform),
    bodies: int,
    hand: int,
    camera: wp.transform,
    places: wp.array(dtype=wp.transform),
):
    # Of a camera that is fixed to a body of each world.
    world = wp.tid()
    places[world] = body_q[world * bodies + hand] * camera
