"""PPO of rsl_rl with a runner of one's own: `python docs/examples/rsl_rl_ppo.py demo/room.usd drawer_15 rsl_rl.onnx 300`.

`s2a train` does the same with checkpoints, logs and reports; this is where to change the algorithm.
"""

import sys

import torch
from rsl_rl.env import VecEnv
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict

from s2a import api


class Worlds(VecEnv):
    """The environment as rsl_rl sees it: torch tensors on the simulation's device."""

    def __init__(self, env):
        self.env, self.device, self.cfg = env, env.device, {}
        self.num_envs, self.num_actions = env.num_envs, env.unwrapped.worlds.num_actions
        self.max_episode_length = env.unwrapped.worlds.max_episode_length
        self.observation, _ = env.reset(seed=0)

    @property
    def episode_length_buf(self):
        return self.env.unwrapped.worlds.episode_step

    @episode_length_buf.setter
    def episode_length_buf(self, value):
        self.env.unwrapped.worlds.episode_step.copy_(value)

    def get_observations(self):
        return TensorDict({"policy": self.observation}, batch_size=[self.num_envs])

    def step(self, actions):
        self.observation, reward, terminated, truncated, _ = self.env.step(actions)
        return self.get_observations(), reward, (terminated | truncated).long(), {"time_outs": truncated.float()}


class Actor(torch.nn.Module):
    """The trained policy's mean action, with its normalizer."""

    def __init__(self, model):
        super().__init__()
        self.normalizer, self.mlp = model.obs_normalizer, model.mlp

    def forward(self, observation):
        return self.mlp(self.normalizer(observation))


NETWORK = {"class_name": "MLPModel", "hidden_dims": [64, 64], "activation": "elu", "obs_normalization": True}
SETTINGS = {
    "num_steps_per_env": 32,
    "save_interval": 100,
    "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
    "algorithm": {"class_name": "PPO", "learning_rate": 5e-4, "entropy_coef": 0.0},
    "actor": {**NETWORK, "distribution_cfg": {"class_name": "GaussianDistribution", "init_std": 1.0}},
    "critic": NETWORK,
}


def main(room, part, out, iterations, num_envs=64):
    env = api.make("open_part", room, part, num_envs=num_envs)
    runner = OnPolicyRunner(Worlds(env), SETTINGS, None, device=env.device)
    runner.learn(iterations)
    api.export_policy(Actor(runner.alg.get_policy()), out, env)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]))
