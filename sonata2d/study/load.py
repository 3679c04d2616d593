"""Study files in YAML, JSON or TOML. Errors name file, line, key and value."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from ..collect.session import warm_up
from ..collect.texts import languages, read_table, table
from ..core.labels import LabelSpec
from ..datasets.manifest import files_of
from ..errors import ConfigError, SceneError, Sonata2dError
from ..record.files import sha256_of
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.load import load_scenario, preset_names, validated
from ..scenegen.scenario.parse import line_of, parse_settings
from .config import LabelTexts, RatingConfig, StudyConfig
from .markdown import Picture, path_of, picture_at, pictures_in
from .questions import question_kind
from .texts import texts_in

_SCENES_PER_BLOCK = 10_000  # distance between the scene numbers of two blocks of runs
_QUESTIONS = {"demographics", "check", "after_run", "end"}  # sections of questionnaires
_MAX_ATTEMPTS = 50  # consecutive scenes of a scenario that cannot be generated before it is an error

T = TypeVar("T")


@dataclass(frozen=True)
class Study:
    """A study file with the scenarios, recorded runs and tables that it names.

    Attributes:
        path: of the study file.
        config: its settings.
        sha256: hash of the file.
        scenarios: scenario of each block of runs.
        practice: scenario of the practice; None without one.
        rated: the runs to be rated, of each block of ratings.
        tables: words of the page, by language and `section.key`.
        pictures: the picture files in texts, by their source in Markdown.
    """

    path: Path
    config: StudyConfig
    sha256: str
    scenarios: tuple[ScenarioConfig, ...]
    practice: ScenarioConfig | None
    rated: tuple[tuple[Path, ...], ...]
    tables: dict[str, dict[str, str]]
    pictures: dict[str, Picture]
    _numbers: dict[int, list[int]] = field(default_factory=dict, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    def scene_number(self, block: int, k: int) -> int:
        """Number of the k-th scene of a block of runs; scenes that cannot be generated are left out.

        The scenes of block b are numbered from 10 000 b, and the scenes of the practice from 10 000 times the number of
        blocks, so that the number of a scene identifies its block.

        Raises:
            SceneError: too many scenes in a row cannot be generated.
        """
        numbers = self._numbers.setdefault(block, [])
        if k < len(numbers):  # without the lock, which another participant may hold for long
            return numbers[k]
        with self._lock:
            while len(numbers) <= k:
                start = numbers[-1] + 1 if numbers else block * _SCENES_PER_BLOCK
                numbers.append(self._next_number(block, start))
            return numbers[k]

    @property
    def number_of_scenes(self) -> int:
        """Number of different scenes, including the practice."""
        return sum(self._scenes_of_blocks)

    @property
    def _scenes_of_blocks(self) -> list[int]:
        """Number of scenes of each block of runs, and of the practice."""
        practice = self.config.practice
        return [block.runs for block in self.config.runs] + ([practice.runs] if practice else [])

    def check_scenes(self, advance: Callable[[int], None] = lambda count: None) -> None:
        """Generate each scene once, so that a scene that cannot be generated is replaced before a participant comes.

        Args:
            advance: called with 1 after each scene.

        Raises:
            SceneError: too many scenes in a row cannot be generated.
        """
        for block, runs in enumerate(self._scenes_of_blocks):
            for k in range(runs):
                self.scene_number(block, k)
                advance(1)

    def warm_up(self) -> None:
        """Compile or load the kernels that each scenario needs, so that no participant waits for them.

        Raises:
            SceneError: too many scenes in a row cannot be generated.
        """
        for block in range(len(self._scenes_of_blocks)):
            warm_up(generate(self.config_of(block), self.config.seed, self.scene_number(block, 0)))

    def config_of(self, block: int) -> ScenarioConfig:
        """Scenario of a block of runs; the block after the last one is the practice."""
        if block < len(self.scenarios):
            return self.scenarios[block]
        assert self.practice is not None
        return self.practice

    def _next_number(self, block: int, start: int) -> int:
        """The first number, from `start` on, whose scene can be generated."""
        error: SceneError | None = None
        for number in range(start, start + _MAX_ATTEMPTS):
            try:
                generate(self.config_of(block), self.config.seed, number)
            except SceneError as problem:
                error = problem
            else:
                return number
        raise SceneError(f"{self.config_of(block).name}: {_MAX_ATTEMPTS} scenes in a row fail: {error}")


def load_study(path: str | Path) -> Study:
    """Load a study file, and the scenarios and recorded runs that it names.

    Raises:
        ConfigError: the file, or something that it refers to, is invalid; one line with file, line, key and value.
    """
    path = Path(path)
    config = validated(StudyConfig, parse_settings(path, "study"), path)

    def resolved(load: Callable[..., T], *arguments: Any, keys: list[int | str]) -> T:
        """Load the file that a setting names; errors name the place of the setting."""
        try:
            return load(*arguments)
        except (Sonata2dError, OSError, ValueError) as error:
            key = ".".join(map(str, keys))
            raise ConfigError(f"{path.name}{line_of(path, keys)}: {key}: {error}") from None

    scenarios = []
    for k, block in enumerate(config.runs):
        scenarios.append(resolved(_scenario, path, block.scenario, keys=["runs", k, "scenario"]))
        resolved(_check_label, block.label, scenarios[k].label, config, keys=["runs", k, "label"])
    longest = min((scenario.rules.time_limit for scenario in scenarios), default=config.minimum_length)
    if config.minimum_length > longest:
        raise ConfigError(
            f"{path.name}{line_of(path, ['minimum_length'])}: minimum_length is {config.minimum_length:g} s, but the"
            f" runs of a scenario end after {longest:g} s"
        )
    for scenario in scenarios:
        limits = scenario.robot.limits
        farthest = scenario.rules.time_limit * max(limits.ahead, limits.back, limits.sideways)
        if config.minimum_distance > farthest:
            raise ConfigError(
                f"{path.name}{line_of(path, ['minimum_distance'])}: minimum_distance is {config.minimum_distance:g} m,"
                f" but the robot of {scenario.name} goes {farthest:g} m at most in the time of a run"
            )
    practice = None
    if config.practice is not None:
        practice = resolved(_scenario, path, config.practice.scenario, keys=["practice", "scenario"])
    rated = tuple(
        resolved(_rated, path, block, keys=["ratings", k, "folder"]) for k, block in enumerate(config.ratings)
    )
    tables = {}
    for language in config.languages:
        place: list[int | str] = ["texts", language] if language in config.texts else ["languages"]
        tables[language] = resolved(_table, path, config, language, keys=place)
    pictures: dict[str, Picture] = {}
    for keys, text in texts_in(config):
        if not _QUESTIONS.isdisjoint(keys) or not {"text", "statements"}.intersection(keys):  # these are no Markdown
            continue
        for words in [text] if isinstance(text, str) else text.values():
            for source in pictures_in(words):
                pictures[source] = resolved(picture_at, path.parent / path_of(source), keys=[*keys])
    return Study(path, config, sha256_of(path), tuple(scenarios), practice, rated, tables, pictures)


def _scenario(path: Path, name: str) -> ScenarioConfig:
    return load_scenario(name if name in preset_names() else path.parent / name)


def _check_label(texts: LabelTexts, spec: LabelSpec, config: StudyConfig) -> None:
    """Require that translations fit the question that the scenario asks."""
    if spec.kind == "command":
        if texts != LabelTexts():
            raise ConfigError("the scenario asks no question (label.kind is 'command'); remove label")
        return
    needed = question_kind(spec.kind).translated
    for key, translations in (("classes", texts.classes), ("ends", texts.ends)):
        if translations and key not in needed:
            raise ConfigError(f"the scenario asks a question of kind {spec.kind}, which has no {key}; remove {key}")
        for language in translations:
            if language not in config.languages:
                raise ConfigError(f"{language!r} is not among the languages of the study")
    for language, classes in texts.classes.items():
        if len(classes) != len(spec.classes):
            raise ConfigError(f"{len(classes)} classes in {language!r} for {len(spec.classes)} of the scenario")
    if len(config.languages) > 1:
        # The question is one text by language, which `StudyConfig` has checked; the others are lists by language.
        has = {"question": texts.question is not None}
        has |= {key: set(getattr(texts, key)) == set(config.languages) for key in ("classes", "ends")}
        missing = [key for key in needed if not has[key]]
        if missing:
            raise ConfigError(f"the scenario asks its question in one language; give {', '.join(missing)} in each")


def _rated(path: Path, block: RatingConfig) -> tuple[Path, ...]:
    """The recorded runs of a block of ratings."""
    files = tuple(files_of(path.parent / block.folder))
    if block.count is not None and block.count > len(files):
        raise ConfigError(f"count is {block.count}, but {block.folder} has {len(files)} episodes")
    return files[: block.count]


def _table(path: Path, config: StudyConfig, language: str) -> dict[str, str]:
    """The words of the page in a language; in English where the table lacks a word."""
    if language in config.texts:
        return table("en") | read_table(path.parent / config.texts[language])
    if language not in languages():
        known = ", ".join(languages())
        raise ConfigError(f"sonata2d has no words in {language!r} (it has {known}); name a table under texts")
    return table("en") | table(language)
