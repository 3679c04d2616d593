"""Trains a policy by PPO in thousands of worlds that are stepped in one call, and saves it as a controller.

    pip install -e '.[rl]'
    python examples/train/ppo.py --scenario examples/train/three.yaml --steps 10000000 -o runs/ppo
    sonata2d evaluate --scenario examples/train/three.yaml --controller runs/ppo/policy.npz ...

The loop is written out, so that it can be changed: rollouts, generalised advantages, the clipped objective (Schulman et
al., arXiv 1707.06347 and 1506.02438). The folder gets `policy.npz` and the learning curve, `curve.csv`.
"""

from __future__ import annotations

import csv
import json
import shutil
import time
from pathlib import Path
from typing import Any

import click
import numpy as np
import torch
from torch import nn

import sonata2d.gym as s2g
from sonata2d.benchmark import attention
from sonata2d.benchmark.attention import OWN, TABLES, WIDTH, columns

HORIZON, EPOCHS, MINIBATCHES = 32, 4, 8  # steps of a rollout; passes over it, and parts of a pass
GAMMA, LAMBDA, CLIP, ENTROPY, LEARNING_RATE = 0.98, 0.95, 0.2, 0.001, 5e-4
LIMIT = 10.0  # of the normalised observations


class Normaliser:
    """Mean and variance of all observations so far.

    Args:
        size: number of columns.
        kept: columns that stay as they are, such as masks.
    """

    def __init__(self, size: int, kept: list[int]) -> None:
        self.mean, self.variance, self.count = torch.zeros(size), torch.ones(size), 1e-4
        self.kept = kept

    def update(self, batch: torch.Tensor) -> None:
        """Add observations, (B, D); Chan et al., The American Statistician 37 (1983) 242."""
        count = self.count + len(batch)
        delta = batch.mean(0) - self.mean
        spread = delta.square() * (self.count * len(batch) / count)
        self.variance = (self.variance * self.count + batch.var(0, unbiased=False) * len(batch) + spread) / count
        self.mean, self.count = self.mean + delta * (len(batch) / count), count
        self.mean[self.kept], self.variance[self.kept] = 0.0, 1.0

    def __call__(self, batch: torch.Tensor) -> torch.Tensor:
        return ((batch - self.mean) / (self.variance + 1e-8).sqrt()).clamp(-LIMIT, LIMIT)


def perceptron(inputs: int, outputs: int, scale: float) -> nn.Sequential:
    """Two hidden layers; the last layer begins with small weights."""
    network = nn.Sequential(
        nn.Linear(inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs)
    )  # fmt: skip
    with torch.no_grad():
        network[-1].weight.mul_(scale)
    return network


class Attention(nn.Module):
    """The network of `attention.py`.

    Args:
        parts: offset and shape of each part of the observation.
        outputs: of the network.
        scale: of the first weights of the last layer.
    """

    def __init__(self, parts: dict[str, Any], outputs: int, scale: float) -> None:
        super().__init__()
        self.parts = parts
        self.own = nn.Linear(sum(parts[name][1][0] for name in OWN), WIDTH)
        for name in TABLES:
            setattr(self, f"{name}_key", nn.Linear(parts[name][1][1], WIDTH))
            setattr(self, f"{name}_value", nn.Linear(parts[name][1][1], WIDTH))
        self.hidden, self.action = nn.Linear(2 * WIDTH, WIDTH), nn.Linear(WIDTH, outputs)
        with torch.no_grad():
            self.action.weight.mul_(scale)

    def part(self, flat: torch.Tensor, name: str) -> torch.Tensor:
        offset, shape = self.parts[name]
        return flat[:, offset : offset + int(np.prod(shape))].reshape(-1, *shape)

    def forward(self, flat: torch.Tensor) -> torch.Tensor:
        query = torch.tanh(self.own(torch.cat([self.part(flat, name) for name in OWN], 1)))
        rows = [self.part(flat, name) for name in TABLES]
        key = torch.cat([torch.tanh(getattr(self, f"{n}_key")(r)) for n, r in zip(TABLES, rows, strict=True)], 1)
        value = torch.cat([torch.tanh(getattr(self, f"{n}_value")(r)) for n, r in zip(TABLES, rows, strict=True)], 1)
        is_there = torch.cat([self.part(flat, f"{name}_mask") for name in TABLES], 1) > 0.5
        score = (key @ query[:, :, None])[..., 0] / WIDTH**0.5
        weight = torch.softmax(score.masked_fill(~is_there, -1e9), 1) * is_there
        context = (weight[:, None] @ value)[:, 0]
        output: torch.Tensor = self.action(torch.tanh(self.hidden(torch.cat((query, context), 1))))
        return output


class Learner:
    """PPO with a normal distribution of actions.

    Args:
        envs: with flat observations, in the autoreset mode `NEXT_STEP`.
        seed: of the scenes and of the actions.
        network: `perceptron` or `attention`.
    """

    def __init__(self, envs: s2g.SocialNavVectorEnv, seed: int, network: str) -> None:
        torch.manual_seed(seed)
        self.envs, count = envs, envs.num_envs
        size, actions = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
        parts = columns(s2g.SocialNavEnv(envs.config).observation_space)
        self.actor: nn.Module = perceptron(size, actions, 0.01)
        self.critic: nn.Module = perceptron(size, 1, 1.0)
        if network == "attention":
            self.actor, self.critic = Attention(parts, actions, 0.01), Attention(parts, 1, 1.0)
        self.spread = nn.Parameter(torch.full((actions,), -0.5))  # logarithm of the standard deviation
        parameters = [*self.actor.parameters(), *self.critic.parameters(), self.spread]
        self.optimiser = torch.optim.Adam(parameters, lr=LEARNING_RATE, eps=1e-5)
        masks = [part for name, part in parts.items() if name.endswith("_mask")]
        self.normalise = Normaliser(
            size, [offset + k for offset, (count_of_rows,) in masks for k in range(count_of_rows)]
        )
        self.observation = torch.from_numpy(envs.reset(seed=seed * count)[0])
        self.is_over = torch.zeros(count, dtype=torch.bool)  # so that the next step only begins an episode
        self.goals, self.episodes = 0, 0

    def distribution(self, inputs: torch.Tensor) -> torch.distributions.Normal:
        return torch.distributions.Normal(self.actor(inputs), self.spread.exp())

    @torch.no_grad()
    def rollout(self) -> dict[str, torch.Tensor]:
        """Drive all robots for `HORIZON` steps; the steps that only begin an episode are left out."""
        rows: list[tuple[torch.Tensor, ...]] = []
        for _ in range(HORIZON):
            self.normalise.update(self.observation)
            inputs = self.normalise(self.observation)
            distribution = self.distribution(inputs)
            action = distribution.sample()
            observation, reward, terminated, truncated, infos = self.envs.step(action.numpy())
            self.observation = torch.from_numpy(observation)
            following = self.critic(self.normalise(self.observation))[:, 0]
            following[torch.from_numpy(terminated)] = 0.0  # a time limit is no end: the value counts
            ends, begins = torch.from_numpy(terminated | truncated), self.is_over
            self.is_over = ends
            rows.append((inputs, action, distribution.log_prob(action).sum(1), self.critic(inputs)[:, 0],
                         following, torch.from_numpy(reward).float(), ends, begins))  # fmt: skip
            self.episodes += int(ends.sum())
            self.goals += int(np.sum(infos.get("is_success", 0)))
        inputs, action, log_prob, value, following, reward, ends, begins = map(torch.stack, zip(*rows, strict=True))
        advantage, running = torch.zeros_like(value), torch.zeros(value.shape[1])
        for t in reversed(range(HORIZON)):
            running = reward[t] + GAMMA * following[t] - value[t] + GAMMA * LAMBDA * running * ~(ends[t] | begins[t])
            advantage[t] = running
            running = running * ~begins[t]
        valid = ~begins
        return {"inputs": inputs[valid], "action": action[valid], "log_prob": log_prob[valid],
                "advantage": advantage[valid], "return": (advantage + value)[valid]}  # fmt: skip

    def update(self, rollout: dict[str, torch.Tensor]) -> None:
        """Improve actor and critic."""
        count = len(rollout["inputs"])
        for _ in range(EPOCHS):
            for batch in torch.randperm(count).chunk(MINIBATCHES):
                part = {name: values[batch] for name, values in rollout.items()}
                distribution = self.distribution(part["inputs"])
                ratio = (distribution.log_prob(part["action"]).sum(1) - part["log_prob"]).exp()
                advantage = (part["advantage"] - part["advantage"].mean()) / (part["advantage"].std() + 1e-8)
                objective = torch.minimum(ratio * advantage, ratio.clamp(1.0 - CLIP, 1.0 + CLIP) * advantage).mean()
                error = (self.critic(part["inputs"])[:, 0] - part["return"]).square().mean()
                loss = 0.5 * error - objective - ENTROPY * distribution.entropy().sum(1).mean()
                self.optimiser.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(self.optimiser.param_groups[0]["params"], 0.5)
                self.optimiser.step()


@click.command()
@click.option("--scenario", default="empty", help="Scenario preset, or a scenario file.", show_default=True)
@click.option("--worlds", type=click.IntRange(min=1), default=256, show_default=True)
@click.option("--episodes", type=click.IntRange(min=1), default=2, show_default=True, help="Scenes of each world.")
@click.option("--threads", type=click.IntRange(min=1), default=2, show_default=True)
@click.option("--steps", type=click.IntRange(min=1), default=10_000_000, show_default=True, help="Of all worlds.")
@click.option("--seed", default=0, show_default=True)
@click.option("--network", type=click.Choice(["perceptron", "attention"]), default="perceptron", show_default=True)
@click.option("-o", "--out", type=click.Path(path_type=Path), required=True, help="Folder for the results.")
def main(
    scenario: str, worlds: int, episodes: int, threads: int, steps: int, seed: int, network: str, out: Path
) -> None:
    """Train a policy by PPO."""
    torch.set_num_threads(threads)
    envs = s2g.SocialNavVectorEnv(worlds, scenario, flat=True, episodes=episodes, threads=threads)
    learner, rows, spent = Learner(envs, seed, network), list[Any](), [0.0, 0.0]
    rollouts = max(steps // (worlds * HORIZON), 1)
    for n in range(rollouts):
        learner.optimiser.param_groups[0]["lr"] = LEARNING_RATE * (1.0 - n / rollouts)
        start = time.perf_counter()
        rollout = learner.rollout()
        middle = time.perf_counter()
        learner.update(rollout)
        spent = [spent[0] + middle - start, spent[1] + time.perf_counter() - middle]
        if (n + 1) % max(rollouts // 20, 1) == 0:
            done, share = (n + 1) * worlds * HORIZON, learner.goals / max(learner.episodes, 1)
            rate = done / sum(spent)
            click.echo(f"{done:>10} steps: goal {100.0 * share:3.0f} %, {rate:.0f} steps/s, "
                       f"{100.0 * spent[0] / sum(spent):.0f} % of the time in rollouts")  # fmt: skip
            rows.append((done, share))
            learner.goals = learner.episodes = 0
    out.mkdir(parents=True, exist_ok=True)
    normalisation = learner.normalise.mean.numpy(), (learner.normalise.variance + 1e-8).sqrt().numpy()
    if network == "attention":
        weights = {name: values.numpy() for name, values in learner.actor.state_dict().items()}
        settings = json.dumps(envs.config.settings())
        np.savez_compressed(
            out / "attention.npz", mean=normalisation[0], deviation=normalisation[1], scenario=settings, **weights
        )
        policy = Path(shutil.copy(attention.__file__, out))
    else:
        policy = out / "policy.npz"
        env = s2g.Flat(s2g.SocialNavEnv(scenario))
        s2g.save_policy(policy, learner.actor, env, normalisation=normalisation, note=f"PPO, {steps} steps")
    with (out / "curve.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("step", "goal_share"), *rows])
    click.echo(policy)


if __name__ == "__main__":
    main()
