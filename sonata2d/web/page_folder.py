"""A folder with the simulator as a web page: any server of files can serve it, and no program runs on that server."""

from __future__ import annotations

import hashlib
import json
import re
import zipfile
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.error import HTTPError, URLError
from urllib.parse import urljoin
from urllib.request import Request, urlopen

from jinja2 import Environment, PackageLoader

from ..core.files.whole_file import whole_file
from ..errors import ConfigError
from ..scenegen.scenario.load import scenario_names
from ..version import __version__

PYODIDE = "314.0.7"
SOURCE = f"https://cdn.jsdelivr.net/pyodide/v{PYODIDE}/full/"
INDEX = "https://pypi.org/simple/"

_CORE = ("pyodide.mjs", "pyodide.asm.mjs", "pyodide.asm.wasm", "python_stdlib.zip")
_LOCK = "pyodide-lock.json"
# What the simulator in the page imports; the packages that these need come with them.
_PACKAGES = ("numpy", "cffi", "orjson", "pyyaml", "pydantic", "lazy-loader", "cloudpickle", "annotated-types")
_ENGINE = "pymunk"  # not in Pyodide's distribution; its own wheels for it are on the package index
# The parts of sonata2d that it imports; tests/web/test_in_page.py runs it with nothing else.
_PARTS = (
    "__init__.py", "__init__.pyi", "agents", "core", "errors.py", "learning", "record", "registry.py", "scenegen",
    "sim", "version.py", "view", "web/__init__.py", "web/in_page.py",
)  # fmt: skip
_SUFFIXES = (".py", ".pyi", ".yaml", ".toml", ".npz", ".json")
_STATIC = (
    "demo.js",
    "drive.js",
    "elements.js",
    "input.js",
    "simulator.js",
    "worker.js",
    "style.css",
    "icon.svg",
    "drawing.js",
)
_CONTROLLERS = ("social-planner", "human-like", "orca", "social-force", "straight-to-goal")
_TIMEOUT_S = 60.0

Advance = Callable[[str], None]


def write_page(
    out: Path,
    source: str = SOURCE,
    *,
    wheels: Path | None = None,
    index: str = INDEX,
    advance: Advance = lambda _: None,
) -> int:
    """Write the simulator as a web page, with a Python for the browser.

    Args:
        out: folder of the page; it is created, and files of the page in it are replaced.
        source: address or folder of a distribution of Pyodide.
        wheels: folder of wheels for Pyodide, which are used instead of those of the distribution.
        index: address of a Python package index, for the wheel of the physics engine.
        advance: called with the name of each file before it is read.

    Returns:
        The size of all files, bytes.

    Raises:
        ConfigError: a file of the distribution cannot be read or is damaged, or a package is missing.
    """
    distribution = _Distribution(source, wheels, index, advance)
    content = {f"pyodide/{name}": data for name, data in distribution.files().items()}
    content |= {name: static_files()[name] for name in _STATIC}
    content["sonata2d.zip"] = own_archive()
    content["index.html"] = _index().encode()
    for name, data in content.items():
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        with whole_file(out / name) as temporary:
            temporary.write_bytes(data)
    return sum(map(len, content.values()))


def read_page(folder: Path) -> dict[str, bytes]:
    """The files of a page by name, for a server whose pages simulate what it simulates itself.

    Raises:
        ConfigError: it is no such folder, or it simulates something else than this installation.
    """
    try:
        packages = json.loads((folder / "pyodide" / _LOCK).read_bytes())["packages"]
        names = [f"pyodide/{name}" for name in (*_CORE, _LOCK, *(entry["file_name"] for entry in packages.values()))]
        # nothing else that is in the folder is served
        content = {name: (folder / name).read_bytes() for name in (*names, *_STATIC, "sonata2d.zip")}
        engine, archive = packages[_ENGINE]["version"], _checksums(content["sonata2d.zip"])
    except (OSError, KeyError, TypeError, ValueError, zipfile.BadZipFile) as error:
        raise ConfigError(
            f"{folder} is no page of the simulator ({error!r}); sonata2d page {folder} writes one"
        ) from None
    if archive != _checksums(own_archive()) or engine != version(_ENGINE):
        raise ConfigError(
            f"the page in {folder} is of another version than this installation, so that both would simulate different "
            f"runs; write it again: sonata2d page {folder}"
        )
    return content


def _checksums(archive: bytes) -> list[tuple[str, int]]:
    with zipfile.ZipFile(BytesIO(archive)) as opened:
        return sorted((entry.filename, entry.CRC) for entry in opened.infolist())


def own_archive() -> bytes:
    """The parts of sonata2d that run in the page, as a ZIP file; the same content gives the same bytes."""
    root, buffer = Path(str(files("sonata2d"))), BytesIO()
    paths = [
        path
        for part in _PARTS
        for path in (sorted((root / part).rglob("*")) if (root / part).is_dir() else [root / part])
    ]
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in paths:
            if path.suffix in _SUFFIXES:
                entry = zipfile.ZipInfo(f"sonata2d/{path.relative_to(root).as_posix()}")
                archive.writestr(entry, path.read_bytes(), zipfile.ZIP_DEFLATED, 9)
    return buffer.getvalue()


@cache
def static_files() -> dict[str, bytes]:
    """The scripts, styles and icons of all pages, by name."""
    paths = [*files(__package__).joinpath("static").iterdir(), files("sonata2d.view").joinpath("drawing.js")]
    return {path.name: path.read_bytes() for path in paths if path.name.endswith((".css", ".js", ".svg"))}


@cache
def templates() -> Environment:
    """The templates of all pages."""
    environment = Environment(loader=PackageLoader(__package__, "pages"), autoescape=True)
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment


def _index() -> str:
    """The page, with what it offers."""
    from ..agents.controllers.loading import named_controllers

    kinds = named_controllers()
    data = {
        "version": __version__,
        "scenarios": scenario_names(),
        "controllers": {name: (kinds[name].__doc__ or "").partition("\n")[0] for name in _CONTROLLERS},
    }
    return templates().get_template("demo.html").render(data=data)


class _Distribution:
    """The files of Pyodide that the page needs.

    Args:
        source, wheels, index, advance: see `write_page`.
    """

    def __init__(self, source: str, wheels: Path | None, index: str, advance: Advance) -> None:
        self._source = source if "://" in source else Path(source).resolve().as_uri()
        self._source, self._index, self._advance = self._source.rstrip("/") + "/", index.rstrip("/") + "/", advance
        self._wheels = {_package(path.name): path for path in sorted(wheels.glob("*.whl"))} if wheels else {}
        if wheels and not self._wheels:
            raise ConfigError(f"{wheels} has no wheels (.whl)")
        try:
            self._lock = json.loads(self._read(_LOCK))
            self._known, self._info = dict(self._lock["packages"]), dict(self._lock["info"])
            self._tag = f"pyemscripten_{self._info['abi_version']}_wasm32"
        except (ValueError, KeyError, TypeError) as error:
            raise ConfigError(
                f"{self._source}{_LOCK} is not the list of a distribution of Pyodide: {error!r}"
            ) from None

    def files(self) -> dict[str, bytes]:
        """The content of all files by name."""
        content = {name: self._read(name) for name in _CORE}
        packages: dict[str, Any] = {}
        waiting = [*_PACKAGES, _ENGINE]
        while waiting:
            name = _normal(waiting.pop())
            if name not in packages:
                packages[name], data = self._package(name)
                content[packages[name]["file_name"]] = data
                waiting += packages[name]["depends"]
        lock = self._lock | {"packages": packages}
        return content | {_LOCK: json.dumps(lock, sort_keys=True).encode()}

    def _package(self, name: str) -> tuple[dict[str, Any], bytes]:
        """The entry of a package in the list, and its wheel."""
        if name in self._wheels:
            data = self._wheels[name].read_bytes()
            number, installed = self._wheels[name].name.split("-")[1], version(_ENGINE)
            if name == _ENGINE and number != installed:
                raise ConfigError(
                    f"{self._wheels[name]} is {_ENGINE} {number}, and {installed} is installed here; both have to "
                    "be of one version, so that the page simulates what this installation simulates"
                )
            return _entry(name, self._wheels[name].name, data, self._known.get(name)), data
        if name in self._known:
            entry = self._known[name]
            file = entry["file_name"]
            data = self._read(file, entry["sha256"])
            return entry | {"file_name": file.rpartition("/")[2]}, data
        if name == _ENGINE:
            file, address, digest = self._engine()
            data = self._read(address, digest)
            return _entry(name, file, data, {"depends": ["cffi"]}), data
        raise ConfigError(f"{self._source} lists no package {name}; --wheels names a folder with its wheel")

    def _engine(self) -> tuple[str, str, str]:
        """Name, address and hash of the physics engine's wheel on the index: of the version that is installed here."""
        installed = version(_ENGINE)
        address = f"{self._index}{_ENGINE}/"
        listed = json.loads(self._read(address))["files"]
        for file in listed:
            if file["filename"].startswith(f"{_ENGINE}-{installed}-") and file["filename"].endswith(f"{self._tag}.whl"):
                return file["filename"], urljoin(address, file["url"]), file["hashes"]["sha256"]
        raise ConfigError(
            f"{address} has no wheel of {_ENGINE} {installed} for {self._tag}; install a version of {_ENGINE} that has "
            f"one, so that the page simulates what this installation simulates, or choose another distribution"
        )

    def _read(self, name: str, digest: str | None = None) -> bytes:
        """The content of a file of the distribution, or at an address."""
        address = urljoin(self._source, name)
        self._advance(address.rpartition("/")[2] or address)
        try:
            request = Request(address, headers={"Accept": "application/vnd.pypi.simple.v1+json, */*;q=0.1"})
            with urlopen(request, timeout=_TIMEOUT_S) as response:
                data: bytes = response.read()
        except (URLError, OSError, ValueError) as error:
            if isinstance(error, HTTPError):
                error.close()
            reason = getattr(error, "reason", error)
            raise ConfigError(
                f"{address} cannot be read: {reason}; --pyodide names another address, or a folder with "
                "a distribution of Pyodide"
            ) from None
        if digest is not None and hashlib.sha256(data).hexdigest() != digest:
            raise ConfigError(f"{address} is damaged: its SHA-256 is not {digest}")
        return data


def _entry(name: str, file: str, data: bytes, known: dict[str, Any] | None) -> dict[str, Any]:
    """The entry of a wheel in the list of packages."""
    return {
        "name": name,
        "version": file.split("-")[1],
        "file_name": file,
        "sha256": hashlib.sha256(data).hexdigest(),
        "install_dir": "site",
        "package_type": "package",
        "imports": [],
        "depends": list((known or {}).get("depends", [])),
        "unvendored_tests": False,
    }


def _package(file: str) -> str:
    """The normalised name of the package of a wheel, see PEP 503."""
    return _normal(file.split("-")[0])


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
