"""Draws the pictures of docs/scenarios.md and docs/gallery.md: a run of each preset, the room kinds, the formations.

python docs/draw_situations.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from sonata2d import Episode, EpisodeRecord, EpisodeRecorder, ScenarioConfig, SocialPlanner, generate, load_scenario
from sonata2d.core.scene import Scene
from sonata2d.core.snapshot import Snapshot
from sonata2d.metrics.situations import SITUATIONS, judge
from sonata2d.registry import ROOM_KINDS
from sonata2d.scenegen.scenario.rooms import RoomConfig
from sonata2d.view.episode_files import render
from sonata2d.view.film import save_film
from sonata2d.view.layers import Layers
from sonata2d.view.sheets import scene_picture
from sonata2d.view.stills import picture, save_surface

ROOT = Path(__file__).parent.parent

SEED = 4
OFFICE_SEED = 11
WIDTH = 620  # px
LAST = 4.0  # s
MOMENT = 250  # ticks of the picture of the waiting room
AFTER = 4.5  # s after the closest approach, at which a picture of an encounter ends


def main(folder: Path) -> None:
    """Draw all pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in SITUATIONS:
        record = run(generate(load_scenario(name), SEED))
        verdict, snapshots = judge(name, record), list(record.snapshots())
        assert verdict.took_place, f"{name}: {verdict.description}"
        path, layers = folder / f"situation-{name}.png", Layers(legend=False)
        render(selected(snapshots), path, size=size_of(snapshots[0]), caption=name, layers=layers)
        sys.stdout.write(f"{name}: {verdict.description}\n")
    for name in ("sonata-2020", "sonata-2020-crowded", "lively", "crossing-flows"):
        snapshots = list(run(generate(load_scenario(name), SEED)).snapshots())
        size = size_of(snapshots[0])
        render(snapshots, folder / f"preset-{name}.png", size=size, caption=name, layers=Layers(legend=False))
    waiting_room(folder / "waiting-room.png")
    demo(folder / "demo.gif")
    rooms(folder / "rooms.png")
    groups(folder / "groups.png")


def run(scene: Scene) -> EpisodeRecord:
    """One run of the expert."""
    recorder = EpisodeRecorder()
    Episode(scene, SocialPlanner(), observers=[recorder]).run()
    return recorder.record()


def selected(snapshots: list[Snapshot]) -> list[Snapshot]:
    """The part of a run to draw: of one person up to the closest approach, of many the end, otherwise all."""
    if len(snapshots[0].humans) > 10:
        return snapshots[-round(LAST / snapshots[0].dt) :]
    if len(snapshots[0].humans) > 1:
        return snapshots
    gaps = [
        abs(complex(*snapshot.robot.position) - complex(*snapshot.humans.position[0].tolist()))
        for snapshot in snapshots
    ]
    return snapshots[: gaps.index(min(gaps)) + round(AFTER / snapshots[0].dt)]


def size_of(snapshot: Snapshot) -> tuple[int, int]:
    """Width and height, px, of the picture of a room."""
    span = snapshot.scene.outline.max(axis=0) - snapshot.scene.outline.min(axis=0)
    width = WIDTH if span[0] > 1.4 * span[1] else round(0.6 * WIDTH)
    return width, round(width * (span[1] + 0.4) / (span[0] + 0.4)) + 30


def demo(path: Path) -> None:
    """The film of the README: the expert in an office."""
    office = load_scenario(ROOT / "examples/scenarios/office.yaml")
    snapshots = list(run(generate(office, OFFICE_SEED)).snapshots())
    layers = Layers(grid=False, caption=False)
    save_film(path, snapshots, fps=8, speed=2.0, size=(520, 362), layers=layers, interpolate=False)


def waiting_room(path: Path) -> None:
    """People who come and go."""
    scene = generate(load_scenario("waiting-room").changed(rules={"ends_on": ["time"]}), SEED)
    save_surface(picture(run(scene).snapshot(MOMENT), scale=75, layers=Layers(legend=True)), path)


def rooms(path: Path) -> None:
    """One scene of each room kind."""
    kinds = [kind for kind in ROOM_KINDS.built_in if kind != "square"]
    scenes = [
        generate(ScenarioConfig(humans=4, relations=0, room=RoomConfig(kinds={kind: 1.0}, turns=0)), 2)
        for kind in kinds
    ]
    save_surface(scene_picture(*scenes, scale=14, titles=kinds), path)


def groups(path: Path) -> None:
    """Formations of talking and of walking groups."""
    room = RoomConfig(kinds={"rectangle": 1.0}, breadth=5, length=5)
    empty = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0, "room": room}
    talking = [("face_to_face", 2), ("l", 2), ("side_by_side", 2), ("circle", 4), ("circle", 6), ("semicircle", 5)]
    settings = [{"talking_groups": 1, "groups": {"formations": [name], "talking_size": n}} for name, n in talking]
    walking = ("abreast", "v")
    settings += [{"walking_groups": 1, "groups": {"walking_formations": [name], "walking_size": 4}} for name in walking]
    scenes = [generate(ScenarioConfig(**empty, **given), 1) for given in settings]
    titles = [*(f"{name}, {n}" for name, n in talking), *(f"{name}, 4" for name in walking)]
    save_surface(scene_picture(*scenes, scale=26, titles=titles, columns=4), path)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images")
