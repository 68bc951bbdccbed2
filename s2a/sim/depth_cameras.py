"""Depth cameras on the worlds of many parts at once: one on a stand in three windows, one on the wrist."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import newton
import numpy as np
import torch
import warp as wp
from newton.sensors import SensorCamera
from scipy.spatial.transform import Rotation
from torch import nn

from s2a import robot
from s2a.core.bounds import Above, CountFromZero, NotNegative, Positive
from s2a.core.errors import InputError
from s2a.robot.model import add_robot
from s2a.robot.tool_path import matrices
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import in_scene
from s2a.sim.camera import WRIST
from s2a.sim.room import pedestal
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage, empty_world

SIZE = 64
"""[pixel] Width and height of a window."""
VIEWS = ("wide", "narrow", "wrist", "close")
NARROW, WRIST_FOV, CLOSE = 0.3, 1.2, 0.12
"""[rad] Vertical field of view of the window about the estimate, of the wrist's camera, and of the closer window about the
estimate, whose 64 pixels are as fine as those of a camera of 640 pixels over 1.2 rad."""
CANDIDATES, PLACES = 24, 8
"""Places that are tried for a world's camera on a stand, and those that are kept."""
VISIBLE, REGION_POINTS, HIDDEN = 0.3, 48, 0.02
"""Fraction of the grasp region's points that a place has to see; points asked for; [m] so much before a point hides it."""
MIN_PIXELS = 4
"""Pixels of the part in the wide window that a place has to see."""


SEEN = newton.ModelBuilder.ShapeConfig(density=0.0, has_shape_collision=False, has_particle_collision=False)
"""Of a surface that is only seen."""


@dataclass(frozen=True, kw_only=True)
class DepthCameraConfig:
    """A depth camera on a stand, of a kind like Intel's D435, another one on the wrist, and the one pixel that selects the part.

    Attributes:
        fov: vertical field of view of the stand's camera [rad].
        distance: least and greatest distance of the stand from the part [m].
        azimuth: greatest angle of the stand to either side of the line from part to robot, about z [rad].
        elevation: least and greatest angle of the stand above the part's horizon [rad].
        aim_error: distance from the part's middle at which the stand's camera is aimed at most, in each direction [m].
        noise: standard deviation of the depth of a pixel at a distance of 1 m [m]; it grows with the distance squared.
        calibration_shift: error of a camera's place in the robot's base frame: standard deviation in each direction [m].
        calibration_turn: error of its orientation: standard deviation about each axis [rad].
        delay: number of frames, of 0.1 s each, after which an estimate is used.
        pixel: column and row of the pixel that selects the part, in the first of the stand's windows, seen from its best place,
            the same in all worlds; null: a pixel of the part, drawn, seen from a place that is drawn, too.
    """

    fov: Annotated[float, Above(0.0, 3.0)] = 0.9
    distance: tuple[Positive, Positive] = (0.9, 1.5)
    azimuth: NotNegative = 0.9
    elevation: tuple[float, float] = (0.15, 0.7)
    aim_error: NotNegative = 0.1
    noise: NotNegative
    calibration_shift: NotNegative
    calibration_turn: NotNegative
    delay: CountFromZero
    pixel: tuple[CountFromZero, CountFromZero] | None


@dataclass(frozen=True)
class DepthView:
    """What a camera sees of each world.

    Attributes:
        points: in the robot's base frame [m], shape [world height width 3].
        valid: where something was measured, shape [world height width].
        is_part: pixels of the part, of which one is pointed at; and the mask in training, likewise.
    """

    points: torch.Tensor
    valid: torch.Tensor
    is_part: torch.Tensor


class WorldCameras:
    """Cameras that see the worlds of a simulation with the surfaces that were scanned.

    Attributes:
        config: their settings.
        visible: fraction of the grasp region that the best place of each world sees, shape [world].
        places: poses of the stand's camera that see enough, world frame, shape [world PLACES 4 4].
        random: source of all that is drawn but the places.
    """

    def __init__(self, sim: Simulation, config: DepthCameraConfig, seed: int, size: int = SIZE) -> None:
        """Load the visuals of all rooms, and find places for the camera on a stand, the robots as they now are.

        Raises:
            InputError: a room has no visuals, or the pixel is none of the window's, or is given for several parts.
        """
        if config.pixel and max(config.pixel) >= size:
            raise InputError(
                f"key 'depth_camera.pixel' is {list(config.pixel)}; give column and row from 0 to {size - 1}"
            )
        if config.pixel and len(sim.stages) > 1:
            raise InputError(
                f"key 'depth_camera.pixel' selects one part, and there are {len(sim.stages)}; leave it out"
            )
        self._sim, self.config, self._size = sim, config, size
        self._n, self._device = sim.num_envs, sim.device
        with wp.ScopedDevice(sim.device):
            builder, self._target_shapes = _visible_worlds(sim)
            self._model = builder.finalize()
            self._state = self._model.state()
            self._camera = SensorCamera(self._model, load_textures=False)
            self._camera.default_render_config.enable_backface_culling = False
            # Neighbouring threads follow neighbouring rays; the default gives them the same pixel of other worlds.
            self._camera.default_render_config.render_order = SensorCamera.RenderOrder.TILED
            fovs = {"wide": config.fov, "narrow": NARROW, "wrist": WRIST_FOV, "close": CLOSE}
            pinhole = SensorCamera.compute_camera_rays_pinhole
            self._rays = {name: pinhole(size, size, camera_fov=fov) for name, fov in fovs.items()}
            self._depth = self._camera.allocate_image_depth_forward(self._n, size, size)
            self._shape = self._camera.allocate_image_shape_index(self._n, size, size)
            self._pose = wp.zeros(self._n, dtype=wp.transformf)
        step = 2.0 * (torch.arange(size, device=self._device) + 0.5) / size - 1.0
        plane = torch.stack(torch.meshgrid(step, -step, indexing="xy"), dim=-1)
        self._plane = {name: plane * float(np.tan(0.5 * fov)) for name, fov in fovs.items()}
        base = matrices(np.stack([sim.stages[i].base for i in sim.stage_of_env]))
        base = torch.tensor(base, dtype=torch.float32, device=self._device)
        self.base_turn, self.base_place = base[:, :3, :3], base[:, :3, 3]
        self._hand = sim.body(sim.robot.gripper.body)
        wrist = np.eye(4)
        wrist[:3, :3], wrist[:3, 3] = Rotation.from_euler("xyz", WRIST[3:]).as_matrix(), WRIST[:3]
        self._wrist = torch.tensor(wrist, dtype=torch.float32, device=self._device)
        self.random = torch.Generator(self._device).manual_seed(seed)
        self._place = torch.zeros(self._n, dtype=torch.long, device=self._device)
        self._error = {name: (self._normal(0.0), self._normal(0.0)) for name in ("stand", "wrist")}
        self.visible, self.places = self._find_places(np.random.default_rng(seed))

    def _normal(self, deviation: float) -> torch.Tensor:
        return deviation * torch.randn(self._n, 3, generator=self.random, device=self._device)

    def begin(self, worlds: torch.Tensor) -> None:
        """Draw place and calibration of the cameras of some worlds (shape [world], bool), whose episodes begin."""
        drawn = torch.randint(PLACES, (self._n,), generator=self.random, device=self._device)
        if self.config.pixel:
            drawn = torch.zeros_like(drawn)  # a user points in one image
        self._place = torch.where(worlds, drawn, self._place)
        for name, (turn, shift) in self._error.items():
            new_turn = self._normal(self.config.calibration_turn)
            new_shift = self._normal(self.config.calibration_shift)
            self._error[name] = (
                torch.where(worlds[:, None], new_turn, turn),
                torch.where(worlds[:, None], new_shift, shift),
            )

    def see(self, name: str, about: torch.Tensor) -> DepthView:
        """Return what a camera sees since the last `refit`.

        `about`: where the narrow window looks, base frame [m], shape [world 3].
        """
        if name == "wrist":
            pose = _matrix(self._sim.body_q[:, self._hand]) @ self._wrist
            error = self._error["wrist"]
        else:
            pose = self.places[torch.arange(self._n, device=self._device), self._place]
            error = self._error["stand"]
        if name in ("narrow", "close"):
            # A window is cut out by where the camera is believed to be.
            (turn, shift), place = error, pose[:, :3, 3]
            away = (self.base_turn @ about[..., None])[..., 0] + self.base_place - place - shift
            pose = _look_at(place, place + away - torch.cross(turn, away, dim=1))
        return self._view(name, pose, error)

    def refit(self) -> None:
        """Take over where the simulation's bodies are."""
        with wp.ScopedDevice(self._device):
            wp.copy(self._state.body_q, self._sim.state.body_q)
            self._model.bvh_refit_shapes(self._state)

    def _render(self, name: str, pose: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Render from poses [world 4 4]; return forward depth [m], 0 for none, and pixels of the part [world height width]."""
        place = wp.from_torch(pose[:, :3, 3].contiguous(), dtype=wp.vec3)
        turn = wp.from_torch(pose[:, :3, :3].contiguous(), dtype=wp.mat33)
        with wp.ScopedDevice(self._device):
            wp.launch(_set_poses, dim=self._n, inputs=[place, turn, self._pose])
            self._camera.update(
                self._state,
                self._pose,
                self._rays[name],
                forward_depth_image=self._depth,
                shape_index_image=self._shape,
            )
        shape = wp.to_torch(self._shape).to(torch.int64)
        first, last = self._target_shapes
        is_part = (shape >= first[:, None, None]) & (shape < last[:, None, None])
        return wp.to_torch(self._depth), is_part

    def _view(self, name: str, pose: torch.Tensor, error: tuple[torch.Tensor, torch.Tensor]) -> DepthView:
        depth, is_part = self._render(name, pose)
        valid = (depth > 0.05) & (depth < 4.0)
        noise = torch.randn(depth.shape, generator=self.random, device=self._device)
        measured = depth + self.config.noise * depth**2 * noise
        turn, shift = error
        axes = pose[:, :3, :3] + torch.cross(turn[:, :, None].expand(-1, -1, 3), pose[:, :3, :3], dim=1)
        to_base = self.base_turn.transpose(1, 2)
        axes = to_base @ axes
        place = (to_base @ (pose[:, :3, 3] + shift - self.base_place)[..., None])[..., 0]
        x, y = self._plane[name].unbind(-1)
        local = torch.stack([x * measured, y * measured, -measured], dim=-1).flatten(1, 2)
        points = (local @ axes.transpose(1, 2) + place[:, None]).unflatten(1, (self._size, self._size))
        return DepthView(points, valid, is_part & valid)

    def _find_places(self, random: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the fraction of the grasp region that the best place of each world sees, and the best places of each."""
        c, stages = self.config, [self._sim.stages[i] for i in self._sim.stage_of_env]
        middle = np.stack([_middle(stage) for stage in stages])
        base = np.stack([stage.base[:3] for stage in stages])
        heading = np.arctan2(*(base - middle).T[[1, 0]])
        n = 1 if c.pixel else self._n  # a user points in one image, so that all worlds have that view
        regions = [stage.region.vertices[np.unique(stage.region.faces)] for stage in stages[:n]]
        region = np.stack([points[random.integers(len(points), size=REGION_POINTS)] for points in regions])
        region = self._tensor(region).expand(self._n, -1, -1)
        grasp = self._tensor(np.stack([stage.grasp[:3] for stage in stages]))
        scores, poses = [], []
        self.refit()
        for _ in range(CANDIDATES):
            around = heading + random.uniform(-c.azimuth, c.azimuth, n)
            up = np.broadcast_to(random.uniform(*c.elevation, n), around.shape)
            away = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=1)
            eye = self._tensor(middle + random.uniform(*c.distance, (n, 1)) * away)
            aim = self._tensor(middle + random.uniform(-c.aim_error, c.aim_error, (n, 3)))
            pose = _look_at(eye, aim)
            pixels = self._render("wide", pose)[1].sum(dim=(1, 2))
            close = _look_at(eye, grasp)
            depth, _ = self._render("narrow", close)
            seen = self._seen(depth, close, region)
            scores.append(torch.where(pixels >= MIN_PIXELS, seen.clamp(max=VISIBLE) + 0.01 * seen, -1.0))
            poses.append(pose)
        score = torch.stack(scores, dim=1)[:n].expand(self._n, -1)
        score, order = score.sort(dim=1, descending=True)
        good = (score[:, :PLACES] >= VISIBLE).sum(dim=1).clamp(min=1)
        pick = torch.arange(PLACES, device=self._device)[None] % good[:, None]  # the best again where few are good
        order = order.gather(1, pick)
        return score[:, 0], torch.stack(poses, dim=1)[torch.arange(self._n, device=self._device)[:, None], order]

    def _seen(self, depth: torch.Tensor, pose: torch.Tensor, points: torch.Tensor) -> torch.Tensor:
        """Return the fraction of points [world point 3] that a depth image in the narrow window shows, shape [world]."""
        local = (points - pose[:, None, :3, 3]) @ pose[:, :3, :3]
        away = -local[..., 2]
        plane = local[..., :2] / away[..., None] / float(np.tan(0.5 * NARROW))
        column = ((plane[..., 0] + 1.0) * 0.5 * self._size).long()
        row = ((1.0 - plane[..., 1]) * 0.5 * self._size).long()
        inside = (column >= 0) & (column < self._size) & (row >= 0) & (row < self._size) & (away > 0.0)
        index = row.clamp(0, self._size - 1) * self._size + column.clamp(0, self._size - 1)
        measured = depth.flatten(1).gather(1, index)
        return (inside & (measured > away - HIDDEN) & (measured < away + 0.1)).float().mean(dim=1)

    def _tensor(self, values: np.ndarray) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float32, device=self._device)


def _middle(stage: SimStage) -> np.ndarray:
    """Return the middle of a part's hulls at its scanned pose [m], shape [3], scene frame."""
    body = stage.room.bodies[stage.target]
    points = np.concatenate([in_scene(body, collider.mesh) for collider in body.colliders])
    return 0.5 * (points.min(axis=0) + points.max(axis=0))


def _visible_worlds(sim: Simulation) -> tuple[newton.ModelBuilder, tuple[torch.Tensor, torch.Tensor]]:
    """Return a model of what can be seen of the simulation's bodies, and each world's first and last shape of its part."""
    each = sim.model.body_count // sim.num_envs
    labels = [label.split("/")[-1] for label in sim.model.body_label]
    arm = _arm_meshes(sim)
    moving: dict[Path, set[str]] = defaultdict(set)
    for stage in sim.stages:
        moving[stage.path] |= set(stage.active)
    rooms = {path: _room_meshes(path, parts) for path, parts in moving.items()}
    worlds, shown = [], []
    for index, stage in enumerate(sim.stages[: sim.num_envs]):
        names = labels[index * each : (index + 1) * each]
        world = newton.ModelBuilder()
        for name in names:
            body = world.add_body(label=name)
            if name in arm:
                world.add_shape_mesh(body, mesh=arm[name], cfg=SEEN, label=name)
        shown.append(_add_surfaces(world, stage, names, rooms[stage.path]))
        worlds.append(world)
    builder = newton.ModelBuilder()
    bounds = []
    for i in range(sim.num_envs):
        bounds.append([builder.shape_count + index for index in shown[i % len(worlds)]])
        builder.add_world(worlds[i % len(worlds)])
    if builder.body_count != sim.model.body_count:
        raise ValueError(f"{builder.body_count} visible bodies, and {sim.model.body_count} are simulated")
    first, last = torch.tensor(bounds, device=sim.device).unbind(dim=1)
    return builder, (first, last)


def _arm_meshes(sim: Simulation) -> dict[str, newton.Mesh]:
    """Return the visible surface of each link of the robot, in its frame, by name."""
    arm = empty_world()
    add_robot(arm, sim.robot, wp.transform_identity(), visuals=True)
    links: dict[str, list[Mesh]] = defaultdict(list)
    for i in range(arm.shape_count):
        if arm.shape_flags[i] & newton.ShapeFlags.COLLIDE_SHAPES or not isinstance(arm.shape_source[i], newton.Mesh):
            continue
        source, place = arm.shape_source[i], matrices(np.array([arm.shape_transform[i]], dtype=float))[0]
        points = source.vertices * np.array(arm.shape_scale[i]) @ place[:3, :3].T + place[:3, 3]
        links[arm.body_label[arm.shape_body[i]].split("/")[-1]].append(Mesh(points, source.indices.reshape(-1, 3)))
    return {name: _surface(merge(meshes)) for name, meshes in links.items()}


def _room_meshes(path: Path, moving: set[str]) -> dict[str, newton.Mesh]:
    """Return the surfaces of a room: of each of some bodies in its frame, and all the rest as one.

    Raises:
        InputError: the room has no visuals.
    """
    room = sim_stage.read(path)
    static, meshes = [Mesh(room.static_visual.vertices, room.static_visual.faces)], {}
    for body in (*room.bodies.values(), *room.free.values()):
        if body.id not in moving:
            static.append(Mesh(in_scene(body, body.visual), body.visual.faces))
        elif len(body.visual.faces):
            meshes[body.id] = _surface(body.visual)
    if missing := sorted(moving - set(meshes)):
        text = "no camera can see {} in {}: it has no visuals; make the room with them (s2a pool visuals=true)"
        raise InputError(text.format(", ".join(missing[:3]), path))
    return {**meshes, "": _surface(merge([mesh for mesh in static if len(mesh.faces)]))}


def _surface(mesh: Mesh) -> newton.Mesh:
    """Return a surface that is only seen."""
    return newton.Mesh(mesh.vertices.astype(np.float32), mesh.faces.ravel(), compute_inertia=False, is_solid=False)


def _add_surfaces(
    world: newton.ModelBuilder, stage: SimStage, names: list[str], meshes: dict[str, newton.Mesh]
) -> tuple[int, int]:
    """Add a room's surfaces to a world, those that move to their bodies; return the part's first and one past its last shape."""
    shown = (0, 0)
    for name, mesh in meshes.items():
        body, place = -1, wp.transform_identity()
        if name in stage.active:
            body = names.index(name)
        elif name:
            scanned = stage.room.bodies.get(name) or stage.room.free[name]
            place = wp.transform(*map(float, scanned.position), *map(float, scanned.orientation))
        if name == stage.target:
            shown = (world.shape_count, world.shape_count + 1)
        world.add_shape_mesh(body, xform=place, mesh=mesh, cfg=SEEN, label=name or "room")
    if (column := pedestal(stage.base, *stage.pedestal)) is not None:
        world.add_shape_mesh(-1, mesh=_surface(column), cfg=SEEN, label="pedestal")
    return shown


def _look_at(eye: torch.Tensor, aim: torch.Tensor) -> torch.Tensor:
    """Return poses [world 4 4] of cameras that look along -z, y up, from places [world 3] at others."""
    back = nn.functional.normalize(eye - aim, dim=1)
    right = nn.functional.normalize(torch.cross(back.new_tensor([0.0, 0.0, 1.0]).expand_as(back), back, dim=1), dim=1)
    pose = torch.eye(4, device=eye.device).repeat(len(eye), 1, 1)
    pose[:, :3, :3] = torch.stack([right, torch.cross(back, right, dim=1), back], dim=2)
    pose[:, :3, 3] = eye
    return pose


def _matrix(pose: torch.Tensor) -> torch.Tensor:
    """Return poses [world 7] (position, quaternion xyzw) as matrices [world 4 4]."""
    out = torch.eye(4, device=pose.device).repeat(len(pose), 1, 1)
    cross = torch.linalg.cross(out[:, :3, :3], pose[:, None, 3:6])
    out[:, :3, :3] += 2.0 * (pose[:, 6, None, None] * cross + cross @ cross)
    out[:, :3, 3] = pose[:, :3]
    return out


@wp.kernel
def _set_poses(places: wp.array(dtype=wp.vec3), turns: wp.array(dtype=wp.mat33), poses: wp.array(dtype=wp.transformf)):
    """Write places and rotations as poses."""
    i = wp.tid()
    poses[i] = wp.transform(places[i], wp.quat_from_matrix(turns[i]))


def tool_poses(sim: Simulation, cameras: WorldCameras) -> torch.Tensor:
    """Return the tool frame in the robot's base frame, shape [world 4 4]."""
    spec = robot.load(sim.stage.robot)
    pose = _matrix(sim.body_q[:, sim.layout.tool_body])
    place = pose[:, :3, 3] + (pose[:, :3, :3] @ pose.new_tensor(spec.tool_offset)[:, None])[..., 0]
    to_base = cameras.base_turn.transpose(1, 2)
    out = torch.eye(4, device=pose.device).repeat(len(pose), 1, 1)
    out[:, :3, :3] = to_base @ pose[:, :3, :3]
    out[:, :3, 3] = (to_base @ (place - cameras.base_place)[..., None])[..., 0]
    return out
