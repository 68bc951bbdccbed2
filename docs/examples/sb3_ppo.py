"""PPO of Stable-Baselines3 on a task: `python docs/examples/sb3_ppo.py demo/room.usd drawer_15 sb3.onnx 1000000`."""

import sys

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv

from s2a import api


class Worlds(VecEnv):
    """The environment as Stable-Baselines3 sees it: NumPy arrays, and an info dict a world."""

    def __init__(self, env):
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.env = env

    def reset(self):
        return self.env.reset(seed=0)[0]

    def step_async(self, actions):
        self.actions = actions

    def step_wait(self):
        observation, reward, terminated, truncated, info = self.env.step(self.actions)
        infos = [{} for _ in range(self.num_envs)]
        for world in np.flatnonzero(terminated | truncated):
            infos[world] = {
                "terminal_observation": info["final_obs"][world],
                "TimeLimit.truncated": bool(truncated[world]),
            }
        return observation, reward, terminated | truncated, infos

    def close(self):
        self.env.close()

    def get_attr(self, attr_name, indices=None):
        return [getattr(self.env, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name, value, indices=None):
        setattr(self.env, attr_name, value)

    def env_method(self, method_name, *args, indices=None, **kwargs):
        return [getattr(self.env, method_name)(*args, **kwargs)]

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False] * len(list(self._get_indices(indices)))


class Actor(torch.nn.Module):
    """The trained policy's mean action."""

    def __init__(self, policy):
        super().__init__()
        self.hidden, self.mean = policy.mlp_extractor.policy_net, policy.action_net

    def forward(self, observation):
        return self.mean(self.hidden(observation))


def main(room, part, out, steps, num_envs=64):
    env = api.make("open_part", room, part, num_envs=num_envs, numpy=True)
    agent = PPO("MlpPolicy", Worlds(env), n_steps=32, batch_size=8 * num_envs, seed=0, device="cpu", verbose=1)
    agent.learn(steps)
    api.export_policy(Actor(agent.policy), out, env)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]))
