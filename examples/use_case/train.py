"""Trains a network on data sets: deterministic, and continued by the same command after an interruption.

python examples/use_case/train.py --network paper --data runs/data -o runs/paper
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import torch
from data import run_command
from networks import NETWORKS, export
from samples import PARTS, Samples, concatenate, load_samples
from settings import SETTINGS, THREADS, Recipe
from torch import nn
from tqdm import tqdm

from sonata2d.core.portable_math import IntArray
from sonata2d.learning import read_weights
from sonata2d.learning.network import network_of


@dataclass(frozen=True, eq=False)
class Part:
    """A part of the samples, such as `train`, from which batches of tensors are made.

    Attributes:
        samples: all samples.
        chosen: (P,), indices of the samples of the part.
        device: of the tensors.
    """

    samples: Samples
    chosen: IntArray
    device: torch.device

    def __len__(self) -> int:
        return len(self.chosen)

    def batches(self, size: int, order: IntArray) -> Iterator[tuple[list[torch.Tensor], torch.Tensor]]:
        """Yield batches: the arguments of a network's `forward`, and the wanted outputs (S, 3).

        Args:
            size: graphs per batch; the last batch may be smaller.
            order: (Q,), indices into the part.
        """
        samples = self.samples
        first_node, first_edge = (
            np.concatenate(([0], np.cumsum(counts))) for counts in (samples.node_count, samples.edge_count)
        )
        for start in range(0, len(order), size):
            rows = self.chosen[order[start : start + size]]
            offset = np.concatenate(([0], np.cumsum(samples.node_count[rows])))  # first node of each graph in the batch
            nodes = np.concatenate([np.arange(first_node[k], first_node[k + 1]) for k in rows])
            edges = np.concatenate([np.arange(first_edge[k], first_edge[k + 1]) for k in rows])
            batch = (
                samples.x[nodes],
                samples.edges[:, edges] + np.repeat(offset[:-1], samples.edge_count[rows]),
                samples.relation[edges].astype(np.int64),
                offset[:-1],  # the hub is the first node of a graph
            )
            inputs = [torch.from_numpy(array).to(self.device) for array in batch]
            yield inputs, torch.from_numpy(samples.y[rows]).to(self.device)


def mean_squared_error(network: nn.Module, part: Part) -> float:
    """Return the mean squared error over the three outputs of all samples of a part."""
    total = 0.0
    with torch.no_grad():
        for inputs, wanted in part.batches(500, np.arange(len(part))):
            total += float(((network(*inputs) - wanted) ** 2).sum())
    return total / (3 * len(part))


def train(
    name: str, data: list[Path], out: Path, *, start: Path | None = None, epochs: int | None = None, seed: int = 0
) -> Path:
    """Train a network, or continue an interrupted training.

    Args:
        name: key of `NETWORKS`.
        data: data sets; the first one provides the dev and test parts, all of the others are for training.
        out: folder for weights, log and the state of an unfinished training.
        start: folder of a trained network whose weights are the initial ones.
        epochs: replaces the number of epochs of the recipe.
        seed: of the initial weights and of the order of the samples.

    Returns:
        `out`, which contains the weights `policy.npz`, and `training.json` with run times and the errors on each part
        of the network and of predicting the mean.

    Raises:
        ValueError: the first data set has no runs for a part, or `out` contains another training.
    """
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    torch.set_num_threads(THREADS)
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # cuBLAS is deterministic only if it is set
    torch.use_deterministic_algorithms(True, warn_only=device.type == "cuda")
    torch.manual_seed(seed)
    out.mkdir(parents=True, exist_ok=True)
    recipe = SETTINGS.recipes[name] if epochs is None else replace(SETTINGS.recipes[name], epochs=epochs)
    network = NETWORKS[name]().to(device)
    if start is not None:
        network.load_state_dict(torch.load(start / "best.pt", weights_only=True, map_location=device))
    parts = _load_parts(data, network.graph, device)
    if start is None:
        inputs, _ = next(parts["train"].batches(200, np.arange(len(parts["train"]))))
        network.scale_weights(*inputs)
    facts = f"{name} on {', '.join(map(str, data))} from {start}, seed {seed}, {recipe}"
    training = _Training(network, recipe, parts, out, seed, facts, keep_last=start is not None)
    training.fit()
    training.write_results(name, data)
    return out


def _load_parts(data: list[Path], graph: str, device: torch.device) -> dict[str, Part]:
    first, *others = (load_samples(folder, graph) for folder in data)
    for other in others:
        other.part[:] = 0
    samples = concatenate([first, *others])
    parts = {name: Part(samples, np.flatnonzero(samples.part == k), device) for k, name in enumerate(PARTS)}
    for name, part in parts.items():
        if not len(part):
            raise ValueError(
                f"{data[0]} has no runs for {name}; run `sonata2d split {data[0]} --parts train=0.9,dev=0.05,test=0.05`"
            )
    return parts


class _Training:
    """A training whose state is saved after each epoch.

    Args:
        network: with its initial weights.
        recipe: settings.
        parts: `train`, `dev` and `test`.
        out: folder for `state.pt` and `best.pt`.
        seed: of the order of the samples.
        facts: describes the training; a saved state is continued only if its facts are equal.
        keep_last: keep the last weights instead of those with the smallest dev error. For aggregation: it improves the
            network in the states that it reaches itself, and the dev part contains only states of the expert.
    """

    def __init__(
        self,
        network: nn.Module,
        recipe: Recipe,
        parts: dict[str, Part],
        out: Path,
        seed: int,
        facts: str,
        *,
        keep_last: bool,
    ) -> None:
        self.network, self.recipe, self.parts, self.out, self.seed = network, recipe, parts, out, seed
        self.facts, self._keep_last = facts, keep_last
        self.adam = torch.optim.Adam(network.parameters(), lr=recipe.rate, weight_decay=recipe.decay)
        # The names of these attributes are keys of state.pt. `waited` counts evaluations without improvement.
        self.epoch, self.best, self.waited, self.log = 0, float("inf"), 0, []
        self.wall = self.cpu = 0.0

    def fit(self) -> None:
        """Train from the last completed epoch to the end, and load the weights to keep into the network."""
        if (self.out / "state.pt").exists():
            self._restore()
        recipe = self.recipe
        with tqdm(total=recipe.epochs, initial=self.epoch, desc=f"training {self.out.name}", disable=None) as bar:
            while self.epoch < recipe.epochs and self.waited < recipe.patience:
                wall, cpu = time.perf_counter(), time.process_time()
                row = self._train_epoch()
                self.wall += time.perf_counter() - wall
                self.cpu += time.process_time() - cpu
                self._save_state()
                bar.set_postfix(row)
                bar.update()
        self.network.load_state_dict(self._load("best.pt"))

    def _train_epoch(self) -> dict[str, float]:
        """Train one epoch and return its row of the log."""
        recipe, part = self.recipe, self.parts["train"]
        # The order depends on seed and epoch only, so a continued training sees the same batches.
        order = np.random.Generator(np.random.PCG64([self.seed, self.epoch])).permutation(len(part))
        steps, total = -(-len(part) // recipe.batch), 0.0
        for k, (inputs, wanted) in enumerate(part.batches(recipe.batch, order)):
            if recipe.fading:
                progress = (self.epoch + k / steps) / recipe.epochs
                for group in self.adam.param_groups:
                    group["lr"] = recipe.rate * 0.5 * (1.0 + math.cos(math.pi * progress))
            loss = ((self.network(*inputs) - wanted) ** 2).mean()
            self.adam.zero_grad()
            loss.backward()
            self.adam.step()
            total += loss.item() * len(wanted)
        self.epoch += 1
        row = {"epoch": self.epoch, "train": total / len(part)}
        if self.epoch % recipe.every == 0 or self.epoch == recipe.epochs:
            row["dev"] = mean_squared_error(self.network, self.parts["dev"])
            self._update_best(row["dev"])
        self.log.append(row)
        return row

    def _update_best(self, dev: float) -> None:
        self.waited += 1
        if dev < self.best or self._keep_last:
            self.best, self.waited = dev, 0
            torch.save(self.network.state_dict(), self.out / "best.pt")

    def _save_state(self) -> None:
        state = {key: getattr(self, key) for key in ("facts", "epoch", "best", "waited", "log", "wall", "cpu")}
        state = {"network": self.network.state_dict(), "adam": self.adam.state_dict(), **state}
        torch.save(state, self.out / "state.pt.part")
        (self.out / "state.pt.part").replace(self.out / "state.pt")  # an interruption leaves the old or the new file

    def _load(self, name: str) -> Any:
        """Return the content of a file, on the device of the network, whichever device it was saved from."""
        device = next(self.network.parameters()).device
        return torch.load(self.out / name, weights_only=True, map_location=device)

    def _restore(self) -> None:
        state = self._load("state.pt")
        if state["facts"] != self.facts:
            raise ValueError(
                f"{self.out} contains another training, {state['facts']}; remove it, or choose another folder"
            )
        self.network.load_state_dict(state.pop("network"))
        self.adam.load_state_dict(state.pop("adam"))
        for key, value in state.items():
            setattr(self, key, value)

    def write_results(self, name: str, data: list[Path]) -> None:
        """Write `policy.npz` and `training.json`."""
        parts = self.parts
        y, mean = parts["train"].samples.y, parts["train"].samples.y[parts["train"].chosen].mean(axis=0)
        result = {
            "network": name,
            "parameters": sum(p.numel() for p in self.network.parameters()),
            "data": [folder.name for folder in data],
            "graphs": {key: len(part) for key, part in parts.items()},
            "error": {key: mean_squared_error(self.network, part) for key, part in parts.items()},
            "error of the mean": {key: float(((y[p.chosen] - mean) ** 2).mean()) for key, p in parts.items()},
            "epochs": self.epoch,
            "seconds": {"wall": round(self.wall, 1), "cpu": round(self.cpu, 1)},
            "device": str(next(self.network.parameters()).device),
            "log": self.log,
        }
        note = {key: result[key] for key in ("network", "data", "graphs", "error", "epochs")}
        export(self.network, self.out / "policy.npz", note)
        result["dev error as it drives"] = self._fixed_point_error()
        (self.out / "training.json").write_text(json.dumps(result, indent=1))

    def _fixed_point_error(self) -> float:
        """Return the dev error of the exported weights, as `sonata2d.learning` computes with them when driving."""
        policy, part = network_of(read_weights((self.out / "policy.npz").resolve())), self.parts["dev"]
        total = 0.0
        for inputs, wanted in part.batches(1, np.arange(len(part))):
            x, edges, relation, _ = (tensor.cpu().numpy() for tensor in inputs)
            total += float(((policy(x.astype(float), edges, relation) - wanted.cpu().numpy()[0]) ** 2).sum())
        return total / (3 * len(part))


@click.command()
@click.option("--network", type=click.Choice(list(NETWORKS)), default="paper", show_default=True)
@click.option(
    "--data",
    type=click.Path(path_type=Path, exists=True),
    multiple=True,
    required=True,
    help="A data set; may be repeated. The first one provides the dev and test parts.",
)
@click.option("-o", "--out", type=click.Path(path_type=Path), required=True, help="Folder for the network.")
@click.option(
    "--start", type=click.Path(path_type=Path, exists=True), help="Folder of a network with the initial weights."
)
@click.option("--epochs", type=click.IntRange(1), help="Maximum number of epochs.  [default: depends on the network]")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
def main(network: str, data: tuple[Path, ...], out: Path, start: Path | None, epochs: int | None, seed: int) -> None:
    """Train NETWORK on data sets; the same command continues an interrupted training."""
    folder = train(network, list(data), out, start=start, epochs=epochs, seed=seed)
    result = json.loads((folder / "training.json").read_text())
    click.echo(json.dumps({key: value for key, value in result.items() if key != "log"}, indent=1))


if __name__ == "__main__":
    run_command(main)
