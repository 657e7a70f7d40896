# `make` lists what there is. Everything is set up in .venv by itself, and again when pyproject.toml or the C sources change.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
JOBS   ?= 2
READY  := $(VENV)/.ready

# tests start hundreds of Pythons, and each would compile all it imports
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help venv demo test long tutorial slow package lint format type docs man site proof scenarios coverage fuzz soak install uninstall release lock wheel deb clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-9s %s\n", $$1, $$2 }' Makefile

venv: $(READY) ## set up .venv (the other targets do it when they need it)

# --upgrade makes a venv that an older Python or an interrupted set-up left behind whole again.
$(READY): pyproject.toml setup.py $(wildcard estimator/compiled/*.[ch])
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "gritd needs Python 3.11 or newer; try: make PYTHON=python3.11" >&2; exit 1; }
	@echo "setting up $(VENV) (a minute or two, once) …"
	@$(PYTHON) -m venv --upgrade $(VENV) || { echo "cannot make a venv; is the package python3-venv installed?" >&2; exit 1; }
	@rm -f estimator/compiled/*.so  # pip leaves them where it cannot compile
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --editable '.[test]'
	@ls estimator/compiled/*.so >/dev/null 2>&1 || \
	  echo "nothing was compiled, and a tick takes longer; for Debian's Python: apt install gcc python3-dev; rm $@" >&2
	@touch $@

demo: $(READY) ## the daemon against the simulated testbed on real wires, 60 s
	@$(BIN)/gritd demo

# a worker more than two cores: some tests wait for real time; none is idle while another has tests left
test: $(READY) ## the tests that a change needs at once
	@$(BIN)/python -m pytest --quiet -n 3 --dist worksteal -m "not long and not slow"

long: $(READY) ## whole campaigns, benches, worlds and faults: what decides a verdict, with every submission
	@$(BIN)/python -m pytest --quiet -n 3 --dist worksteal -m "long and not slow"

tutorial: $(READY) ## the pages and notebooks of docs/first-day and docs/your-data, word for word
	@$(BIN)/python -m pytest --quiet -m "slow or not slow" tests/docs

slow: $(READY) ## what takes minutes each, or needs a scheduler or public recordings
	@$(BIN)/python -m pytest --quiet -m slow

package: $(READY) ## the wheel, installed beside foreign packages of our folders' names
	@$(BIN)/python -m pytest --quiet -m slow tests/test_package.py

lint: $(READY) ## ruff: lint and format
	@$(BIN)/ruff check --quiet .
	@$(BIN)/ruff format --quiet --check . || { echo "not formatted; run: make format" >&2; exit 1; }

format: $(READY) ## put the code into the format
	@$(BIN)/ruff format --quiet .

type: $(READY) ## mypy --strict
	@$(BIN)/mypy --no-error-summary

docs: $(READY) ## the generated parts of the documents
	@$(BIN)/python -m gritd.tools.dev.config_reference

man: $(READY) ## build/man: gritd(1), and gritd-COMMAND(1) for each command
	@$(BIN)/python -m gritd.tools.dev.manual build/man

site: $(READY) ## build/site: the documents as a site, to open from the folder; its examples run, some minutes
	@rm -f estimator/compiled/*.so  # pip leaves them where it cannot compile
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --editable '.[docs]'
	@rm -rf build/pages build/site && mkdir -p build/pages
	@cp -r docs .github config drivers estimator tools *.md build/pages  # links of docs/ lead to the others
	@$(BIN)/python -m gritd.tools.dev.manual --site build/pages/docs/site/commands
	@$(BIN)/python -m sphinx --quiet --fail-on-warning --keep-going \
	  -c build/pages/docs/site -d build/doctrees build/pages/docs build/site
	@echo "build/site/index.html"

proof: $(READY) ## the proofs on real recordings in ../shared/real; writes docs/real-recordings.md
	@$(BIN)/python -m gritd.tools.proof.real

scenarios: $(READY) ## every fault of docs/reliability.md, the long ones too; writes that page
	@$(BIN)/python -m gritd.tools.dev.reliability --jobs $(JOBS)

coverage: $(READY) ## which branches of estimator, drivers and tools the tests take; writes that part of docs/reliability.md
	@$(BIN)/python -m gritd.tools.dev.coverage --jobs $(JOBS)

fuzz: $(READY) ## bytes, configurations, recordings and readings that nobody meant: the full counts
	@$(BIN)/python -m gritd.tools.dev.fuzz

soak: $(READY) ## 100 simulated hours, then the daemon on wires for an hour under load
	@$(BIN)/python -m gritd.tools.dev.soak

release: ## build, check and try what is published, into dist/; see docs/release.md
	@PYTHON="$(PYTHON)" tools/release

lock: ## the lists of config/*.lock anew, with the newest releases (needs uv)
	@tools/lock

install: ## lay gritd out on this Debian system (DESTDIR=… for a package); see docs/service.md
	@PYTHON="$(PYTHON)" DESTDIR="$(DESTDIR)" tools/install install

uninstall: ## take it away again; configuration and recordings stay
	@PYTHON="$(PYTHON)" DESTDIR="$(DESTDIR)" tools/install uninstall

wheel: $(READY) ## dist/gritd-….whl
	@rm -rf build/lib* build/bdist*  # setuptools packs what an earlier build left there
	@$(BIN)/python -m pip wheel -qq --disable-pip-version-check --no-deps --wheel-dir dist .
	@ls dist/*.whl

deb: ## dist/gritd_….deb for the Debian release of this computer
	@tools/debian/build

clean: ## remove what the targets made
	@rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +
