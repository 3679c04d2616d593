"""Settings of the server of a study."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

# Connections without a complete request, and closed web sockets that the other side keeps open; with one more, the
# oldest is cut off. As many may wait to be accepted, so that nobody is cut off whose request is on its way.
MAX_IDLE_CONNECTIONS = 100


@dataclass(frozen=True, slots=True)
class ServerSettings:
    """Settings of the server of a study.

    Attributes:
        host: address at which the server listens.
        port: port; 0 for a free one.
        url: address for participants; None: built from host and port, and on the researcher's page the address at
            which it is opened.
        participants: number of participants that have links from the start.
        ids: participants who have links from the start, by id; they are added if they are new.
        takeover: the one of two tabs with the same link that may drive: the `newest`, or the `first` as long as it is
            open.
        connections: largest number of open pages of participants.
        suffix: of episode files.
        is_preview: whether steps can be skipped.
        page: folder that `page_folder.write_page` has written: pages then simulate each run as well, and show a tick
            before the server's answer arrives; None: they show what the server sends.
    """

    host: str = "127.0.0.1"
    port: int = 8765
    url: str | None = None
    participants: int = 0
    ids: tuple[str, ...] = ()
    takeover: Literal["newest", "first"] = "newest"
    connections: int = 200
    suffix: str = ".json"
    is_preview: bool = False
    page: Path | None = None
