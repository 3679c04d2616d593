"""Numbers of every type give the results of floats, wherever the public interface means a float.

Each case calls a public class or function with numbers made by `n` in the places of floats; it returns everything in
which a number of another type could show. `test_every_public_float_has_a_case` finds the places by their annotations.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest

import sonata2d as s2
import sonata2d.agents as s2a
import sonata2d.formats as s2f
import sonata2d.gym as s2g
import sonata2d.learning as s2l
import sonata2d.learning.graph as s2lg
import sonata2d.metrics as s2m
import sonata2d.record as s2r
import sonata2d.testing as s2t
import sonata2d.view as s2v
from sonata2d.agents import KernelController
from sonata2d.agents.controllers.planner import Weights
from sonata2d.agents.drives.built_in import Bicycle, Differential
from sonata2d.agents.sensors.base import SensorNoise
from sonata2d.agents.sensors.lidar import LidarReading
from sonata2d.benchmark import RatingModel, Sensing
from sonata2d.benchmark.shown import Perception
from sonata2d.core.attributes import AttributeColumn, AttributeSpec
from sonata2d.core.entities import Area, Furniture, Goal, Human, Limits, Robot, Wall
from sonata2d.core.floats import FloatFields
from sonata2d.core.geometry import Disc, Rectangle
from sonata2d.core.scene import Rules
from sonata2d.core.snapshot import snapshot_of
from sonata2d.errors import ConfigError, RenderError
from sonata2d.formats.format import Options
from sonata2d.gym.description import describe
from sonata2d.study import StudyConfig

Number = Callable[[float], Any]
TYPES: tuple[Number, ...] = (int, np.int64, np.float32)


def scene_of(n: Number) -> s2.Scene:
    """A scene in which every number is given."""
    corners = tuple((n(x), n(y)) for x, y in ((0, 0), (12, 0), (12, 9), (0, 9)))
    walker = Human(
        1, s2.Pose(n(3), n(4), n(0)), desired_speed=n(1), behaviour="walking", reacts_to_robot=n(1),
        robot_clearance=n(1), goals=((n(10), n(4)), (n(3), n(4))), velocity=(n(1), n(0)), stays=(n(1),), headway=n(1),
        politeness=n(1), radius=n(1), breadth=n(2), pre_movement=n(1), reaction_time=n(1),
    )  # fmt: skip
    recorded = Human(2, s2.Pose(n(8), n(2)), behaviour="recorded", track=((n(8), n(2)), (n(8), n(3))))
    doors = (s2.Door(1, s2.Pose(n(0), n(5), n(0)), n(1), n(1)),)
    queues = (s2.Queue(1, s2.Pose(n(8), n(8), n(0)), n(1), (n(5), n(9))),)
    places = (s2.Place(1, n(3), n(7), n(1), n(2), (n(5), n(9))),)
    ends = zip(corners, (*corners[1:], corners[0]), strict=True)
    return s2.Scene(
        "whole", "whole", corners, (*(Wall(*pair) for pair in ends), Wall((n(6), n(9)), (n(6), n(8)))),
        (Furniture(10, "table", s2.Pose(n(10), n(7), n(0)), Rectangle(n(1), n(2))),
         Furniture(11, "plant", s2.Pose(n(1), n(8), n(0)), Disc(n(1)))),
        (walker, recorded), Robot(s2.Pose(n(2), n(2), n(0)), n(1), limits=Limits(n(1), n(1), n(1), n(2), n(2), n(3))),
        Goal(n(10), n(2), n(1)), rules=Rules(time_limit=n(2)), doors=doors, queues=queues, places=places,
    )  # fmt: skip


def with_door(n: Number) -> s2.Scene:
    door = s2.InteriorDoor(1, s2.Pose(n(6), n(7), n(0)), n(1), opening=n(1), opening_time=n(2), hold=n(1))
    return replace(scene_of(n), interior_doors=(door,))


@cache
def scene() -> s2.Scene:
    return scene_of(float)


def document(controller: s2.Controller, of: s2.Scene | None = None) -> bytes:
    """The file of the first two seconds of an episode."""
    recorder = s2.EpisodeRecorder()
    s2.Episode(of or scene(), controller, observers=[recorder]).run()
    return recorder.document()


@cache
def record() -> s2.EpisodeRecord:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "episode.json"
        path.write_bytes(document(s2.StraightToGoal()))
        return s2.read_episode(path)


@cache
def snapshots() -> list[s2.Snapshot]:
    return [*record()]


@cache
def env() -> s2g.SocialNavEnv:
    result = s2g.SocialNavEnv("empty")
    result.reset(seed=0)
    return result


def mapping() -> s2a.DeviceMapping:
    return s2a.DeviceMapping({"w": ("ahead", 0.5), "left_x": ("turn", -1.0)}, 0.1, 0.2)


@cache
def scan() -> LidarReading:
    """A scan of the first scene."""
    return s2a.Lidar(rays=60).start(scene())(snapshots()[0], SensorNoise(scene(), "lidar", 0))  # type: ignore[no-any-return]


class Driving(s2.Controller):
    def __init__(self, n: Number) -> None:
        self._n = n

    def act(self, snapshot: s2.Snapshot) -> s2.Twist:
        return s2.Twist(self._n(1), vy=self._n(0), omega=self._n(1))

    def label(self, snapshot: s2.Snapshot, twist: s2.Twist) -> Any:
        return snapshot.robot.pose.to_local((self._n(1), self._n(2)))


def saved(save: Callable[[Path], object], suffix: str) -> bytes:
    """The bytes of the file that a call writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"picture{suffix}"
        save(path)
        return path.read_bytes()


def steps(wrap: Callable[[s2g.SocialNavEnv], Any]) -> Any:
    """Spaces, observations and rewards of three steps, and the settings of the wrapper."""
    env = wrap(s2g.SocialNavEnv("lively", order="scene"))
    results = [env.reset(seed=3)[0]] + [env.step(env.action_space.sample() * 0)[:3] for _ in range(3)]
    space = env.observation_space
    bounds = {name: (box.low, box.high) for name, box in space.items() if hasattr(box, "low")}
    return bounds, results, describe(env)["wrappers"]


def reward(kind: Any, n: Number) -> Any:
    weights = kind(**{field.name: n(2) for field in fields(kind)})
    return weights, [weights(before, after, None) for before, after in zip(snapshots(), snapshots()[1:], strict=False)]


class Ahead(s2g.DerivedPart):
    name, about, columns = "ahead", frozenset({"robot"}), (s2g.Column("x", "m", 9.0),)


def bounds_of_part(n: Number) -> Any:
    columns = (s2g.Column("x", "m", high=n(9), low=n(1)),)
    return columns, type("Part", (Ahead,), {"columns": columns}).bounds()


def camera(n: Number) -> Any:
    view = s2v.Camera(n(20), n(1), n(9), (300, 200), (n(0), n(1)))
    return [
        view,
        view.to_pixels((n(3), n(4))),
        view.to_world((n(30), n(40))),
        view.rotated((n(1), n(0))),
        view.zoomed(n(2), (n(4), n(5))),
        s2v.Camera.fit([(n(0), n(0)), (n(4), n(3))], scale=n(50), side=n(90), margin=n(1)),
        s2v.Camera.behind((n(3), n(4)), (n(1), n(0)), size=(300, 200), view_range=n(4)),
    ]


def painted(n: Number) -> bytes:
    surface = pygame.Surface((200, 150))
    s2v.Painter(scene()).draw(surface, snapshots()[5], zoom=n(2), view_range=n(4))
    return pygame.image.tobytes(surface, "RGB")


def trails(n: Number) -> bytes:
    places = [[[n(2 + k), n(3)] for k in range(5)]]
    path = s2v.Trails(np.array([n(k) for k in range(5)]), np.array(places[0]), np.array(places).swapaxes(0, 1))
    surface = pygame.Surface((200, 150))
    s2v.Painter(scene()).draw(surface, snapshots()[5], trails=path)
    return pygame.image.tobytes(surface, "RGB")


def recording(n: Number) -> Any:
    """A scenario of recorded people, and an episode of them."""
    rows = [f"{k},{ped},{0.5 * k},{ped}" for k in range(8) for ped in (1, 2)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "street.csv"
        path.write_text("\n".join(["frame,ped,x,y", *rows]))
        config = s2f.scenario_from_tracks(
            path, people="simulated", start=n(1), seconds=n(2), robot=(n(2), n(4), n(0)), goal=(n(3), n(5)),
            frame_time=n(1), speed=n(1),
        )  # fmt: skip
        s2f.import_from(path, "csv", Path(folder) / "out", s2f.Options(frame_time=n(1)))
        return config, [file.read_bytes() for file in sorted((Path(folder) / "out").glob("*.json"))]


def scenario(n: Number) -> Any:
    config = s2.ScenarioConfig(room={"side": n(9)}, goal={"min_distance": n(2)}, rules={"time_limit": n(2)}, humans=2)
    return config, document(s2.StraightToGoal(), s2.generate(config, seed=1))


def interval(n: Number) -> Any:
    values = np.array([n(k) for k in (1, 2, 2, 5)])
    return s2m.bootstrap_interval(values), s2m.summarise([n(k) for k in (1, 2, 2, 5)])


def picture(subject: Callable[[], Any], n: Number) -> bytes:
    return saved(lambda path: subject().save(path, scale=n(40)), ".png")


def film(subject: Callable[[], Any], n: Number) -> bytes:
    return saved(lambda path: subject().save(path, scale=n(20), fps=n(5), speed=n(4)), ".gif")


def study(n: Number) -> Any:
    return StudyConfig.model_validate(
        {"title": "t", "runs": [{"scenario": "empty"}], "minimum_length": n(2)}
    ).minimum_length


def split(n: Number) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        dataset = s2.generate_dataset(folder, "empty", episodes=3, seed=1)
        parts = dataset.split({"train": n(2), "test": n(1)})
        dataset.save(Path(folder) / "film.gif", fps=n(5), speed=n(8))
        film = (Path(folder) / "film.gif").read_bytes()
        return (Path(folder) / "manifest.json").read_bytes(), sorted(parts), film


# By name: calls with numbers in the places of floats.
CASES: dict[str, Callable[[Number], Any]] = {
    "sonata2d.benchmark.RatingModel": lambda n: (
        RatingModel("?", 40, 2, n(1), ("psc", "stl"), (n(1), n(2)), (n(2), n(3)), (n(1), n(2)), n(1)),
        RatingModel("?", 40, 2, 0.5, ("psc",), (n(1),), (n(2),), (n(1),), n(1))({"psc": 1.0}),
    ),
    "sonata2d.benchmark.Sensing": lambda n: (
        Perception(scene(), Sensing(n(2), n(5), noise=n(1), velocity_noise=n(1)))
        .state(snapshot_of(scene()))[0]
        .row.tolist()
    ),
    "sonata2d.HumanLike": lambda n: document(s2.HumanLike(delay=n(1), lag=n(1), noise=n(1))),
    "sonata2d.SocialPlanner": lambda n: document(s2.SocialPlanner(Weights(*(n(2) for _ in fields(Weights))))),
    "sonata2d.StraightToGoal": lambda n: document(s2.StraightToGoal(n(1), n(3))),
    "sonata2d.SocialForce": lambda n: document(s2.SocialForce(n(1), n(3))),
    "sonata2d.Orca": lambda n: document(s2.Orca(n(1), n(3))),
    "sonata2d.Twist": lambda n: document(Driving(n)),
    "sonata2d.Pose": lambda n: (s2.Pose(n(1), n(2), n(1)).rounded(), s2.Pose(n(1), n(2)).to_world((n(3), n(4)))),
    "sonata2d.Pose.to_local": lambda n: s2.Pose(1.0, 2.0, 0.5).to_local((n(3), n(4))),
    "sonata2d.Pose.to_world": lambda n: s2.Pose(1.0, 2.0, 0.5).to_world((n(3), n(4))),
    "sonata2d.PersonKind": lambda n: s2.PersonKind(
        "runner", breadth=(n(1), n(1)), length=(n(2), n(3)), desired_speed=(n(3), n(1), n(2), n(4)), headway=n(1)
    ),
    "sonata2d.FurnitureType": lambda n: s2.FurnitureType("sofa", (n(2), n(1)), clearance=n(1)),
    "sonata2d.Dataset.save": lambda n: split(n)[2],
    "sonata2d.Scene": lambda n: (scene_of(n), document(s2.SocialPlanner(), scene_of(n))),
    **dict.fromkeys(("sonata2d.Door", "sonata2d.Queue", "sonata2d.Place"), scene_of),
    "sonata2d.InteriorDoor": lambda n: document(s2.SocialPlanner(), with_door(n)),
    "sonata2d.InteriorDoor.leaf": lambda n: with_door(float).interior_doors[0].leaf(n(1)),
    "sonata2d.Scene.attributes_at": lambda n: (
        replace(scene(), areas=(Area("bay", ((n(2), n(1)), (n(9), n(1)), (n(9), n(9))), attributes={"quiet": True}),))
        .attributes_at(
            [AttributeColumn(AttributeSpec("areas", "quiet", "yes_no"))], np.array([(n(5), n(2)), (n(1), n(1))])
        )
        .tolist()
    ),
    "sonata2d.Scene.is_on_floor": lambda n: scene().is_on_floor(np.array([(n(3), n(4)), (n(40), n(4))])).tolist(),
    "sonata2d.Scene.save": lambda n: picture(scene, n),
    "sonata2d.Snapshot.save": lambda n: picture(lambda: snapshots()[3], n),
    "sonata2d.EpisodeRecord.save": lambda n: film(record, n),
    "sonata2d.Episode.save": lambda n: picture(lambda: s2.Episode(scene(), s2.StraightToGoal()), n),
    "sonata2d.Episode.apply": lambda n: s2.Episode(scene(), s2.StraightToGoal()).apply(s2.Twist(n(1), n(0), n(1))),
    "sonata2d.Dataset.split": split,
    "sonata2d.datasets.split_dataset": split,
    "sonata2d.check_controller": lambda n: s2.check_controller(s2.StraightToGoal(), time_limit=n(1)),
    "sonata2d.testing.default_scenes": lambda n: s2t.default_scenes(n(3)),
    "sonata2d.agents.DeviceMapping": lambda n: s2a.DeviceMapping({"w": ("ahead", n(1))}, n(0), n(1)).settings(),
    "sonata2d.agents.DeviceMapping.read": lambda n: mapping().read({"w": n(1), "left_x": n(1), "left_y": n(0)}),
    "sonata2d.agents.DeviceMapping.shape_stick": lambda n: mapping().shape_stick(n(1), n(0)),
    "sonata2d.record.with_pose_noise": lambda n: s2r.with_pose_noise(
        s2r.motion_of(record()), 3, position=n(1), angle=n(1)
    ),
    "sonata2d.formats.Options": recording,
    "sonata2d.formats.scenario_from_tracks": recording,
    "sonata2d.gym.demonstrate": lambda n: s2g.demonstrate(
        s2g.SocialNavEnv("empty"), s2.StraightToGoal(), seed=1, episodes=1, noise=n(1)
    ),
    "sonata2d.gym.Column": bounds_of_part,
    "sonata2d.gym.CrowdNav": lambda n: reward(s2g.CrowdNav, n),
    "sonata2d.gym.Distance": lambda n: reward(s2g.Distance, n),
    "sonata2d.gym.Dsrnn": lambda n: reward(s2g.Dsrnn, n),
    "sonata2d.gym.SocNavGym": lambda n: reward(s2g.SocNavGym, n),
    "sonata2d.agents.Mppi": lambda n: s2a.Mppi(64, n(1)).settings(),
    "sonata2d.agents.Drive": lambda n: Differential(n(1), n(2), n(3)),
    "sonata2d.agents.Drive.memory_of": lambda n: Bicycle.memory_of(np.array([n(1)]), np.array([n(1), n(0), n(1)])),
    "sonata2d.agents.Camera": lambda n: s2a.Camera(rate=n(2), latency=n(1), view_range=n(3)),
    "sonata2d.agents.FieldOfView": lambda n: s2a.FieldOfView("view", n(2), n(5), rate=n(2), latency=n(1)),
    "sonata2d.agents.Lidar": lambda n: s2a.Lidar(
        "scan", 8, n(3), n(5), n(0), (n(1), n(0)), n(1), n(0), n(0), rate=n(2), latency=n(1)
    ),
    "sonata2d.agents.Odometry": lambda n: s2a.Odometry("odometry", n(0), n(1), n(0), n(1), rate=n(2), latency=n(1)),
    "sonata2d.agents.PeopleDetector": lambda n: s2a.PeopleDetector(
        "people", n(2), n(5), True, n(0), n(1), rate=n(2), latency=n(1)
    ),
    "sonata2d.agents.costmap": lambda n: s2a.costmap(scan(), n(4), n(1), n(1), n(2), n(1)),
    "sonata2d.gym.Sparse": lambda n: reward(s2g.Sparse, n),
    "sonata2d.gym.SocialNavEnv.action_of": lambda n: env().action_of(s2.Twist(n(1), n(0), n(1))),
    "sonata2d.gym.DiscreteActions": lambda n: (
        s2g.DiscreteActions(env(), moves=[(n(1), n(0), n(1))]).action(0),
        describe(s2g.DiscreteActions(env(), moves=[(n(1), n(0), n(1))]))["wrappers"],
    ),
    "sonata2d.gym.FieldOfView": lambda n: steps(lambda env: s2g.FieldOfView(env, n(2), n(3))),
    "sonata2d.gym.Lidar": lambda n: steps(lambda env: s2g.Lidar(env, distance=n(3))),
    "sonata2d.gym.Noise": lambda n: steps(lambda env: s2g.Noise(env, n(1), n(1), n(1))),
    "sonata2d.learning.GraphSamples": lambda n: s2l.GraphSamples(every=n(1), interval=n(1)),
    "sonata2d.learning.graph.save_graph": lambda n: saved(
        lambda path: s2lg.save_graph(path, s2lg.modern_graph(record(), 5), dt=n(1)), ".png"
    ),
    "sonata2d.learning.graph.modern_graph": lambda n: s2lg.modern_graph(record(), 15, interval=n(1)),
    "sonata2d.learning.graph.kept_ticks": lambda n: s2lg.kept_ticks(np.array([n(k) for k in range(9)]), n(2)),
    "sonata2d.metrics.bootstrap_interval": interval,
    "sonata2d.metrics.summarise": interval,
    "sonata2d.study.StudyConfig": study,
    "sonata2d.view.between": lambda n: [s2v.between(*snapshots()[3:5], n(k)) for k in (0, 1)],
    "sonata2d.view.Painter.draw": painted,
    "sonata2d.view.Trails": trails,
    **{
        f"sonata2d.view.Camera{method}": camera
        for method in ("", ".behind", ".fit", ".rotated", ".to_pixels", ".to_world", ".zoomed")
    },
    "sonata2d.view.Still": lambda n: s2v.Still(snapshots()[3], scale=n(40)).camera,
    "sonata2d.view.scene_picture": lambda n: s2v.scene_picture(scene(), scale=n(40)).get_size(),
    "sonata2d.view.render": lambda n: film(record, n),
    "sonata2d.view.save_film": lambda n: film(record, n),
    "scenario": scenario,
}

# Values that sonata2d makes, or passes to methods of subclasses; and numbers between 0 and 1.
MADE = {
    "sonata2d.benchmark.AltModel",
    "sonata2d.benchmark.Suite",
    "sonata2d.agents.Costmap",
    "sonata2d.agents.Sensor",
    "sonata2d.gym.WorldsStep",
    "sonata2d.EpisodeRecord",
    "sonata2d.Frame",
    "sonata2d.Scene.for_paths",
    "sonata2d.Outcome",
    "sonata2d.Snapshot",
    "sonata2d.workers.DaskExecutor",
    "sonata2d.record.Motion",
    "sonata2d.learning.graph.Graph",
    "sonata2d.metrics.Certificate",
    "sonata2d.metrics.Difficulty",
    "sonata2d.metrics.Interval",
    "sonata2d.metrics.Measured",
    "sonata2d.metrics.Summary",
    "sonata2d.metrics.Trajectory",
    "sonata2d.metrics.wilson_interval",
    "sonata2d.study.Participant.rate",
    "sonata2d.window.Screen.advance",
}


def plain(value: Any) -> Any:
    """The value with the types of its numbers and arrays."""
    if isinstance(value, np.ndarray):
        return str(value.dtype), value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return type(value).__name__, {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {key: plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return repr(float(value)) if isinstance(value, float | np.floating) else value


@cache
def expected(name: str) -> Any:
    return plain(CASES[name](float))


@pytest.mark.parametrize("number", TYPES, ids=lambda number: number.__name__)
@pytest.mark.parametrize("name", CASES)
def test_numbers_of_other_types_give_the_results_of_floats(name: str, number: Number) -> None:
    assert plain(CASES[name](number)) == expected(name)


@pytest.mark.parametrize("name", CASES)
def test_truth_values_are_refused_or_give_the_results_of_0_and_1(name: str) -> None:
    try:
        found = CASES[name](bool)
    except (TypeError, ValueError, ConfigError, RenderError):  # also that 1 is too small a number here
        return
    assert plain(found) == plain(CASES[name](lambda value: float(bool(value))))


def public_functions() -> Iterator[tuple[str, Any]]:
    """All public classes and functions, and own methods of the classes, with their names."""
    root = Path(s2.__file__).parent
    seen = set()
    for stub in sorted(root.rglob("__init__.pyi")):
        package = ".".join(("sonata2d", *stub.parent.relative_to(root).parts))
        module = importlib.import_module(package)
        imports = [node for node in ast.walk(ast.parse(stub.read_text())) if isinstance(node, ast.ImportFrom)]
        for alias in (alias for node in imports for alias in node.names):
            public = getattr(module, alias.asname or alias.name)
            if not callable(public) or id(public) in seen:
                continue
            seen.add(id(public))
            found = {f"{package}.{alias.asname}": public}
            if inspect.isclass(public):
                found |= {f"{package}.{alias.asname}.{name}": method for name, method in own_methods(public)}
            yield from found.items()


def public_floats() -> Iterator[str]:
    """Names of the public classes, functions and own methods with an argument that holds floats."""
    for name, function in public_functions():
        if any(FLOATS.search(str(p.annotation)) for p in parameters(function)):
            yield name


def settings_with_floats() -> Iterator[type]:
    """Dataclasses with fields of floats that arguments of public functions are instances of."""
    for _, function in public_functions():
        names = vars(importlib.import_module(function.__module__)) if hasattr(function, "__module__") else {}
        for word in re.findall(r"\w+", " ".join(str(p.annotation) for p in parameters(function))):
            kind = names.get(word)
            if isinstance(kind, type) and is_dataclass(kind) and any(FLOATS.search(str(f.type)) for f in fields(kind)):
                yield kind


def own_methods(public: type) -> Iterator[tuple[str, Any]]:
    for name in vars(public):
        inherited = hasattr(KernelController, name) or name == "kernel"  # sonata2d calls it
        if not name.startswith("_") and not inherited and callable(method := getattr(public, name)):
            yield name, method


def parameters(function: Any) -> list[inspect.Parameter]:
    try:
        return [*inspect.signature(function).parameters.values()]
    except (TypeError, ValueError):  # a class without a signature
        return []


FLOATS = re.compile(r"\b(float|Number|Positive|NotNegative|Fraction|Point|Pose|Twist|Array)\b")


def test_every_public_float_has_a_case() -> None:
    assert set(public_floats()) - CASES.keys() - MADE == set()


def test_every_dataclass_with_floats_makes_them_floats_or_has_a_case() -> None:
    names = {name.rpartition(".")[2] for name in (*CASES, *MADE)} | set(re.findall(r"\w+", str(fields(s2.Scene))))
    others = {kind.__name__ for kind in settings_with_floats() if not issubclass(kind, FloatFields)} - names
    # the first makes floats itself, sonata2d makes the others
    assert others == {
        "DeviceEvent", "DoorState", "Humans", "LidarReading", "OdometryReading", "RobotState", "States", "TickInput",
    }  # fmt: skip


def test_options_of_formats_are_floats() -> None:
    assert type(Options(frame_time=1).frame_time) is float
