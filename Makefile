# Two commands make the project work on a machine with Python 3.11, make and git:
#   make expert_db    sets up .venv and materializes the expert database from the shipped motions
#   make test         sets up .venv and runs the tests
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
LEROBOT := $(VENV)/lerobot/.installed

export VIRTUAL_ENV := $(CURDIR)/$(VENV)
export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: setup lock expert_db test check audit nightly dev motions pictures clean

setup: $(STAMP)

# Everything but torch is checked against the hashes of requirements.lock; torch comes with packages for the GPU that
# depend on the machine (docs/security.md).
$(STAMP): pyproject.toml constraints.txt requirements.lock
	@echo "Installing the packages of requirements.lock into $(VENV); a few minutes, 4 GB and more with PyTorch ..."
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --no-deps --only-binary :all: --require-hashes --requirement requirements.lock
	@echo "Installing PyTorch ..."
	$(BIN)/pip install --constraint constraints.txt torch
	$(BIN)/pip install --quiet --no-deps --no-build-isolation --editable .
	$(BIN)/pip check
	touch $(STAMP)

# LeRobot's data set loader, which a test opens an export with: beside the environment, whose versions it does not allow.
$(LEROBOT): tests/dataset_export/lerobot.lock $(STAMP)
	rm -rf $(@D)
	$(BIN)/pip install --quiet --no-deps --only-binary :all: --require-hashes --target $(@D) \
		--requirement tests/dataset_export/lerobot.lock
	touch $@

# After a change of constraints.txt or of tests/dataset_export/lerobot.txt; needs uv (pip install uv).
LOCK := uv pip compile --quiet --no-deps --generate-hashes --python-version 3.11 --no-annotate --no-header
lock:
	grep -v '^torch==' constraints.txt | $(LOCK) - --output-file requirements.lock
	$(LOCK) tests/dataset_export/lerobot.txt --output-file tests/dataset_export/lerobot.lock

expert_db: setup
	dagster asset materialize --select expert_db
	@booster-lab database summary

# Files in the order of their folders: else those with few tests, which are the long ones, come last.
test: setup $(LEROBOT)
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check pipeline assets tests benchmarks examples
	$(BIN)/pyright
	$(BIN)/lint-imports
	$(BIN)/dagster definitions validate
	dg check defs

# Advisories on the locked packages; ADVISORIES is a copy of the database (docs/security.md).
audit: setup
	$(BIN)/python benchmarks/advisories.py $(ADVISORIES)

# What is too long for each push: mutated inputs, of the documented seed and of another one each day.
nightly: setup
	$(BIN)/python benchmarks/faults.py --list
	$(BIN)/python benchmarks/faults.py --list --seed $$(date -u +%Y%m%d)

dev: setup
	dagster dev --host 127.0.0.1

motions: setup
	$(BIN)/python -m pipeline.generator data/motions

# The pictures of README (the film from the database in place) and docs/curate.md; needs Chromium.
pictures: setup
	booster-lab view booster_lab/walk@0-840~mirror~rollout --record docs/pictures/mocap_to_robot.gif --start 2 --seconds 2.4
	BOOSTER_LAB_PICTURES=$(CURDIR)/docs/pictures $(BIN)/python -m pytest tests/command/test_curate_in_a_browser.py

clean:
	rm -rf data/store data/expert_db data/adapted_robot data/.dagster
