# `make run` and `make test` need only Python >= 3.11, make and a package index.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip install --quiet --disable-pip-version-check

define HINT
treadwatch: the packages of requirements.lock could not be installed, see above. Where one has to be built from source
(ruckig on arm64), install a C++ compiler and the headers of Python first, on Debian and Ubuntu: apt install g++ python3-dev
endef
export HINT

.PHONY: run test check golden bench hil faults campaign-quick clean

run: $(VENV)/ready
	$(BIN)/treadwatch run

test: check
	$(BIN)/python -m pytest -n 2 --dist worksteal

check: $(VENV)/ready-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

golden: $(VENV)/ready-dev
	$(BIN)/python -m tests.replay.golden

bench: $(VENV)/ready
	$(BIN)/treadwatch bench --json out/bench.json

hil: $(VENV)/ready-dev
	$(BIN)/python -m pytest --hil tests/hil

faults: $(VENV)/ready
	$(BIN)/treadwatch faults --processes agilex --into docs/results.md

campaign-quick: $(VENV)/ready
	rm -rf out/campaign-quick
	$(BIN)/treadwatch campaign --missions 84 --seed 1 --report out/campaign-quick

$(VENV)/ready: requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "treadwatch needs Python 3.11 or newer")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) --no-deps -r requirements.lock || { echo "$$HINT" >&2; exit 1; }
	$(PIP) --no-deps --no-build-isolation --editable .
	$(BIN)/python -c 'import controller.build, controller.campaign.command'
	touch $@

$(VENV)/ready-dev: $(VENV)/ready requirements-dev.lock
	$(PIP) --no-deps -r requirements-dev.lock
	touch $@

clean:
	rm -rf $(VENV) out build *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
