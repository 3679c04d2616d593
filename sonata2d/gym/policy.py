"""Policies that were trained in the environment, as controllers."""

from __future__ import annotations

import hashlib
import json
import logging
import pickle
from collections.abc import Callable, Mapping
from contextlib import suppress
from inspect import signature
from pathlib import Path
from typing import Any, Self

import gymnasium
import numpy as np

from ..agents.controllers.learned import LearnedController
from ..core.files.archives import read_npz
from ..core.files.limits import MAX_FILE_BYTES, MAX_WEIGHTS_BYTES
from ..core.files.reading import read_at_most
from ..core.geometry import Twist
from ..core.scene import Scene
from ..core.snapshot import Snapshot
from ..core.wording import described, one_line, shown
from ..errors import ControllerError, RecordError
from ..record.files import read_bytes
from .description import describe, environment_of, parts_read, require_parts
from .env import Env
from .mlp import Mlp, read_mlp
from .pipeline import Pipeline
from .wrappers import shape_of

Predict = Callable[[Any], Any]
METADATA_KEY = "sonata2d_environment"  # of an .onnx file; its value is the description of the environment


class PolicyController(LearnedController):
    """Drives with a policy that was trained in the environment.

    Args:
        policy: a file of `save_policy` (.npz or .onnx), a file of Stable-Baselines3 (.zip, needs `trust`), an object
            with a method `predict` such as a model of Stable-Baselines3, a PyTorch module, which is put into evaluation
            mode, or a function of an observation that returns an action.
        env: in which it was trained, with its wrappers; may be left out for a file of `save_policy`, which contains
            the description. If it has wrappers of observations or actions of other packages, it must not be stepped
            while this controller drives.
        normalisation: of the observations of a model or a PyTorch module: mean and standard deviation of the numbers of
            the observation, or the path of an .npz file with the arrays `mean`, `deviation` and, optionally, `clip`,
            the limit of the normalised numbers; False: none. Of a model also the `VecNormalize` of the training, or the
            path of the file to which it was saved (.pkl, needs `trust`). None: the `VecNormalize` of the model's
            environment, if any; a model that was loaded from a file has none, and a warning says so. A file of
            `save_policy` contains it.
        trust: whether to load pickled files, .zip and .pkl, which run the code in them: only for files whose origin is
            trusted. Files in .npz and .onnx are data.

    Raises:
        ControllerError: a file cannot be read, or is pickled and not trusted, or the policy was trained with other
            observations or actions, or with other versions of the parts of the observation.
        TypeError: the environment is missing, or not one of sonata2d, or a normalisation is given for a policy that is
            not a model.

    Example:
        >>> import sonata2d as s2, sonata2d.gym
        >>> env = sonata2d.gym.SocialNavEnv("empty")
        >>> straight = sonata2d.gym.PolicyController(lambda observation: [1.0, 0.0, observation["goal"][1]], env)
        >>> s2.Episode(s2.generate(s2.load_scenario("empty"), seed=1), straight).run().status
        'goal'
    """

    version = "1"

    def __init__(self, policy: Any, env: Env | None = None, *, normalisation: Any = None, trust: bool = False) -> None:
        self._path = self._sha256 = None
        self.deterministic = False
        description: Mapping[str, Any] | None = None
        if isinstance(policy, (str, Path)):
            self._path, path = str(policy), Path(policy).absolute()
            policy, description = _load(path, trust=trust)
            self._sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
            self.deterministic = path.suffix == ".npz"  # other files run in libraries whose rounding may differ
        try:
            if env is None:  # the file says what the policy observes
                if description is None:
                    raise TypeError("the policy does not say what it observes; give PolicyController(policy, env)")
                env = environment_of(description)
            else:
                if description is not None:  # the parts may have changed since the file was written
                    require_parts(description, env)
                with suppress(TypeError):  # of a wrapper of another package
                    env = environment_of(describe(env))  # so that both can be used at the same time
        except ValueError as error:
            raise ControllerError(f"{self._path} cannot be used: {error}") from error
        self._pipeline, self._parts_read, self._has_warned = Pipeline(env), parts_read(env), False
        is_discrete = isinstance(env.action_space, gymnasium.spaces.Discrete)
        self._predict = _predict_of(policy, normalisation, is_discrete=is_discrete, trust=trust)
        self._require_spaces(env)

    def settings(self) -> dict[str, Any]:
        """Return the path and the hash of the file, if there is one."""
        return {} if self._path is None else super().settings()

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], *, weights: str | None = None) -> Self:
        path = weights or settings.get("weights")
        if path is None or Path(path).suffix == ".zip":
            origin = "was not loaded from a file" if path is None else f"is in {path}, which lacks its observations"
            raise ControllerError(
                f"the policy {origin}, so it cannot be created again; files of sonata2d.gym.save_policy can"
            )
        return super().from_settings(settings, weights=weights)

    def reset(self, scene: Scene) -> None:
        """Begin an episode.

        Raises:
            ControllerError: the robot has another drive than in the training.
        """
        trained = self._pipeline.base.config.robot.kinematics
        if scene.robot.kinematics != trained:
            raise ControllerError(
                f"the policy was trained with a {trained} robot, the robot of the scene is {scene.robot.kinematics}; "
                "set robot.kinematics of the scenario"
            )
        self._warn_of_hidden(scene)
        self._pipeline.begin()
        if isinstance(self._predict, Model):
            self._predict.begin()

    def act(self, snapshot: Snapshot) -> Twist:
        return self._pipeline.twist(self._predict(self._pipeline.observe(snapshot)))

    def _require_spaces(self, env: Env) -> None:
        """Require that a model or perceptron was trained with the observations and actions of the environment.

        Raises:
            ControllerError: their spaces differ.
        """
        if isinstance(self._predict, Mlp):
            width, numbers = len(self._predict.mean), np.prod(env.observation_space.shape or ())
            if not isinstance(env.observation_space, gymnasium.spaces.Box) or width != numbers:
                raise ControllerError(
                    f"the policy reads {width} numbers, the environment has observations of "
                    f"{shape_of(env.observation_space)}; leave out the environment, which the file describes"
                )
            return
        model = self._predict.model if isinstance(self._predict, Model) else self._predict
        for name in ("observation_space", "action_space"):
            trained, present = getattr(model, name, None), getattr(env, name)
            if trained is not None and shape_of(trained) != shape_of(present):
                raise ControllerError(
                    f"the policy was trained with {name}s of {one_line(shape_of(trained), 100)}, the environment has "
                    f"{one_line(shape_of(present), 100)}; give the environment of the training, with its wrappers"
                )

    def _warn_of_hidden(self, scene: Scene) -> None:
        """Warn, once, if the scene has more entities than the policy observes, and than its training scenes had."""
        for name, count in (("humans", len(scene.humans)), ("objects", len(scene.furniture))):
            base = self._pipeline.base
            rows, trained = (getattr(sizes, name) for sizes in (base.encoder.sizes, base.entities))
            if name in self._parts_read and count > rows >= trained and not self._has_warned:
                self._has_warned = True
                logging.getLogger(__name__).warning(
                    "the policy observes the nearest %d of the %d %s: the scenes of its training had no more",
                    rows, count, name,
                )  # fmt: skip


class Normalisation:
    """Normalisation of observations by numbers: (observation - mean) / deviation, within ±`clip`.

    Args:
        mean, deviation: (n,) each, the mean and standard deviation of the numbers of the observation.
        clip: limit of the normalised numbers.

    Raises:
        TypeError: they are no numbers.
        ValueError: the arrays differ in length, a number is not finite, or a deviation or the limit is not above 0.
    """

    def __init__(self, mean: Any, deviation: Any, clip: Any = np.inf) -> None:
        self.mean, self.deviation = (np.asarray(part, dtype=np.float64).ravel() for part in (mean, deviation))
        self.clip = float(clip)
        if self.mean.shape != self.deviation.shape or not (self.deviation > 0.0).all():
            raise ValueError(
                "mean and deviation of the normalisation have one number for each number of the observation, and "
                f"deviations are above 0; got shapes {self.mean.shape} and {self.deviation.shape}, deviations from "
                f"{self.deviation.min(initial=np.inf):g}"
            )
        if not (np.isfinite(self.mean).all() and np.isfinite(self.deviation).all() and self.clip > 0.0):
            raise ValueError(
                f"the numbers of the normalisation are finite and its limit is above 0, got the limit {clip}"
            )

    def normalize_obs(self, observation: Any) -> Any:
        """The observation of one array, normalised, in its own precision if that is double, else in single precision.

        Raises:
            ControllerError: it has other numbers.
        """
        if isinstance(observation, Mapping) or np.size(observation) != len(self.mean):
            found = "several arrays" if isinstance(observation, Mapping) else np.size(observation)
            raise ControllerError(
                f"the normalisation has {len(self.mean)} numbers, the observation {found}; give the normalisation of "
                "the training"
            )
        array = np.asarray(observation)
        values = np.clip((array.ravel() - self.mean) / self.deviation, -self.clip, self.clip)
        return values.reshape(array.shape).astype(np.float64 if array.dtype == np.float64 else np.float32)


class Model:
    """The actions of a model; a recurrent model keeps its state from one action to the next.

    Args:
        model: has the method `predict` of Stable-Baselines3.
        normalisation: of its observations, of `normalisation_of`.
    """

    def __init__(self, model: Any, normalisation: Any) -> None:
        self.model, self._normalisation = model, normalisation
        self._arguments = signature(model.predict).parameters
        self.begin()

    def begin(self) -> None:
        """Begin an episode."""
        self._state: Any = None
        self._is_first = True

    def __call__(self, observation: Any) -> Any:
        if self._normalisation is not None:
            observation = self._normalisation.normalize_obs(observation)
        known = {"state": self._state, "episode_start": np.array([self._is_first]), "deterministic": True}
        arguments = {name: value for name, value in known.items() if name in self._arguments}
        action, self._state = self.model.predict(observation, **arguments)
        self._is_first = False
        return action


class TorchPolicy:
    """The actions of a PyTorch module.

    Args:
        module: reads observations in one array, (1, n), and returns actions, (1, m), or of a discrete space a number
            for each action.
        normalisation: mean and standard deviation of the observations, (n,) each, or an .npz file, see
            `PolicyController`; None or False: none.
        is_discrete: whether actions are the index of the largest number.

    Raises:
        ControllerError: the file cannot be read.
        TypeError: the normalisation is something else.
        ValueError: as of `Normalisation`.
    """

    def __init__(self, module: Any, normalisation: Any, *, is_discrete: bool) -> None:
        import torch

        self.module, self._is_discrete = module.eval(), is_discrete  # without dropout
        first = next(module.parameters(), torch.zeros(1))
        self._kind: dict[str, Any] = {"device": first.device, "dtype": first.dtype}
        self.normalisation: Normalisation | None = None
        if isinstance(normalisation, (str, Path)):
            self.normalisation = _read_numbers(Path(normalisation))
        elif normalisation is not None and normalisation is not False:
            if not (isinstance(normalisation, tuple | list) and len(normalisation) == 2):
                raise TypeError(
                    f"the normalisation of a PyTorch module is (mean, deviation), got {shown(normalisation)}"
                )
            self.normalisation = Normalisation(*normalisation)

    def begin(self) -> None:
        """Begin an episode; a module has no state."""

    def __call__(self, observation: Any) -> Any:
        import torch

        if isinstance(observation, Mapping):
            raise ControllerError("a PyTorch module reads observations in one array; wrap the environment in Flat")
        flat = np.asarray(observation, dtype=np.float64).ravel()
        if self.normalisation is not None:
            flat = self.normalisation.normalize_obs(flat)
        with torch.no_grad():
            output = self.module(torch.as_tensor(flat, **self._kind)[None])[0].cpu().numpy()
        return int(output.argmax()) if self._is_discrete else np.clip(output, -1.0, 1.0)


def is_torch_module(policy: Any) -> bool:
    """Whether a policy is a PyTorch module, and not a model with the method `predict`."""
    return hasattr(policy, "state_dict") and hasattr(policy, "forward") and not hasattr(policy, "predict")


def _predict_of(policy: Any, normalisation: Any, *, is_discrete: bool, trust: bool) -> Predict:
    """A function from an observation to an action."""
    if is_torch_module(policy):
        return TorchPolicy(policy, normalisation, is_discrete=is_discrete)
    if hasattr(policy, "predict"):
        return Model(policy, normalisation_of(policy, normalisation, trust=trust))
    if normalisation is not None and normalisation is not False:
        raise TypeError(
            "a normalisation belongs to a model; a file of save_policy contains it, and a function calls "
            "normalisation.normalize_obs itself"
        )
    if not callable(policy):
        raise TypeError(
            f"a policy is a file, an object with the method predict, or a function of an observation, got {policy!r}"
        )
    function: Predict = policy
    return function


def normalisation_of(model: Any, normalisation: Any, *, trust: bool) -> Any:
    """The normalisation of the observations of a model.

    Args:
        model: has the method `predict`.
        normalisation: as of `PolicyController`.
        trust: whether to load a pickled file.

    Returns:
        A `VecNormalize`, a `Normalisation` or None.

    Raises:
        ControllerError: the file cannot be read, or the normalisation has another shape than the observations.
        TypeError: it is something else.
        ValueError: as of `Normalisation`.
    """
    if normalisation is None and hasattr(model, "get_vec_normalize_env"):
        normalisation = model.get_vec_normalize_env()
        if model.get_env() is None:
            logging.getLogger(__name__).warning(
                "the model has no environment, so it does not say whether its observations were normalised in the "
                "training; give its normalisation, or normalisation=False if there was none"
            )
    if normalisation is None or normalisation is False:
        return None
    if isinstance(normalisation, (str, Path)):
        path = Path(normalisation)
        normalisation = _read_numbers(path) if path.suffix == ".npz" else _load_normalisation(path, trust=trust)
    trained = getattr(model, "observation_space", None)
    if isinstance(normalisation, tuple | list) and len(normalisation) == 2:
        normalisation = Normalisation(*normalisation)
    if isinstance(normalisation, Normalisation):
        if trained is not None:
            # raises an error for other numbers
            normalisation.normalize_obs({} if trained.shape is None else np.zeros(trained.shape))
        return normalisation
    if not (hasattr(normalisation, "norm_obs") and hasattr(normalisation, "normalize_obs")):
        raise TypeError(
            "normalisation must be a VecNormalize of Stable-Baselines3 or its file, (mean, deviation) or an .npz file "
            f"of them, got {shown(normalisation)}"
        )
    if not normalisation.norm_obs:
        return None
    normalised = normalisation.observation_space
    if trained is not None and shape_of(normalised) != shape_of(trained):
        raise ControllerError(
            f"the normalisation is for observations of {one_line(shape_of(normalised), 100)}, the policy was trained "
            f"with {one_line(shape_of(trained), 100)}"
        )
    return normalisation


def _load(path: Path, *, trust: bool) -> tuple[Any, Mapping[str, Any] | None]:
    """The policy of a file, and the description of its environment if the file has one."""
    if not path.is_file():
        raise ControllerError(f"there is no file {path}")
    if path.suffix == ".npz":
        network = read_mlp(path)
        return network, network.environment
    if path.suffix == ".onnx":
        return _load_onnx(path)
    if path.suffix == ".zip":
        _require_trust(path, "write the policy with sonata2d.gym.save_policy as .npz or .onnx", trust=trust)
        return _load_model(path), None
    raise ControllerError(f"{path.name} is not a policy; the files are .npz, .onnx, and .zip of Stable-Baselines3")


def _require_trust(path: Path, remedy: str, *, trust: bool) -> None:
    """Refuse a file whose loading runs code, unless its origin is trusted.

    Raises:
        ControllerError: it is not.
    """
    if not trust:
        raise ControllerError(
            f"{path} is a pickled file, and loading it runs the code in it; {remedy}, or give trust=True if you trust "
            "its origin"
        )


def _read_numbers(path: Path) -> Normalisation:
    """A normalisation from an .npz file; nothing in it is executed."""
    try:
        arrays = read_npz(read_bytes(path, max_bytes=MAX_WEIGHTS_BYTES), MAX_WEIGHTS_BYTES)
        return Normalisation(arrays["mean"], arrays["deviation"], arrays.get("clip", np.inf))
    except (KeyError, RecordError, TypeError, ValueError) as error:
        reason = f"it lacks the array {error}" if isinstance(error, KeyError) else one_line(error, 300)
        raise ControllerError(
            f"{path} does not hold a normalisation: {reason}; it is an .npz file with the arrays mean and deviation"
        ) from error


def _load_normalisation(path: Path, *, trust: bool) -> Any:
    """A `VecNormalize` of Stable-Baselines3 from its file."""
    _require_trust(path, "give mean and deviation, or an .npz file of them", trust=trust)
    try:
        return pickle.loads(read_at_most(path, MAX_FILE_BYTES))
    except OSError as error:
        raise ControllerError(f"{path} cannot be read: {error.strerror or error}") from error
    except Exception as error:  # whatever the file makes the unpickler do
        raise ControllerError(f"{path} is not a file of VecNormalize.save: {described(error)}") from error


def _load_onnx(path: Path) -> tuple[Predict, Mapping[str, Any] | None]:
    try:
        import onnxruntime
    except ModuleNotFoundError as error:
        raise ControllerError(f"{path.name} needs ONNX Runtime; pip install onnxruntime") from error
    try:
        session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    except Exception as error:  # of classes that the package does not publish
        raise ControllerError(f"{path.name} cannot be read: {error}") from error
    names = [part.name for part in session.get_inputs()]
    metadata = session.get_modelmeta().custom_metadata_map.get(METADATA_KEY)

    def predict(observation: Any) -> Any:
        parts = observation if isinstance(observation, dict) else {names[0]: observation}
        missing = [name for name in names if name not in parts]
        if missing:
            raise ControllerError(f"{path.name} needs {missing[0]!r}, which the observation lacks")
        return session.run(None, {name: np.asarray(parts[name])[None] for name in names})[0][0]

    try:
        description = None if metadata is None else json.loads(metadata)
    except ValueError as error:
        raise ControllerError(f"{path.name} has a damaged description of its environment: {error}") from error
    return predict, description


def _load_model(path: Path) -> Any:
    """A model of Stable-Baselines3, whose file does not name its algorithm."""
    try:
        import stable_baselines3
        from stable_baselines3.common.save_util import load_from_zip_file
    except ModuleNotFoundError as error:
        raise ControllerError(f"{path.name} needs Stable-Baselines3; pip install stable-baselines3") from error
    try:
        data = load_from_zip_file(path, load_data=True, device="cpu")[0] or {}
        modules = " ".join(base.__module__ for base in getattr(data.get("policy_class"), "__mro__", ()))
        names = {"sac": "SAC", "td3": "TD3", "dqn": "DQN"}
        name = next((names[key] for key in names if f"3.{key}." in modules), "PPO" if "clip_range" in data else "A2C")
        return getattr(stable_baselines3, name).load(path, device="cpu")
    except Exception as error:  # whatever the file makes the unpickler do
        raise ControllerError(f"{path} is not a model of Stable-Baselines3: {described(error)}") from error
