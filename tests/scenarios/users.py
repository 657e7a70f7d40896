"""What scenarios of other users share: only root can become somebody else."""

from __future__ import annotations

import os

import pytest

as_root = pytest.mark.skipif(
    os.geteuid() != 0, reason="only root can become nobody; these tests run unprivileged already"
)


def hand_over(folder, wires, uid):
    """Folder, files and the terminal's slave to another user."""
    for path in (folder, *folder.iterdir()):
        os.chown(path, uid, uid)
