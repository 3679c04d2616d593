"""The links of a study: tokens that cannot be guessed."""

from __future__ import annotations

import hashlib
import secrets
import threading
from pathlib import Path

import orjson

from ..errors import RecordError
from ..record.files import read_bytes, write_atomically

_FILE = "links.json"
_BYTES = 16  # of a token: 128 bits


class Links:
    """The tokens of a study, stored in its folder, which only its owner can open.

    A participant's token is stored in clear, because the researcher must be able to send a link again. A person who can
    read the file can read the answers beside it, too.

    Args:
        folder: `study/` in the folder of the study.

    Attributes:
        researcher: token of the researcher's page.
        open: token by which anybody becomes a participant.

    Raises:
        RecordError: the file is damaged, or cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / _FILE
        self.researcher, self.open = secrets.token_urlsafe(_BYTES), secrets.token_urlsafe(_BYTES)
        self._tokens: dict[str, str] = {}  # by participant
        self._lock = threading.Lock()  # the threads of a server take turns
        if self._path.exists():
            self._read()
        else:
            self._write({})

    def participant_of(self, token: str) -> str | None:
        """Id of the participant that a token belongs to; None for an unknown token."""
        return self._by_digest.get(_digest(token))

    def is_researcher(self, token: str) -> bool:
        """Whether a token is the researcher's; takes the same time for each token."""
        return secrets.compare_digest(_digest(token), _digest(self.researcher))

    def is_open(self, token: str) -> bool:
        """Whether a token is the token of the open link."""
        return secrets.compare_digest(_digest(token), _digest(self.open))

    def add(self, participant: str) -> str:
        """The token of a participant, a new one unless the participant has one.

        Raises:
            RecordError: the file cannot be written.
        """
        with self._lock:
            if participant not in self._tokens:
                self._write(self._tokens | {participant: secrets.token_urlsafe(_BYTES)})
            return self._tokens[participant]

    def remove(self, participant: str) -> None:
        """Remove the link of a participant.

        Raises:
            RecordError: the file cannot be written.
        """
        with self._lock:
            if participant in self._tokens:
                self._write({id: token for id, token in self._tokens.items() if id != participant})

    def tokens(self) -> dict[str, str]:
        """Tokens by participant."""
        return dict(self._tokens)

    def _read(self) -> None:
        try:
            stored = orjson.loads(read_bytes(self._path))
            self.researcher, self.open = str(stored["researcher"]), str(stored["open"])
            self._tokens = {str(id): str(token) for id, token in stored["participants"].items()}
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise RecordError(f"{self._path} is damaged: {error}; restore it, or delete it for new links") from error
        self._index()

    def _write(self, tokens: dict[str, str]) -> None:
        """Store the tokens of the participants, then use them."""
        state = {"researcher": self.researcher, "open": self.open, "participants": tokens}
        write_atomically(self._path, orjson.dumps(state, option=orjson.OPT_INDENT_2))
        self._tokens = tokens
        self._index()

    def _index(self) -> None:
        # Tokens are looked up by their hash, so that the time of a look-up says nothing about them.
        self._by_digest = {_digest(token): id for id, token in self._tokens.items()}


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode(errors="replace")).hexdigest()
