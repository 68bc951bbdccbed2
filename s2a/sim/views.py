"""Camera images of all worlds at once: one camera before the furniture, one at the wrist."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import newton
import numpy as np
import torch
import warp as wp
from newton.sensors import SensorCamera
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.core.bounds import Above, Count, NotNegative
from s2a.sim.camera import SEEN, CameraConfig, camera_pose, visible_model
from s2a.sim.world import SimStage

CAMERAS = ("scene", "wrist")
WRIST = (0.06, 0.0, 0.02, 0.0, np.pi, -np.pi / 2)
"""Camera in the frame of the gripper's body: place [m]; Euler angles x, y, z [rad]; it looks along the fingers."""
FARTHEST = 65.0
"""[m] Beyond it depth is 0: it is kept in millimetres, in 16 bits."""


@dataclass(frozen=True)
class ViewsConfig:
    """Two cameras.

    Attributes:
        width: [pixel].
        height: [pixel].
        wrist_fov: vertical field of view of the wrist's camera [rad].
        scene: the camera before the furniture; its width and height are not used.
        jitter: how far the scene's camera is shifted in each direction, at most [m]; drawn for each episode.
        light: least and greatest brightness of the light from everywhere, drawn for each batch of episodes.
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
        """Load the visuals; takes seconds."""
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
            self._camera = SensorCamera(self._model)
            # Scans are open shells with light from everywhere: no shadows, both sides visible.
            self._camera.create_default_light(enable_shadows=False)
            self._camera.default_render_config.enable_textures = True
            self._camera.default_render_config.enable_backface_culling = False
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

        Args:
            joint_q: joint coordinates of all worlds, shape [world coord].
            instances: with what each pixel shows.
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
