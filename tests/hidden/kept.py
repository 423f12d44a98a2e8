"""Results of trials in a file of JSON lines, as they come: what an earlier call found is not done again."""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any

Entry = dict[str, Any]


class KeptResults:
    """Entries of a file by what tells them apart; one that is added stands in the file at once."""

    def __init__(self, path: Path, key: Callable[[Entry], Hashable]) -> None:
        """``key``: of an entry. A file that is not there yet is begun with the first entry."""
        self._path, self._key = path, key
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        self._known = {key(entry): entry for entry in map(json.loads, lines)}

    def __contains__(self, key: Hashable) -> bool:
        return key in self._known

    def __getitem__(self, key: Hashable) -> Entry:
        return self._known[key]

    def add(self, entry: Entry) -> None:
        """Keep one more; it is read back, so that a page is the same from a file and from a run."""
        line = json.dumps(entry)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
        kept = json.loads(line)
        self._known[self._key(kept)] = kept
