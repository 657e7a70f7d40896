"""The installed package: what is in the wheel, and that no other package can stand in its way."""

from __future__ import annotations

import platform
import subprocess
import sys
import tarfile
import tomllib
import venv
from collections.abc import Iterator
from pathlib import Path
from shutil import copytree, ignore_patterns, which
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
SOURCES = ("gritd", "estimator", "drivers", "config", "tools")
PAGES = ("pyproject.toml", "setup.py", "README.md", "LICENSE")
OF_THE_CHECKOUT = {  # scripts and what they install
    "gritd/config/release.lock",
    "gritd/config/requirements.lock",
    "gritd/tools/aarch64",
    "gritd/tools/install",
    "gritd/tools/lock",
    "gritd/tools/release",
}
DEVELOPMENT = (
    "gritd/tools/debian",
    "gritd/tools/dev",
    "gritd/tools/proof/ours",
    "gritd/tools/proof/real",
)

# a folder of the user's, with packages that have the names of our folders
FOREIGN = ("tools", "config", "drivers", "estimator")
IMPORT_ALL = """
import importlib, pkgutil, gritd
for module in pkgutil.walk_packages(gritd.__path__, "gritd."):
    if module.name != "gritd.__main__":
        importlib.import_module(module.name)
print(gritd.__file__)
"""


def run(*command: object, where: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(list(map(str, command)), cwd=where, capture_output=True, text=True)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the sources, with the links of gritd/ as links: building leaves files behind."""
    copy = tmp_path_factory.mktemp("checkout")
    for folder in SOURCES:
        copytree(
            ROOT / folder, copy / folder, symlinks=True, ignore=ignore_patterns("*.pyc", "*.so")
        )
    for page in PAGES:
        (copy / page).write_bytes((ROOT / page).read_bytes())
    return copy


def built(kind: str, checkout: Path) -> Path:
    """The wheel or the source archive, built as pip builds it but without a network."""
    code = f"from setuptools import build_meta; build_meta.build_{kind}('dist')"
    done = run(sys.executable, "-c", code, where=checkout)
    assert done.returncode == 0, done.stderr
    return next((checkout / "dist").glob({"wheel": "*.whl", "sdist": "*.tar.gz"}[kind]))


@pytest.fixture(scope="module")
def wheel(checkout: Path) -> Path:
    return built("wheel", checkout)


def expected() -> Iterator[str]:
    """Every file of the four folders that is for users."""
    for folder in SOURCES[1:]:
        for path in (ROOT / folder).rglob("*"):
            name = f"gritd/{path.relative_to(ROOT)}"
            made = path.suffix in (".pyc", ".so")
            if path.is_file() and not made and not name.startswith(DEVELOPMENT):
                yield name


def own() -> Iterator[str]:
    """The files of `gritd/` itself, beside its links to the four folders."""
    for path in (ROOT / "gritd").rglob("*.*"):
        linked = any(folder.is_symlink() for folder in path.parents)
        if path.suffix in (".py", ".typed") and not linked:
            yield str(path.relative_to(ROOT))


def names_in(wheel: Path) -> set[str]:
    """The files of a wheel, but for those that describe it."""
    return {name for name in ZipFile(wheel).namelist() if ".dist-info/" not in name}


@pytest.mark.long
def test_the_wheel_holds_every_file_but_those_for_development(wheel: Path) -> None:
    held = {name for name in names_in(wheel) if not name.endswith(".so")}

    assert held == set(expected()) - OF_THE_CHECKOUT | set(own())


@pytest.mark.skipif(which("gcc") is None, reason="found no compiler")
@pytest.mark.long
def test_the_wheel_holds_the_compiled_arithmetic_where_there_is_a_compiler(wheel: Path) -> None:
    compiled = [name for name in names_in(wheel) if name.endswith(".so")]
    of_x86 = {"checksum"} if platform.machine() == "x86_64" else set()
    assert {Path(name).name.partition(".")[0] for name in compiled} == {
        "algebra",
        "balance",
        "closed",
        "innovations",
        "messages",
        "record",
        *of_x86,
    }


@pytest.mark.long
def test_without_a_compiler_the_wheel_is_built_all_the_same(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = tmp_path / "copy"
    copytree(checkout, copy, symlinks=True, ignore=ignore_patterns("build", "dist", "*.egg-info"))
    monkeypatch.setenv("CC", "false")  # a compiler that fails
    assert not any(name.endswith(".so") for name in names_in(built("wheel", copy)))


@pytest.mark.long
def test_the_source_archive_holds_what_the_wheel_does(checkout: Path, wheel: Path) -> None:
    with tarfile.open(built("sdist", checkout)) as archive:
        names = [m.name.partition("/")[2] for m in archive.getmembers() if not m.isdir()]
        assert all(m.isfile() or m.isdir() for m in archive.getmembers()), "holds links"

    packed = {name for name in names_in(wheel) if not name.endswith(".so")}
    assert {name for name in names if name.startswith("gritd/")} == packed


def asked_for() -> Iterator[Requirement]:
    """What `make install` must bring: the dependencies, the view, and what builds gritd."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    yield from map(Requirement, project["project"]["dependencies"])
    yield from map(Requirement, project["project"]["optional-dependencies"]["view"])
    yield from map(Requirement, project["build-system"]["requires"])


def test_the_lock_has_what_the_project_asks_for_and_no_matplotlib() -> None:
    lines = (ROOT / "config" / "requirements.lock").read_text().splitlines()
    pins = [line.rstrip(" \\").split("==") for line in lines if "==" in line]
    locked = {canonicalize_name(name): version for name, version in pins}

    assert "matplotlib" not in locked
    for asked in asked_for():
        version = locked.get(canonicalize_name(asked.name))
        assert version is not None and version in asked.specifier, f"{asked}: run `make lock`"


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python of an environment with gritd's wheel beside the package `config` of PyPI, which
    this environment has from the extra `test`; the dependencies are those of this environment too.
    """
    folder = tmp_path_factory.mktemp("installed")
    venv.create(folder)
    python = folder / "bin" / "python"
    options = ("--disable-pip-version-check", "--quiet", "--no-deps", "--no-index")
    pip = run(
        sys.executable, "-m", "pip", "--python", python, "install", *options, wheel, where=folder
    )
    assert pip.returncode == 0, pip.stderr

    packages = next(folder.glob("lib/python*/site-packages"))
    (packages / "dependencies.pth").write_text(str(Path(pytest.__file__).parents[1]))
    return python


@pytest.fixture
def surrounded(tmp_path: Path, installed: Path) -> Path:
    """A working directory with foreign packages of our folders' names."""
    for name in FOREIGN:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"raise ImportError('the foreign {name}')\n")
        assert "the foreign" in run(installed, "-c", f"import {name}", where=tmp_path).stderr

    away = tmp_path / "away"
    away.mkdir()
    found = run(installed, "-c", "import config; print(config.__file__)", where=away)
    assert "site-packages" in found.stdout, "the package `config` of PyPI is missing"
    return tmp_path


@pytest.mark.long
def test_every_module_is_imported_among_foreign_packages(installed: Path, surrounded: Path) -> None:
    done = run(installed, "-c", IMPORT_ALL, where=surrounded)

    assert done.returncode == 0, done.stderr
    assert str(installed.parents[1]) in done.stdout


@pytest.mark.slow
def test_commands_run_among_foreign_packages(installed: Path, surrounded: Path) -> None:
    """`python -m gritd`, because it searches the working directory before all else."""
    demo = run(
        installed, "-m", "gritd", "demo", "--seconds", 20, "--output", "out", where=surrounded
    )
    assert demo.returncode == 0, demo.stdout + demo.stderr

    config = surrounded / "out" / "testbed.yaml"
    recording = next((surrounded / "out").glob("demo-*.mcap"))
    checked = run(installed, "-m", "gritd", "check-config", config, where=surrounded)
    assert checked.returncode == 0, checked.stderr
    assert "valid" in checked.stdout

    given = (recording, "--config", config)
    diagnosed = run(installed, "-m", "gritd", "diagnose", *given, where=surrounded)
    assert diagnosed.returncode == 0, diagnosed.stderr
    assert diagnosed.stdout.startswith("verdict: ")


@pytest.mark.slow
def test_a_blind_trial_runs_where_gritd_is_installed(installed: Path, surrounded: Path) -> None:
    trial = ("prove", "--cases", 1, "--seed", 3, "--strata", "none", "--output", "trial")
    done = run(installed, "-m", "gritd", *trial, where=surrounded)

    assert done.returncode == 0, done.stderr
    assert "all 1 are as sealed" in done.stdout


def test_import_gritd_loads_nothing_else() -> None:
    code = "import sys; before = set(sys.modules); import gritd; print(set(sys.modules) - before)"
    assert run(sys.executable, "-c", code, where=ROOT).stdout == "{'gritd'}\n"
