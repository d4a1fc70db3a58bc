# Two commands make the project work on a machine with Python 3.11, make and git:
#   make expert_db    sets up .venv and materializes the expert database from the shipped motions
#   make test         sets up .venv and runs the tests
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

export VIRTUAL_ENV := $(CURDIR)/$(VENV)
export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: setup expert_db test check dev motions clean

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $(STAMP)

expert_db: setup
	dagster asset materialize --select expert_db

test: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check pipeline assets tests benchmarks examples
	$(BIN)/pyright
	$(BIN)/lint-imports
	$(BIN)/dagster definitions validate
	dg check defs

dev: setup
	dagster dev --host 127.0.0.1

motions: setup
	$(BIN)/python -m pipeline.generator data/motions

clean:
	rm -rf data/store data/expert_db data/adapted_robot data/.dagster
