"""Train a network on data sets: deterministic, and to be stopped and gone on with at any time.

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
from data import run_cleanly
from networks import NETWORKS, export
from samples import PARTS, Samples, joined, samples_of
from torch import nn
from tqdm import tqdm

from sonata2d.learning.network import network_of
from sonata2d.learning.weights import read_weights

THREADS = 1  # the order of sums, and so their bits, depend on it; two trainings at a time use two cores better


@dataclass(frozen=True)
class Recipe:
    """How to train.

    Attributes:
        rate, decay: of Adam.
        fading: whether the rate falls to nothing along half a cosine wave.
        batch: graphs a step.
        epochs: at most.
        every, patience: the dev part is looked at every so many epochs; it ends after so many looks without a better.
    """

    rate: float
    decay: float
    fading: bool
    batch: int
    epochs: int
    every: int
    patience: int


RECIPES = {
    "paper": Recipe(5e-4, 1e-9, fading=False, batch=40, epochs=40, every=5, patience=5),
    "attention": Recipe(1e-3, 1e-9, fading=True, batch=64, epochs=30, every=5, patience=8),
}


@dataclass(frozen=True, eq=False)
class Part:
    """Some of the samples, as tensors on a device, cut into batches on demand."""

    samples: Samples
    chosen: Any
    device: torch.device

    def __len__(self) -> int:
        return len(self.chosen)

    def batches(self, size: int, order: Any) -> Iterator[tuple[list[torch.Tensor], torch.Tensor]]:
        """Inputs of a network and what it should answer; `order` are the numbers of the part's samples."""
        held = self.samples
        node_at, tie_at = (np.concatenate(([0], np.cumsum(counts))) for counts in (held.nodes, held.ties))
        for start in range(0, len(order), size):
            rows = self.chosen[order[start : start + size]]
            offset = np.concatenate(([0], np.cumsum(held.nodes[rows])))
            nodes = np.concatenate([np.arange(node_at[k], node_at[k + 1]) for k in rows])
            ties = np.concatenate([np.arange(tie_at[k], tie_at[k + 1]) for k in rows])
            edges = held.edges[:, ties] + np.repeat(offset[:-1], held.ties[rows])
            told = (held.x[nodes], edges, held.relation[ties].astype(np.int64), offset[:-1])
            yield [torch.from_numpy(a).to(self.device) for a in told], torch.from_numpy(held.y[rows]).to(self.device)


def mean_square(network: nn.Module, part: Part) -> float:
    """Mean squared error over a part; of three numbers each."""
    total = 0.0
    with torch.no_grad():
        for told, wanted in part.batches(500, np.arange(len(part))):
            total += float(((network(*told) - wanted) ** 2).sum())
    return total / (3 * len(part))


def train(
    name: str, data: list[Path], out: Path, *, start: Path | None = None, epochs: int | None = None, seed: int = 0
) -> Path:
    """Train a network, or go on with it.

    Args:
        name: of `NETWORKS`.
        data: data sets; dev and test parts are the first one's, the rest is for training.
        out: folder for the network, its log, and what it takes to go on.
        start: folder of a trained network to begin with.
        epochs: instead of the recipe's.
        seed: of the first weights and of the order of samples.

    Returns:
        `out`, with `policy.npz`, what it learned, and `training.json`: errors on each part, of the network and of
        predicting the mean, and times.

    Raises:
        ValueError: the first data set has nothing for a part, or another training was begun in `out`.
    """
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    torch.set_num_threads(THREADS)
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # without it cuBLAS refuses to be deterministic
    torch.use_deterministic_algorithms(True, warn_only=device.type == "cuda")
    torch.manual_seed(seed)
    out.mkdir(parents=True, exist_ok=True)
    recipe = RECIPES[name] if epochs is None else replace(RECIPES[name], epochs=epochs)
    network = NETWORKS[name]().to(device)
    if start is not None:
        network.load_state_dict(torch.load(start / "best.pt", weights_only=True, map_location=device))
    parts = _parts(data, network.graph, device)
    if start is None:
        told, _ = next(parts["train"].batches(200, np.arange(len(parts["train"]))))
        network.settle(*told)
    facts = f"{name} on {', '.join(map(str, data))} from {start}, seed {seed}, {recipe}"
    run = _Run(network, recipe, parts, out, seed, facts, keeps_last=start is not None)
    run.go_on()
    run.tell(name, data, parts)
    return out


def _parts(data: list[Path], graph: str, device: torch.device) -> dict[str, Part]:
    first, *others = (samples_of(folder, graph) for folder in data)
    for other in others:
        other.part[:] = 0
    whole = joined([first, *others])
    parts = {name: Part(whole, np.flatnonzero(whole.part == k), device) for k, name in enumerate(PARTS)}
    for name, part in parts.items():
        if not len(part):
            raise ValueError(
                f"{data[0]} has no runs for {name}; run `sonata2d split {data[0]} --parts train=0.9,dev=0.05,test=0.05`"
            )
    return parts


class _Run:
    """A training that can be interrupted after each epoch.

    It keeps the weights that fit the dev part best; or the last ones, where that part, which an expert drove, is not
    what the network is trained for.
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
        keeps_last: bool,
    ) -> None:
        self.network, self.recipe, self.parts, self.out, self.seed = network, recipe, parts, out, seed
        self.facts, self._keeps_last = facts, keeps_last
        self.adam = torch.optim.Adam(network.parameters(), lr=recipe.rate, weight_decay=recipe.decay)
        self.epoch, self.best, self.waited, self.log = 0, float("inf"), 0, []
        self.wall = self.cpu = 0.0

    def go_on(self) -> None:
        """From the last whole epoch to the end."""
        if (self.out / "state.pt").exists():
            self._restore()
        recipe = self.recipe
        with tqdm(total=recipe.epochs, initial=self.epoch, desc=f"training {self.out.name}", disable=None) as bar:
            while self.epoch < recipe.epochs and self.waited < recipe.patience:
                wall, cpu = time.perf_counter(), time.process_time()
                told = self._one_epoch()
                self.wall += time.perf_counter() - wall
                self.cpu += time.process_time() - cpu
                self._keep()
                bar.set_postfix(told)
                bar.update()
        self.network.load_state_dict(self._held("best.pt"))

    def _one_epoch(self) -> dict[str, float]:
        recipe, part = self.recipe, self.parts["train"]
        order = np.random.Generator(np.random.PCG64([self.seed, self.epoch])).permutation(len(part))
        steps, total = -(-len(part) // recipe.batch), 0.0
        for k, (given, wanted) in enumerate(part.batches(recipe.batch, order)):
            if recipe.fading:
                done = (self.epoch + k / steps) / recipe.epochs
                for group in self.adam.param_groups:
                    group["lr"] = recipe.rate * 0.5 * (1.0 + math.cos(math.pi * done))
            loss = ((self.network(*given) - wanted) ** 2).mean()
            self.adam.zero_grad()
            loss.backward()
            self.adam.step()
            total += loss.item() * len(wanted)
        self.epoch += 1
        told = {"epoch": self.epoch, "train": total / len(part)}
        if self.epoch % recipe.every == 0 or self.epoch == recipe.epochs:
            told["dev"] = mean_square(self.network, self.parts["dev"])
            self._judge(told["dev"])
        self.log.append(told)
        return told

    def _judge(self, dev: float) -> None:
        self.waited += 1
        if dev < self.best or self._keeps_last:
            self.best, self.waited = dev, 0
            torch.save(self.network.state_dict(), self.out / "best.pt")

    def _keep(self) -> None:
        state = {key: getattr(self, key) for key in ("facts", "epoch", "best", "waited", "log", "wall", "cpu")}
        whole = {"network": self.network.state_dict(), "adam": self.adam.state_dict(), **state}
        torch.save(whole, self.out / "state.pt.part")
        (self.out / "state.pt.part").replace(self.out / "state.pt")

    def _held(self, name: str) -> Any:
        """What a file holds, on this run's device, whichever wrote it."""
        device = next(self.network.parameters()).device
        return torch.load(self.out / name, weights_only=True, map_location=device)

    def _restore(self) -> None:
        state = self._held("state.pt")
        if state["facts"] != self.facts:
            raise ValueError(f"{self.out} holds another training, {state['facts']}; remove it, or name another folder")
        self.network.load_state_dict(state.pop("network"))
        self.adam.load_state_dict(state.pop("adam"))
        for key, value in state.items():
            setattr(self, key, value)

    def tell(self, name: str, data: list[Path], parts: dict[str, Part]) -> None:
        """Write the weights and what there is to say of them."""
        y, mean = parts["train"].samples.y, parts["train"].samples.y[parts["train"].chosen].mean(axis=0)
        result = {
            "network": name,
            "parameters": sum(p.numel() for p in self.network.parameters()),
            "data": [folder.name for folder in data],
            "graphs": {key: len(part) for key, part in parts.items()},
            "error": {key: mean_square(self.network, part) for key, part in parts.items()},
            "error of the mean": {key: float(((y[p.chosen] - mean) ** 2).mean()) for key, p in parts.items()},
            "epochs": self.epoch,
            "seconds": {"wall": round(self.wall, 1), "cpu": round(self.cpu, 1)},
            "device": str(next(self.network.parameters()).device),
            "log": self.log,
        }
        note = {key: result[key] for key in ("network", "data", "graphs", "error", "epochs")}
        export(self.network, self.out / "policy.npz", note)
        result["dev error as it drives"] = self._error_as_it_drives()
        (self.out / "training.json").write_text(json.dumps(result, indent=1))

    def _error_as_it_drives(self) -> float:
        """Of the dev part, in the fixed point of `sonata2d.learning`."""
        drives, part = network_of(read_weights((self.out / "policy.npz").resolve())), self.parts["dev"]
        total = 0.0
        for told, wanted in part.batches(1, np.arange(len(part))):
            x, edges, relation, _ = (tensor.cpu().numpy() for tensor in told)
            total += float(((drives(x.astype(float), edges, relation) - wanted.cpu().numpy()[0]) ** 2).sum())
        return total / (3 * len(part))


@click.command()
@click.option("--network", type=click.Choice(list(NETWORKS)), default="paper", show_default=True)
@click.option("--data", type=click.Path(path_type=Path, exists=True), multiple=True, required=True, help="A data set.")
@click.option("-o", "--out", type=click.Path(path_type=Path), required=True, help="Folder for the network.")
@click.option("--start", type=click.Path(path_type=Path, exists=True), help="Folder of a network to begin with.")
@click.option("--epochs", type=click.IntRange(1), help="At most so many.  [default: the network's own]")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
def main(network: str, data: tuple[Path, ...], out: Path, start: Path | None, epochs: int | None, seed: int) -> None:
    """Train NETWORK on data sets; run again to go on."""
    told = json.loads(
        (train(network, list(data), out, start=start, epochs=epochs, seed=seed) / "training.json").read_text()
    )
    click.echo(json.dumps({key: value for key, value in told.items() if key != "log"}, indent=1))


if __name__ == "__main__":
    run_cleanly(main)
