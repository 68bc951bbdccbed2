"""PPO of skrl on a task: `python docs/examples/skrl_ppo.py demo/room.usd drawer_15 skrl.onnx 20000`; steps are of each world."""

import itertools
import sys

import torch
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
from skrl.trainers.torch import SequentialTrainer

from s2a import api


def layers(inputs, outputs):
    sizes, elu = (inputs, 64, 64), torch.nn.ELU
    hidden = [each for a, b in itertools.pairwise(sizes) for each in (torch.nn.Linear(a, b), elu())]
    return torch.nn.Sequential(*hidden, torch.nn.Linear(sizes[-1], outputs))


class Policy(GaussianMixin, Model):
    def __init__(self, env):
        Model.__init__(self, observation_space=env.observation_space, action_space=env.action_space, device=env.device)
        GaussianMixin.__init__(self)
        self.net = layers(self.num_observations, self.num_actions)
        self.log_std = torch.nn.Parameter(torch.zeros(self.num_actions))

    def compute(self, inputs, role=""):
        return self.net(inputs["observations"]), {"log_std": self.log_std}


class Value(DeterministicMixin, Model):
    def __init__(self, env):
        Model.__init__(self, observation_space=env.observation_space, action_space=env.action_space, device=env.device)
        DeterministicMixin.__init__(self)
        self.net = layers(self.num_observations, 1)

    def compute(self, inputs, role=""):
        return self.net(inputs["observations"]), {}


def main(room, part, out, steps, num_envs=64):
    worlds = api.make("open_part", room, part, num_envs=num_envs, numpy=True)
    env = wrap_env(worlds, wrapper="gymnasium")
    models = {"policy": Policy(env).to(env.device), "value": Value(env).to(env.device)}
    agent = PPO(
        models=models,
        memory=RandomMemory(memory_size=32, num_envs=num_envs, device=env.device),
        cfg=PPO_CFG(rollouts=32, learning_epochs=5, mini_batches=4),
        observation_space=env.observation_space,
        action_space=env.action_space,
        device=env.device,
    )
    SequentialTrainer(env=env, agents=agent, cfg={"timesteps": steps, "headless": True}).train()
    api.export_policy(models["policy"].net, out, worlds)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]))
