"""Can simulated people be told from recorded ones? Free runs of recordings, judged by a classifier.

    python benchmarks/free_runs.py SCENE.csv[:SECONDS] ... [--seeds 3]     (needs scikit-learn)

In a free run everybody enters where and when the recorded person did, and is told only where the person left; nobody
minds the robot. SCENE.csv has tracks at 0.4 s: `frame, ped, x, y`, `group` (people with the same number above 0 walk
together), m; SCENE.obstacles.csv beside it has the walls. A random forest gets 21 summaries of snippets of 4.8 s, of
the walker's own motion and of its four nearest neighbours, and is trained on one half of the time and judged on the
other, both ways. Both kinds are smoothed over three frames and given 3 cm of noise, so that the annotation does not
tell.

- AUC: 0.5, nobody can tell; 1, everybody can. Two halves of one recording give 0.51-0.57. `own` is without neighbours.
- speed: mean of all people, m/s, recorded and simulated; in view: mean number of people.
- within a person: standard deviation of the speed (%), of the course about the chord (degrees), correlation of the
  speed after 1.2 s, and stops in a minute of walking.

Source: Webster & Amos, R. Soc. Open Sci. 7 (2020) 200307, for classifiers of crowds as a Turing test.
"""

from __future__ import annotations

import argparse
import csv
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sonata2d.agents.pedestrians.crowd import Crowd
from sonata2d.core.geometry import Twist
from sonata2d.formats.from_tracks import scenario_from_tracks
from sonata2d.scenegen.generator import generate
from sonata2d.sim.world import World

FRAME, TICKS = 0.4, 4  # s between frames, and ticks in a frame
LENGTH, STEP, NEIGHBOURS, RANGE = 12, 6, 4, 6.0  # steps of a snippet, frames between two, neighbours, and m to them
NOISE = 0.03  # m
Array = np.ndarray[Any, Any]


class Track(NamedTuple):
    """Positions of a person, (T, 2), m, from a frame on."""

    first: int
    position: Array

    def at(self, frame: int) -> Array | None:
        k = frame - self.first
        return self.position[k] if 0 <= k < len(self.position) else None


Tracks = dict[str, Track]


def recorded(path: Path, seconds: float) -> Tracks:
    """The tracks of a recording, from frame 0; gaps are filled with straight lines."""
    rows = defaultdict(list)
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            rows[row["ped"]].append((round(float(row["frame"])), float(row["x"]), float(row["y"])))
    begin = min(frame for own in rows.values() for frame, _, _ in own)
    found = {}
    for person, own in rows.items():
        table = np.array(sorted(row for row in own if (row[0] - begin) * FRAME <= seconds))
        if len(table) == 0:
            continue
        frames = np.arange(int(table[0, 0]), int(table[-1, 0]) + 1)
        places = np.stack([np.interp(frames, table[:, 0], table[:, column]) for column in (1, 2)], axis=-1)
        found[person] = Track(int(frames[0]) - begin, places)
    return found


def simulated(path: Path, seconds: float, seed: int) -> Tracks:
    """The tracks of a free run."""
    config = scenario_from_tracks(path, people="simulated", seconds=seconds)
    person = config.person.model_copy(update={"ignores_robot": 1.0})
    scene = generate(config.model_copy(update={"person": person}), seed=seed)
    world, crowd, rows = World(scene), Crowd(scene), defaultdict(list)
    for tick in range(int(seconds / scene.rules.dt) + 1):
        snapshot = world.snapshot()
        if tick % TICKS == 0:
            for human, place in zip(snapshot.humans.id.tolist(), snapshot.humans.position.tolist(), strict=True):
                rows[str(human)].append((tick // TICKS, place))
        world.step(Twist(), crowd.act(snapshot))
    return {human: Track(own[0][0], np.array([place for _, place in own])) for human, own in rows.items()}


def smooth(position: Array) -> Array:
    """The mean of three frames."""
    if len(position) < 3:
        return position
    middle = (position[:-2] + position[1:-1] + position[2:]) / 3.0
    return np.concatenate([position[:1], middle, position[-1:]])


def snippets(tracks: Tracks, begin: int, end: int, seed: int) -> tuple[Array, Array]:
    """Summaries of snippets, (S, 21), see `summary`, and the frames at which they begin, (S,)."""
    random = np.random.default_rng(seed)
    noisy = {
        p: Track(t.first, smooth(t.position) + random.normal(0.0, NOISE, t.position.shape)) for p, t in tracks.items()
    }
    rows, frames = [], []
    for person, track in noisy.items():
        for k in range(0, len(track.position) - LENGTH, STEP):
            frame, own = track.first + k, track.position[k : k + LENGTH + 1]
            if not begin <= frame < end - LENGTH or np.hypot(*(own[-1] - own[0])) < 1.0:
                continue
            ahead = (own[3] - own[0]) / max(np.hypot(*(own[3] - own[0])), 1e-9)
            axes = np.array([[ahead[0], -ahead[1]], [ahead[1], ahead[0]]])  # columns: ahead, to the left
            near = np.full((4, NEIGHBOURS, 2), np.nan)
            for n, later in enumerate((0, 4, 8, 12)):
                places = (other.at(frame + later) for name, other in noisy.items() if name != person)
                others = [(place - own[later]) @ axes for place in places if place is not None]
                others = sorted((o for o in others if o @ o < RANGE * RANGE), key=lambda o: float(o @ o))[:NEIGHBOURS]
                near[n, : len(others)] = np.array(others).reshape(-1, 2)
            rows.append(summary((own - own[0]) @ axes, near))
            frames.append(frame)
    return np.array(rows), np.array(frames)


OWN = 13  # numbers of `summary` that are of the walker's own motion


def summary(own: Array, near: Array) -> list[float]:
    """21 numbers of a snippet, of its positions (13, 2), m, and its neighbours at four times, (4, 4, 2), m, or NaN."""
    velocity = np.diff(own, axis=0) / FRAME
    speed, sideways = np.hypot(*velocity.T), np.diff(velocity[:, 1])
    net, off = np.hypot(*own[-1]), own[1:] - np.linspace(1 / LENGTH, 1.0, LENGTH)[:, None] * own[-1]
    deviation, distance = speed - speed.mean(), np.hypot(near[..., 0], near[..., 1])  # (4 times, 4 neighbours)

    def kept(values: Array) -> float:
        return float((values[1:] * values[:-1]).sum() / max((values**2).sum(), 1e-9))

    def mean(values: Array, otherwise: float) -> float:
        known = values[~np.isnan(values)]
        return float(known.mean()) if len(known) else otherwise

    first = distance[:, 0]
    change = first[-1] - first[0]
    return [
        speed.mean(), speed.std(), speed[-3:].mean() - speed[:3].mean(), speed.min() / speed.max(),
        speed.sum() * FRAME / max(net, 0.1), abs(velocity[-3:, 1].mean()), np.abs(off[:, 1]).max(),
        np.abs(np.diff(speed)).mean() / FRAME, np.abs(sideways).mean() / FRAME, np.abs(np.diff(speed, n=2)).mean(),
        velocity[:, 1].std(), kept(deviation), kept(sideways),
        *(mean(distance[:, k], RANGE) for k in range(NEIGHBOURS)),
        np.nanmin(first) if not np.isnan(first).all() else RANGE, mean(near[:, 0, 0], 0.0),
        mean(np.abs(near[:, 0, 1]), RANGE), 0.0 if np.isnan(change) else change,
    ]  # fmt: skip


def told_apart(values: Array, is_simulated: Array, frame: Array, middle: float) -> float:
    """AUC of a random forest."""
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.metrics import roc_auc_score

    found = []
    for train, test in ((frame < middle - LENGTH, frame >= middle), (frame >= middle + LENGTH, frame < middle)):
        forest = RandomForestClassifier(300, min_samples_leaf=3, max_features=0.4, random_state=0)
        forest.fit(values[train], is_simulated[train])
        found.append(roc_auc_score(is_simulated[test], forest.predict_proba(values[test])[:, 1]))
    return float(np.mean(found))


def within(tracks: Tracks) -> list[float]:
    """Variation along the way: speed, %, course, degrees, correlation after 1.2 s, stops in a minute of walking."""
    speeds, courses, kept, stops, walked = [], [], [], 0, 0.0
    for track in tracks.values():
        if len(track.position) < LENGTH + 1:
            continue
        velocity = np.diff(smooth(track.position), axis=0) / FRAME
        speed = np.hypot(*velocity.T)
        walked += FRAME * float((speed > 0.3).sum())
        edges = np.flatnonzero(np.diff(np.r_[0, speed < 0.2, 0]))
        for p, q in zip(edges[::2], edges[1::2], strict=True):
            is_inside = p >= 3 and q <= len(speed) - 3 and q - p >= 3
            stops += bool(is_inside and speed[:p].max() > 0.5 and speed[q:].max() > 0.5)
        way = track.position[-1] - track.position[0]
        if (speed > 0.3).mean() < 0.9 or np.hypot(*way) < 3.0:
            continue
        deviation = speed / speed.mean() - 1.0
        speeds.append(deviation.std())
        course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0])) - np.arctan2(way[1], way[0])
        courses.append(np.degrees(((course + np.pi) % (2 * np.pi) - np.pi).std()))
        if len(deviation) > LENGTH:
            kept.append(np.mean(deviation[3:] * deviation[:-3]) / max(np.mean(deviation**2), 1e-9))
    return [100.0 * float(np.median(speeds)), float(np.median(courses)), float(np.mean(kept)), 60.0 * stops / walked]


def scene_means(tracks: Tracks) -> tuple[float, float]:
    """Mean speed, m/s, and mean number of people in view."""
    speeds = np.concatenate([np.hypot(*np.diff(t.position, axis=0).T) / FRAME for t in tracks.values()])
    frames = np.concatenate([t.first + np.arange(len(t.position)) for t in tracks.values()])
    return float(speeds.mean()), len(frames) / len(np.unique(frames))


def judge(real: Tracks, made: Tracks) -> tuple[float, float]:
    """AUC of all summaries, and of the walker's own motion."""
    span = [[(t.first, t.first + len(t.position)) for t in tracks.values()] for tracks in (real, made)]
    begin = max(min(first for first, _ in own) for own in span)
    end = min(max(last for _, last in own) for own in span)
    (values, frame), (others, other_frame) = snippets(real, begin, end, 1), snippets(made, begin, end, 2)
    both, label = np.concatenate([values, others]), np.repeat([0, 1], [len(values), len(others)])
    given = label, np.concatenate([frame, other_frame]), float(np.median(frame))
    return told_apart(both, *given), told_apart(both[:, :OWN], *given)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", metavar="SCENE.csv[:SECONDS]")
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    for scene in arguments.scenes:
        name, _, given = scene.partition(":")
        path, seconds = Path(name), float(given or 300.0)
        real = recorded(path, seconds)
        runs = [simulated(path, seconds, seed) for seed in range(arguments.seeds)]
        judged = np.array([judge(real, run) for run in runs])
        speed, view = np.mean([scene_means(run) for run in runs], axis=0)
        own, (real_speed, real_view) = np.mean([within(run) for run in runs], axis=0), scene_means(real)
        each = np.round(judged[:, 0], 2).tolist()
        print(f"{path.stem:18} AUC {judged[:, 0].mean():.2f} {each} own {judged[:, 1].mean():.2f}")
        print(f"{'':18} speed {real_speed:.2f} {speed:.2f}   in view {real_view:.1f} {view:.1f}")
        print(f"{'':18} within a person {np.round(within(real), 2).tolist()} {np.round(own, 2).tolist()}", flush=True)


if __name__ == "__main__":
    main()
