"""Trains a policy in the Gymnasium environment, draws its learning curve and saves it as a controller.

    pip install -e '.[rl]'
    python examples/train/train.py ppo --scenario empty -o runs/ppo-empty
    python examples/train/train.py sac --scenario empty -o runs/sac-empty
    python examples/train/train.py imitation --scenario empty -o runs/imitation-empty
    sonata2d evaluate --scenario empty --controller runs/ppo-empty/policy.npz ...

The folder gets `policy.npz` (a controller that needs neither PyTorch nor Stable-Baselines3), `model.zip` (to go on with
Stable-Baselines3), `curve.csv` and `curve.png`. The same seed gives the same policy on the same machine.
"""

from __future__ import annotations

import csv
import json
import math
import time
from pathlib import Path
from typing import Any

import click
import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import set_random_seed
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

import sonata2d as s2
import sonata2d.gym as s2g

WORLDS = 16
STEPS = {"ppo": 200_000, "sac": 100_000, "imitation": 300}  # of imitation: episodes of the expert
GAMMA = 0.98
EVALUATION_SEED, EVALUATION_EPISODES, POINTS = 1_000_000, 20, 20
EPOCHS, BATCH, LEARNING_RATE = 60, 256, 1e-3  # of imitation
KEYS = ("goal", "robot", "walls", "humans", "humans_mask", "objects", "objects_mask")


def make(scenario: str, settings: dict[str, Any]) -> gymnasium.Env[Any, Any]:
    """The environment in which all recipes train: flat observations, the robot's own reward."""
    return s2g.Flat(s2g.SocialNavEnv(scenario, settings=settings), keys=KEYS)


class Curve(BaseCallback):
    """Evaluates the policy at regular intervals in scenes that the training does not use."""

    def __init__(self, env: gymnasium.Env[Any, Any], steps: int) -> None:
        super().__init__()
        self.env, self.interval, self.next, self.unit = env, steps / POINTS, 0.0, "steps"
        self.rows: list[tuple[int, float, float]] = []  # steps, mean return, share of episodes that reach the goal

    def _on_step(self) -> bool:
        if self.num_timesteps >= self.next:
            self.next += self.interval
            self.measure()
        return True

    def measure(self) -> None:
        """Evaluate the present policy, unless that was the last thing done."""
        if self.rows and self.rows[-1][0] == self.num_timesteps:
            return
        normalisation = self.model.get_vec_normalize_env()

        def act(observation: Any) -> Any:
            if normalisation is not None:
                observation = normalisation.normalize_obs(observation)
            return self.model.predict(observation, deterministic=True)[0]

        self.rows.append((self.num_timesteps, *evaluate(act, self.env)))
        steps, mean, share = self.rows[-1]
        click.echo(f"{steps:8} {self.unit}: return {mean:6.2f}, goal {100.0 * share:3.0f} %")


def evaluate(act: Any, env: gymnasium.Env[Any, Any]) -> tuple[float, float]:
    """Mean return, and the share of episodes that reach the goal."""
    returns, goals = [], 0
    for k in range(EVALUATION_EPISODES):
        observation, _ = env.reset(seed=EVALUATION_SEED if k == 0 else None)
        total, is_over, info = 0.0, False, {}
        while not is_over:
            observation, reward, terminated, truncated, info = env.step(act(observation))
            total, is_over = total + float(reward), terminated or truncated
        returns.append(total)
        goals += bool(info["is_success"])
    return float(np.mean(returns)), goals / EVALUATION_EPISODES


def train(name: str, scenario: str, settings: dict[str, Any], steps: int, seed: int) -> tuple[Any, Any, list[Any]]:
    """PPO or SAC: the model, the normalisation of its observations, and the curve."""
    worlds = VecMonitor(DummyVecEnv([lambda: make(scenario, settings)] * WORLDS))
    worlds.seed(seed * WORLDS)  # world k gets this plus k, so that two trainings share no scenes
    normalised = VecNormalize(worlds, norm_reward=name == "ppo", gamma=GAMMA)
    model: BaseAlgorithm
    if name == "ppo":
        # Noise that depends on the state and lasts for some ticks: noise of a single tick hardly moves the robot.
        model = PPO("MlpPolicy", normalised, n_steps=128, batch_size=512, n_epochs=10, gamma=GAMMA, use_sde=True,
                    sde_sample_freq=8, learning_rate=lambda left: 1e-3 * left, seed=seed, device="cpu",
                    policy_kwargs={"log_std_init": -1.0})  # fmt: skip
    else:
        model = SAC("MlpPolicy", normalised, learning_starts=2000, train_freq=1, gradient_steps=4, gamma=GAMMA,
                    tau=0.01, use_sde=True, sde_sample_freq=8, learning_rate=lambda left: 7e-4 * left, seed=seed,
                    device="cpu", policy_kwargs={"log_std_init": -2.0, "net_arch": [64, 64]})  # fmt: skip
    curve = Curve(make(scenario, settings), steps)
    model.learn(steps, callback=curve)
    curve.measure()
    return model, normalised, curve.rows


def imitate(scenario: str, settings: dict[str, Any], episodes: int, seed: int) -> tuple[Any, Any, list[Any]]:
    """Behaviour cloning of `social-planner` by the network that PPO would train."""
    env = make(scenario, settings)
    runs = s2g.demonstrate(env, s2.SocialPlanner(), seed=seed, episodes=episodes, noise=0.3)
    observations = np.concatenate([np.stack(run.observations[:-1]) for run in runs])
    actions = torch.as_tensor(np.concatenate([run.actions for run in runs]))
    click.echo(f"{len(runs)} episodes of the expert, {len(actions)} steps")
    normalised = VecNormalize(DummyVecEnv([lambda: env]), norm_reward=False)
    normalised.obs_rms.update(observations)
    normalised.training = False
    model = PPO("MlpPolicy", normalised, seed=seed, device="cpu", policy_kwargs={"net_arch": [128, 128]})
    inputs = torch.as_tensor(normalised.normalize_obs(observations), dtype=torch.float32)
    optimiser = torch.optim.Adam(model.policy.parameters(), lr=LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, EPOCHS)
    curve = Curve(make(scenario, settings), EPOCHS)
    curve.init_callback(model)
    curve.unit = "epochs"
    for epoch in range(EPOCHS):
        curve.num_timesteps = epoch
        curve._on_step()
        for batch in torch.randperm(len(actions)).split(BATCH):
            means = model.policy.get_distribution(inputs[batch]).distribution.mean
            loss = ((means - actions[batch]) ** 2).mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
        schedule.step()
    curve.num_timesteps = EPOCHS
    curve.measure()
    return model, normalised, curve.rows


def draw(rows: list[Any], path: Path, title: str, unit: str) -> None:
    """The learning curve as a picture."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    steps, returns, goals = zip(*rows, strict=True)
    figure, left = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    left.plot(steps, 100.0 * np.array(goals), color="tab:blue", marker="o", markersize=3)
    left.set(xlabel=unit, ylabel="episodes that reach the goal (%)", ylim=(-3, 103), title=title)
    left.yaxis.label.set_color("tab:blue")
    right = left.twinx()
    right.plot(steps, returns, color="tab:orange", linestyle="--")
    right.set_ylabel("mean return (dashed)", color="tab:orange")
    left.grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)


@click.command()
@click.argument("recipe", type=click.Choice(["ppo", "sac", "imitation"]))
@click.option("--scenario", default="empty", help="Scenario preset, or a scenario file.", show_default=True)
@click.option("--set", "changes", default="{}", help='Settings to change, as JSON, e.g. {"wandering": 3}.')
@click.option("--steps", type=click.IntRange(min=1), help="Steps of training; of imitation: episodes of the expert.")
@click.option("--seed", default=0, show_default=True)
@click.option("-o", "--out", type=click.Path(path_type=Path), required=True, help="Folder for the results.")
def main(recipe: str, scenario: str, changes: str, steps: int | None, seed: int, out: Path) -> None:
    """Train a policy with RECIPE: ppo, sac or imitation."""
    try:
        settings = json.loads(changes)
        make(scenario, settings)
    except (s2.Sonata2dError, TypeError, ValueError) as error:
        raise click.ClickException(f"scenario {scenario} with the settings {changes}: {error}") from error
    steps = steps or STEPS[recipe]
    torch.set_num_threads(1)
    set_random_seed(seed)
    start, wall = time.process_time(), time.perf_counter()
    if recipe == "imitation":
        model, normalisation, rows = imitate(scenario, settings, steps, seed)
    else:
        model, normalisation, rows = train(recipe, scenario, settings, steps, seed)
    cpu, wall = time.process_time() - start, time.perf_counter() - wall
    out.mkdir(parents=True, exist_ok=True)
    note = f"{recipe} on {scenario} {changes}, {steps} {'episodes' if recipe == 'imitation' else 'steps'}, seed {seed}"
    s2g.save_policy(out / "policy.npz", model, make(scenario, settings), normalisation=normalisation, note=note)
    model.save(out / "model.zip")
    normalisation.save(str(out / "normalisation.pkl"))
    with (out / "curve.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("step", "mean_return", "goal_share"), *rows])
    draw(
        rows,
        out / "curve.png",
        f"{recipe}, {Path(scenario).stem} ({math.ceil(cpu)} s of CPU)",
        "epoch" if recipe == "imitation" else "step",
    )
    click.echo(f"{out / 'policy.npz'}: {cpu:.0f} s of CPU, {wall:.0f} s")


if __name__ == "__main__":
    main()
