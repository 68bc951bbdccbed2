"""What cameras see of all worlds at once: one that stands before the furniture, one at the wrist."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import newton
import numpy as np
import torch
import warp as wp
from newton.sensors import SensorCamera
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.ranges import Above, Count, NotNegative
from s2a.sim.camera import CameraConfig, camera_pose, visible_model
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
    """Cameras on all worlds of a stage; they have a model of their own, with everything that can be seen."""

    def __init__(self, stage: SimStage, config: ViewsConfig, num_envs: int, device: str) -> None:
        """Load the visuals; takes seconds."""
        self._config, self._stage, self._count = config, stage, num_envs
        world = visible_model(stage)
        builder = newton.ModelBuilder()
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        builder.replicate(world, num_envs)
        self._device, fov = device, {"scene": config.scene.fov, "wrist": config.wrist_fov}
        with wp.ScopedDevice(device):
            self._model = builder.finalize()
            self._state = self._model.state()
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
        bodies = [label.split("/")[-1] for label in world.body_label]
        self._hand = bodies.index(robot.load(stage.robot).gripper.body)
        self._scene = np.tile(np.array(camera_pose(stage, config.scene)), (num_envs, 1))
        self._places = self._scene.copy()

    def begin(self, random: np.random.Generator) -> None:
        """Shift the scene's cameras and draw the light, for the episodes that begin."""
        shift = random.uniform(-self._config.jitter, self._config.jitter, (self._count, 3))
        self._places = self._scene.copy()
        self._places[:, :3] += shift
        bright = float(random.uniform(*self._config.light))
        with wp.ScopedDevice(self._device):
            self._camera.set_ambient_light((bright, bright, bright))

    def images(self, joint_q: torch.Tensor) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return colours [world height width 3], uint8, and depth [world height width], uint16 [mm], by camera.

        Args:
            joint_q: joint coordinates of all worlds, shape [world coord].
        """
        found = {}
        with wp.ScopedDevice(self._device):
            self._model.joint_q.assign(joint_q.flatten().cpu().numpy())
            newton.eval_fk(self._model, self._model.joint_q, self._model.joint_qd, self._state)
            # Without this the camera sees every body where the builder put it.
            self._model.bvh_refit_shapes(self._state)
            poses = {"scene": self._places, "wrist": self._wrists()}
            for name in CAMERAS:
                pose = wp.array(poses[name], dtype=wp.transformf)
                self._camera.update(
                    self._state, pose, self._rays[name], color_image=self._image, forward_depth_image=self._depth
                )
                packed = np.ascontiguousarray(self._image.numpy())
                depth = self._depth.numpy()
                seen = np.isfinite(depth) & (depth > 0.0) & (depth < FARTHEST)
                rgb = packed.view(np.uint8).reshape(*packed.shape, 4)[..., :3]
                found[name] = rgb.copy(), np.where(seen, np.rint(1000.0 * depth), 0).astype(np.uint16)
        return found

    def _wrists(self) -> np.ndarray:
        """Return the poses of the wrists' cameras, shape [world 7]."""
        bodies = self._state.body_q.numpy().reshape(self._count, -1, 7)[:, self._hand]
        turn = Rotation.from_quat(bodies[:, 3:])
        place = bodies[:, :3] + turn.apply(np.array(WRIST[:3]))
        turned = turn * Rotation.from_euler("xyz", WRIST[3:])
        return np.concatenate([place, turned.as_quat()], axis=1)
