"""Sealing answers: a hash of them and of a salt, published before anyone is asked, checked when
they are opened.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from pathlib import Path
from typing import Any

from gritd.tools.cli.command import FAILED, CommandError


def digest(sealed: dict[str, Any]) -> str:
    """SHA-256 of the canonical JSON."""
    text = json.dumps(
        sealed, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False
    )
    return hashlib.sha256(text.encode()).hexdigest()


def close(path: Path, answers: dict[str, Any], files: dict[str, str] | None = None) -> str:
    """Write answers with a fresh salt and the hashes of the files that belong to them; returns the
    seal.
    """
    sealed = {"salt": secrets.token_hex(32), "answers": answers, "files": files or {}}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        json.dumps(sealed, indent=1, ensure_ascii=True, allow_nan=False), encoding="utf-8"
    )
    path.chmod(0o600)
    return digest(sealed)


def opened(path: Path, seal: str) -> dict[str, Any]:
    """The answers. Raises CommandError where they or their files are not those that were sealed."""
    try:
        sealed: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CommandError(f"{path}: found {error}; expected sealed answers", FAILED) from None

    if digest(sealed) != seal:
        raise CommandError(
            f"{path}: found other answers than were sealed; expected SHA-256 {seal}", FAILED
        )

    for name, expected in sealed["files"].items():
        if sha256(path.parent / name) != expected:
            raise CommandError(f"{path.parent / name}: found another file than was sealed", FAILED)

    answers: dict[str, Any] = sealed["answers"]
    return answers


def sha256(path: Path) -> str:
    """Of a file; empty where there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""
