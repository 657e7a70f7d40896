"""`python -m pytest tests/wording --rewrite` writes the snapshots anew; review what changed."""

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--rewrite", action="store_true", help="write the snapshots of outputs anew")
