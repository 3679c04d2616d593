"""A server on this machine that answers as the Hugging Face Hub does, as far as data sets need it.

Every file is a regular one, also a large one, so that neither Git LFS nor Xet takes part.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

TOKEN = "hf_testing"
OWNER = "lab"

Files = dict[str, bytes]


@dataclass
class Repository:
    """A data set repository.

    Attributes:
        private: whether readers need a token.
        commits: files of each commit, by its hash.
        branches: hash of the last commit of each branch.
        messages: of the commits that were uploaded.
    """

    private: bool = False
    commits: dict[str, Files] = field(default_factory=dict)
    branches: dict[str, str] = field(default_factory=dict)
    messages: list[str] = field(default_factory=list)

    def commit(self, branch: str, files: Files) -> str:
        """Make a commit the last one of a branch."""
        text = repr((len(self.commits), sorted((name, sha1(data)) for name, data in files.items())))
        self.commits[sha1(text.encode())] = files
        self.branches[branch] = sha1(text.encode())
        return self.branches[branch]

    def files(self, revision: str = "main") -> Files:
        """The files of a branch or commit."""
        return self.commits[self.branches.get(revision, revision)]


class FakeHub(ThreadingHTTPServer):
    """The server; `repositories` are what it stores, by `OWNER/NAME`."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.repositories: dict[str, Repository] = {}

    @property
    def endpoint(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"

    def files(self, name: str, revision: str = "main") -> Files:
        """The files of a repository, without the one that the Hub adds."""
        return {path: data for path, data in self.repositories[name].files(revision).items() if path[0] != "."}

    def replace(self, name: str, path: str, data: bytes) -> None:
        """Change a file, as another program could."""
        repository = self.repositories[name]
        repository.commit("main", repository.files() | {path: data})

    def create(self, name: str, private: bool) -> bool:
        """Create a repository; False if there is one."""
        if name in self.repositories:
            return False
        self.repositories[name] = Repository(private)
        self.repositories[name].commit("main", {".gitattributes": b"*.tar filter=lfs\n"})
        return True


@contextmanager
def serving() -> Iterator[FakeHub]:
    """A server that runs until the end of the block."""
    hub = FakeHub()
    thread = Thread(target=hub.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
    thread.start()
    try:
        yield hub
    finally:
        hub.shutdown()
        hub.server_close()
        thread.join()


def sha1(data: bytes) -> str:
    return hashlib.sha1(data).hexdigest()


def contents(folder: Path) -> Files:
    """The files of a folder, of its subfolders as well."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    wbufsize = -1  # headers and content are sent together
    server: FakeHub

    def log_message(self, *args: object) -> None:
        pass

    def do_POST(self) -> None:
        data = self._body()
        if self.path == "/api/validate-yaml":
            self._answer({"errors": [], "warnings": []})
        elif match := self._match(r"/api/datasets/([^/]+/[^/]+)/paths-info/([^/]+)"):
            if found := self._found(*match):
                files = found[0].commits[found[1]]
                self._answer([_entry(path, files[path]) for path in parse_qs(data.decode())["paths"] if path in files])
        elif not self._has_token():
            self._refuse(401, None, "Invalid username or password.")
        elif self.path == "/api/repos/create":
            self._create(json.loads(data))
        elif match := self._match(r"/api/datasets/([^/]+/[^/]+)/(preupload|commit|branch)/([^/]+)"):
            name, action, revision = match
            if (repository := self._repository(name)) is None:
                return
            if action == "branch":
                repository.branches.setdefault(revision, repository.branches["main"])
                self._answer({})
            elif revision not in repository.branches:
                self._refuse(404, "RevisionNotFound", f"Invalid rev id: {revision}")
            elif action == "preupload":
                files = repository.files(revision)
                modes = [
                    {
                        "path": file["path"],
                        "uploadMode": "regular",
                        "shouldIgnore": False,
                        "oid": _oid(files[file["path"]]) if file["path"] in files else None,
                    }
                    for file in json.loads(data)["files"]
                ]
                self._answer({"files": modes})
            else:
                self._commit(name, repository, revision, [json.loads(line) for line in data.splitlines()])
        else:
            self._refuse(404, "EntryNotFound", f"no address {self.path}")

    def do_HEAD(self) -> None:
        self.do_GET()

    def do_GET(self) -> None:
        if match := self._match(r"/api/datasets/([^/]+/[^/]+)(?:/revision/([^/]+))?"):
            name, revision = match
            if found := self._found(name, revision):
                repository, sha = found
                siblings = [{"rfilename": path} for path in sorted(repository.commits[sha])]
                facts = {"id": name, "sha": sha, "private": repository.private, "siblings": siblings, "tags": []}
                self._answer({**facts, "gated": False, "disabled": False, "downloads": 0, "likes": 0})
        elif match := self._match(r"/api/datasets/([^/]+/[^/]+)/tree/([^/]+)(?:/(.*))?"):
            name, revision, folder = match
            if found := self._found(name, revision):
                self._list(found[0].commits[found[1]], folder)
        elif match := self._match(r"/datasets/([^/]+/[^/]+)/resolve/([^/]+)/(.+)"):
            name, revision, path = match
            if found := self._found(name, revision):
                self._send(*found, path)
        else:
            self._refuse(404, "EntryNotFound", f"no address {self.path}")

    def _match(self, pattern: str) -> list[str] | None:
        """The parts of the address that a pattern names."""
        match = re.fullmatch(pattern, urlsplit(self.path).path)
        return None if match is None else [unquote(part or "") for part in match.groups()]

    def _body(self) -> bytes:
        if "chunked" not in self.headers.get("Transfer-Encoding", ""):
            return self.rfile.read(int(self.headers.get("Content-Length", 0)))
        parts = []
        while size := int(self.rfile.readline(), 16):
            parts.append(self.rfile.read(size))
            self.rfile.readline()
        self.rfile.readline()
        return b"".join(parts)

    def _has_token(self) -> bool:
        return self.headers.get("Authorization") == f"Bearer {TOKEN}"

    def _repository(self, name: str) -> Repository | None:
        """A repository that the reader may see; else an answer is sent."""
        repository = self.server.repositories.get(name)
        if repository is None or (repository.private and not self._has_token()):
            self._refuse(404 if self._has_token() else 401, "RepoNotFound", "Repository not found")
            return None
        return repository

    def _found(self, name: str, revision: str) -> tuple[Repository, str] | None:
        """A repository and the hash of a commit; else an answer is sent."""
        if (repository := self._repository(name)) is None:
            return None
        sha = repository.branches.get(revision or "main", revision)
        if sha not in repository.commits:
            self._refuse(404, "RevisionNotFound", f"Invalid rev id: {revision}")
            return None
        return repository, sha

    def _create(self, wish: dict[str, Any]) -> None:
        owner = wish.get("organization") or OWNER
        name = f"{owner}/{wish['name']}"
        if owner != OWNER:
            self._refuse(403, None, f"You don't have the rights to create a dataset under the namespace {owner!r}")
            return
        is_new = self.server.create(name, bool(wish.get("private")) or wish.get("visibility") == "private")
        url = f"{self.server.endpoint}/datasets/{name}"
        self._answer({"url": url, "id": name, "name": name}, 200 if is_new else 409)

    def _commit(self, name: str, repository: Repository, branch: str, lines: list[dict[str, Any]]) -> None:
        files = dict(repository.files(branch))
        for line in lines:
            value = line["value"]
            if line["key"] == "header":
                repository.messages.append(value["summary"])
            elif line["key"] == "file":
                files[value["path"]] = base64.b64decode(value["content"])
            elif line["key"] == "deletedFile":
                del files[value["path"]]
            else:
                self._refuse(400, None, f"no operation {line['key']}")
                return
        sha = repository.commit(branch, files)
        url = f"{self.server.endpoint}/datasets/{name}/commit/{sha}"
        self._answer({"success": True, "commitOid": sha, "commitUrl": url})

    def _list(self, files: Files, folder: str) -> None:
        """The files and folders below a folder, or the file of that name."""
        is_recursive = parse_qs(urlsplit(self.path).query).get("recursive", ["false"])[0].lower() in ("true", "1")
        prefix = f"{folder}/" if folder else ""
        entries: dict[str, dict[str, Any]] = {}
        for path, data in sorted(files.items()):
            if not path.startswith(prefix):
                continue
            inner, _, rest = path.removeprefix(prefix).partition("/")
            if rest:
                oid = sha1(inner.encode())
                entries[prefix + inner] = {"type": "directory", "oid": oid, "size": 0, "path": prefix + inner}
            if not rest or is_recursive:
                entries[path] = _entry(path, data)
        if folder and not entries:
            self._refuse(404, "EntryNotFound", f"{folder} does not exist")
        else:
            self._answer(list(entries.values()))

    def _send(self, repository: Repository, sha: str, path: str) -> None:
        """A file, or the range of it that is asked for."""
        data = repository.commits[sha].get(path)
        if data is None:
            self._refuse(404, "EntryNotFound", f"{path} does not exist", {"X-Repo-Commit": sha})
            return
        headers = {"X-Repo-Commit": sha, "ETag": f'"{_oid(data)}"', "Accept-Ranges": "bytes"}
        code = 200
        if wanted := re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", "")):
            first, last = int(wanted[1]), min(int(wanted[2] or len(data)), len(data) - 1)
            headers["Content-Range"] = f"bytes {first}-{last}/{len(data)}"
            code, data = 206, data[first : last + 1]
        self._reply(code, data, headers)

    def _answer(self, value: object, code: int = 200) -> None:
        self._reply(code, json.dumps(value).encode(), {"Content-Type": "application/json"})

    def _refuse(self, code: int, kind: str | None, message: str, headers: dict[str, str] | None = None) -> None:
        named = {"X-Error-Message": message} | ({"X-Error-Code": kind} if kind else {}) | (headers or {})
        self._reply(code, json.dumps({"error": message}).encode(), named)

    def _reply(self, code: int, data: bytes, headers: dict[str, str]) -> None:
        self.send_response(code)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)


def _entry(path: str, data: bytes) -> dict[str, Any]:
    return {"type": "file", "oid": _oid(data), "size": len(data), "path": path}


def _oid(data: bytes) -> str:
    """The hash by which git names the content of a file."""
    return sha1(b"blob %d\0" % len(data) + data)
