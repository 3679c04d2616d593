"""Loading of study files: YAML, JSON or TOML. Errors name file, line, key and value."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from ..collect.session import warm_up
from ..collect.texts import languages, read_table, table
from ..core.labels import LabelSpec
from ..datasets.manifest import files_of
from ..errors import ConfigError, SceneError, Sonata2dError
from ..record.files import sha256_of
from ..scenegen.generator import generate
from ..scenegen.scenario.config import ScenarioConfig
from ..scenegen.scenario.load import load_scenario, preset_names
from ..scenegen.scenario.parse import line_of, parse_settings
from ..scenegen.scenario.problems import problem_of
from .config import LabelTexts, QuestionConfig, RatingConfig, StudyConfig, in_language

SCENES_PER_BLOCK = 10_000  # distance between the scene numbers of two blocks of runs
_MAX_ATTEMPTS = 50  # consecutive scenes of a scenario that cannot be generated before it is an error

T = TypeVar("T")


@dataclass(frozen=True)
class Study:
    """A study with what its file refers to.

    Attributes:
        path: of the study file.
        config: its settings.
        sha256: hash of the file.
        scenarios: scenario of each block of runs.
        practice: scenario of the practice; None without one.
        rated: the runs to be rated, of each block of ratings.
        tables: the page's own words, by language and `section.key`.
    """

    path: Path
    config: StudyConfig
    sha256: str
    scenarios: tuple[ScenarioConfig, ...]
    practice: ScenarioConfig | None
    rated: tuple[tuple[Path, ...], ...]
    tables: dict[str, dict[str, str]]
    _numbers: dict[int, list[int]] = field(default_factory=dict, repr=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    def scene_number(self, block: int, k: int) -> int:
        """Number of the k-th scene of a block of runs; scenes that cannot be generated are left out.

        The scenes of block b are numbered from 10 000 b, and those of the practice from 10 000 times the number of
        blocks, so that the number of a scene tells its block.

        Raises:
            SceneError: too many scenes in a row cannot be generated.
        """
        numbers = self._numbers.setdefault(block, [])
        if k < len(numbers):  # without waiting for a scene that another participant needs
            return numbers[k]
        with self._lock:
            while len(numbers) <= k:
                start = numbers[-1] + 1 if numbers else block * SCENES_PER_BLOCK
                numbers.append(self._next_number(block, start))
            return numbers[k]

    @property
    def number_of_scenes(self) -> int:
        """Number of different scenes, those of the practice included."""
        return sum(self._scenes_of_blocks)

    @property
    def _scenes_of_blocks(self) -> list[int]:
        """Number of scenes of each block of runs, and of the practice."""
        practice = self.config.practice
        return [block.runs for block in self.config.runs] + ([practice.runs] if practice else [])

    def check_scenes(self, advance: Callable[[int], None] = lambda count: None) -> None:
        """Generate each scene once, so that no participant meets one that cannot be generated.

        Args:
            advance: called with the number of scenes that were generated since the last call.

        Raises:
            SceneError: too many scenes in a row cannot be generated.
        """
        for block, runs in enumerate(self._scenes_of_blocks):
            for k in range(runs):
                self.scene_number(block, k)
                advance(1)

    def warm_up(self) -> None:
        """Compile or load what the simulation of each scenario needs, so that no participant waits for it.

        Raises:
            SceneError: too many scenes in a row cannot be generated.
        """
        for block in range(len(self._scenes_of_blocks)):
            warm_up(generate(self.config_of(block), self.config.seed, self.scene_number(block, 0)))

    def config_of(self, block: int) -> ScenarioConfig:
        """Scenario of a block of runs; the one after the last block is the practice."""
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
    settings = parse_settings(path, "study")
    try:
        config = StudyConfig.model_validate(settings)
    except ValidationError as error:
        keys, text = problem_of(settings, error)
        raise ConfigError(f"{path.name}{line_of(path, keys)}: {text}") from None

    def resolved(keys: list[int | str], load: Callable[[], T]) -> T:
        """What a setting refers to; errors name its place."""
        try:
            return load()
        except (Sonata2dError, OSError, ValueError) as error:
            key = ".".join(map(str, keys))
            raise ConfigError(f"{path.name}{line_of(path, keys)}: {key}: {error}") from None

    scenarios = tuple(
        resolved(["runs", k, "scenario"], lambda block=block: _scenario(path, block.scenario))  # type: ignore[misc]
        for k, block in enumerate(config.runs)
    )
    for k, (block, scenario) in enumerate(zip(config.runs, scenarios, strict=True)):
        resolved(["runs", k, "label"], lambda b=block, s=scenario: _check_label(b.label, s.label, config))  # type: ignore[misc]
    longest = min((scenario.rules.time_limit for scenario in scenarios), default=config.minimum_length)
    if config.minimum_length > longest:
        raise ConfigError(
            f"{path.name}{line_of(path, ['minimum_length'])}: minimum_length is {config.minimum_length:g} s, but the"
            f" runs of a scenario end after {longest:g} s"
        )
    practice = None
    if config.practice is not None:
        name = config.practice.scenario
        practice = resolved(["practice", "scenario"], lambda: _scenario(path, name))
    rated = tuple(
        resolved(["ratings", k, "folder"], lambda block=block: _rated(path, block))  # type: ignore[misc]
        for k, block in enumerate(config.ratings)
    )
    tables = {
        language: resolved(
            ["texts", language] if language in config.texts else ["languages"],
            lambda language=language: _table(path, config, language),  # type: ignore[misc]
        )
        for language in config.languages
    }
    return Study(path, config, sha256_of(path), scenarios, practice, rated, tables)


def spec_of(question: QuestionConfig, language: str) -> LabelSpec:
    """The label that corresponds to a question of kind `yes_no`, `classes`, `slider` or `text`."""
    settings: dict[str, Any] = {"kind": question.kind, "when": "run", "name": question.name}
    settings["question"] = in_language(question.question, language)
    if question.classes is not None:
        settings["classes"] = tuple(in_language(name, language) for name in question.classes)
    if question.ends is not None:
        settings["ends"] = tuple(in_language(end, language) for end in question.ends)
    return LabelSpec(**settings)


def order_key(*parts: object) -> bytes:
    """A key that sorts pseudo-randomly, and is the same on every machine."""
    return hashlib.sha256("/".join(map(str, parts)).encode()).digest()


def _scenario(path: Path, name: str) -> ScenarioConfig:
    return load_scenario(name if name in preset_names() else path.parent / name)


def _check_label(texts: LabelTexts, spec: LabelSpec, config: StudyConfig) -> None:
    """Require that translations fit the question that the scenario asks."""
    if not spec.per_run and not spec.per_frame:
        if texts != LabelTexts():
            raise ConfigError("the scenario asks no question (label.kind is 'command'); remove label")
        return
    for language, classes in texts.classes.items():
        if len(classes) != len(spec.classes):
            raise ConfigError(f"{len(classes)} classes in {language!r} for {len(spec.classes)} of the scenario")
    if texts.ends and spec.kind != "slider":
        raise ConfigError("the scenario asks no slider question; remove ends")
    for language in (*texts.classes, *texts.ends):
        if language not in config.languages:
            raise ConfigError(f"{language!r} is not among the languages of the study")
    if len(config.languages) > 1:
        needed = {"question": texts.question is not None}
        needed |= {"classes": set(texts.classes) == set(config.languages)} if spec.classes else {}
        needed |= {"ends": set(texts.ends) == set(config.languages)} if spec.kind == "slider" else {}
        missing = [key for key, is_given in needed.items() if not is_given]
        if missing:
            raise ConfigError(f"the scenario asks its question in one language; give {', '.join(missing)} in each")


def _rated(path: Path, block: RatingConfig) -> tuple[Path, ...]:
    """The recorded runs of a block of ratings."""
    files = tuple(files_of(path.parent / block.folder))
    if block.count is not None and block.count > len(files):
        raise ConfigError(f"count is {block.count}, but {block.folder} has {len(files)} episodes")
    return files[: block.count]


def _table(path: Path, config: StudyConfig, language: str) -> dict[str, str]:
    """The page's own words in a language; English where a table has none."""
    if language in config.texts:
        return table("en") | read_table(path.parent / config.texts[language])
    if language not in languages():
        known = ", ".join(languages())
        raise ConfigError(f"sonata2d has no words in {language!r} (it has {known}); name a table under texts")
    return table("en") | table(language)
