"""Draws the pictures of docs/scenarios.md: one run of each situation, and the kinds of room.

python docs/draw_situations.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from sonata2d import Episode, ScenarioConfig, SocialPlanner, generate, load_scenario
from sonata2d.core.snapshot import Snapshot
from sonata2d.metrics.situations import SITUATIONS, Looker, judge
from sonata2d.scenegen.scenario.rooms import RoomConfig, RoomKind
from sonata2d.view.files import render
from sonata2d.view.sheet import scene_picture
from sonata2d.view.still import save_surface

ROOT = Path(__file__).parent.parent

SEED = 4
WIDTH = 620  # px
LAST = 4.0  # s
PARTED = 4.5  # s after the nearest moment, at which a picture of two who met is taken


def main(folder: Path) -> None:
    """Draw all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in SITUATIONS:
        looks = run(name)
        verdict = judge(name, looks)
        assert verdict.took_place, f"{name}: {verdict.told}"
        render(shown(looks), folder / f"situation-{name}.png", size=size_of(looks[0]), caption=name)
        sys.stdout.write(f"{name}: {verdict.told}\n")
    rooms(folder / "rooms.png")
    groups(folder / "groups.png")


def run(name: str) -> list[Snapshot]:
    """All looks of one run."""
    looker = Looker()
    Episode(generate(load_scenario(name), SEED), SocialPlanner(), observers=[looker]).run()
    return looker.snapshots


def shown(looks: list[Snapshot]) -> list[Snapshot]:
    """Up to a little after the nearest moment, where there is but one person; of many the last seconds; else all."""
    if len(looks[0].humans) > 10:
        return looks[-round(LAST / looks[0].dt) :]
    if len(looks[0].humans) > 1:
        return looks
    gaps = [abs(complex(*look.robot.position) - complex(*look.humans.position[0].tolist())) for look in looks]
    return looks[: gaps.index(min(gaps)) + round(PARTED / looks[0].dt)]


def size_of(look: Snapshot) -> tuple[int, int]:
    """Width and height, px, of the picture of a room."""
    span = look.scene.outline.max(axis=0) - look.scene.outline.min(axis=0)
    width = WIDTH if span[0] > 1.4 * span[1] else round(0.6 * WIDTH)
    return width, round(width * (span[1] + 0.4) / (span[0] + 0.4)) + 30


def rooms(path: Path) -> None:
    """One room of each kind."""
    kinds = [kind for kind in RoomKind.__args__ if kind != "square"]
    scenes = [
        generate(ScenarioConfig(humans=4, relations=0, room=RoomConfig(kinds={kind: 1.0}, turns=0)), 2)
        for kind in kinds
    ]
    save_surface(scene_picture(*scenes, scale=14, titles=kinds), path)


def groups(path: Path) -> None:
    """Formations of people who talk, and of people who walk."""
    room = RoomConfig(kinds={"rectangle": 1.0}, breadth=5, length=5)
    empty = {"standing": 0, "wandering": 0, "tables": 0, "plants": 0, "relations": 0, "room": room}
    talking = [("face_to_face", 2), ("l", 2), ("side_by_side", 2), ("circle", 4), ("circle", 6), ("semicircle", 5)]
    own = [{"talking_groups": 1, "groups": {"formations": [name], "talking_size": n}} for name, n in talking]
    walking = ("abreast", "v")
    own += [{"walking_groups": 1, "groups": {"walking_formations": [name], "walking_size": 4}} for name in walking]
    scenes = [generate(ScenarioConfig(**empty, **given), 1) for given in own]
    titles = [*(f"{name}, {n}" for name, n in talking), *(f"{name}, 4" for name in walking)]
    save_surface(scene_picture(*scenes, scale=26, titles=titles, columns=4), path)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "images")
