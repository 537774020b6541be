# Needs Python 3.11 or later and make. Every target sets itself up in $(VENV).
PYTHON ?= python3
VENV ?= .venv
BIN = $(VENV)/bin
RLLIB = $(VENV)-rllib
OFFLINE = $(VENV)-offline
PIP = $(BIN)/python -m pip --disable-pip-version-check --quiet install -c constraints.txt

.PHONY: help install docs reproduce reference benchmark sensitivity studies policies test rllib offline lint types golden hooks pythons bench speed figures clean

help:
	@echo "make reproduce  run the paper's cases and write figures, videos and claims to results/paper"
	@echo "make reference  rank all authorities by the fault that persons control with them, and write docs/reference.md"
	@echo "make benchmark  run every driver and authority on the full suite, and write docs/benchmark.md"
	@echo "make sensitivity  vary what the paper leaves open, and write a table and a picture to results/sensitivity"
	@echo "make studies    repeat two published studies with the simulated persons, and write docs/studies.md"
	@echo "make test       lint, types and all tests"
	@echo "make golden     golden rollouts of two environments, in seconds"
	@echo "make hooks      have git run lint, types and golden rollouts before every commit"
	@echo "make pythons    the tests on every promised Python that this machine has"
	@echo "make rllib      the tests of training on Ray, in a virtual environment of their own"
	@echo "make offline    the tests of offline learning with d3rlpy, in a virtual environment of their own"
	@echo "make policies   train the policies that ship, compare them, and write them and their card to the package"
	@echo "make bench      speed, as ratios against highway-env and SciPy in the same run"
	@echo "make speed      measure what a step costs against the work, and write docs/speed.md"
	@echo "make docs       the documentation as web pages, in docs/_build/html; its code is run and its videos are made"
	@echo "make figures    copy the README's pictures from results/paper"
	@echo "make clean      remove the virtual environment"

$(VENV)/bin/python:
	@$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11))" || \
		{ echo "Python 3.11 or later is needed; set PYTHON=/path/to/it"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.experiments: $(VENV)/bin/python pyproject.toml constraints.txt
	$(PIP) -e ".[experiments]"
	@touch $@

$(VENV)/.dev: $(VENV)/bin/python pyproject.toml constraints.txt
	$(PIP) "torch==2.13.0"
	$(PIP) -e ".[dev,train]"
	@touch $@ $(VENV)/.experiments

install: $(VENV)/.experiments

reproduce: $(VENV)/.experiments
	$(BIN)/python -m experiments.reproduce $(ARGS)

reference: $(VENV)/.experiments
	$(BIN)/python -m experiments.reference $(ARGS)

benchmark: $(VENV)/.experiments
	$(BIN)/python -m experiments.benchmark $(ARGS)

sensitivity: $(VENV)/.experiments
	$(BIN)/python -m experiments.sensitivity $(ARGS)

studies: $(VENV)/.experiments
	$(BIN)/python -m experiments.studies $(ARGS)

policies: $(VENV)/.dev
	$(BIN)/python -m experiments.policies $(ARGS)

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.dev
	$(BIN)/mypy

test: lint types
	$(BIN)/python -m pytest -q -n auto --dist worksteal $(ARGS)

golden: $(VENV)/.dev
	$(BIN)/python -m pytest -q tests/golden -k "TwoLane or LaneChange"

hooks: $(VENV)/.dev
	$(BIN)/pre-commit install

pythons: $(VENV)/.dev
	$(BIN)/nox $(ARGS)

# RLlib pins an older Gymnasium, so it has an environment of its own.
$(RLLIB)/.rllib: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(RLLIB)
	grep -v '^gymnasium==' constraints.txt > $(RLLIB)/constraints.txt
	$(RLLIB)/bin/python -m pip --disable-pip-version-check --quiet install -c $(RLLIB)/constraints.txt -e ".[rllib]" pytest hypothesis
	@touch $@

rllib: $(RLLIB)/.rllib
	$(RLLIB)/bin/python -m pytest -q tests/agents/test_rllib.py $(ARGS)

# d3rlpy pins a Gymnasium that is older than the oldest that the environments run on: only what reads a dataset and
# writes a policy is used there.
$(OFFLINE)/.offline: pyproject.toml Makefile
	$(PYTHON) -m venv $(OFFLINE)
	$(OFFLINE)/bin/python -m pip --disable-pip-version-check --quiet install "torch==2.13.0" \
		"d3rlpy==2.8.1" "minari>=0.5.3" h5py pillow numba osqp pydantic scipy shapely typer pytest
	$(OFFLINE)/bin/python -m pip --disable-pip-version-check --quiet install --no-deps -e .
	@touch $@

offline: $(OFFLINE)/.offline
	$(OFFLINE)/bin/python -m pytest -q --noconftest -W ignore tests/agents/test_offline.py $(ARGS)

docs: $(VENV)/.dev
	$(BIN)/python -m sphinx -W --keep-going -j auto -q -d docs/_build/doctrees docs docs/_build/html $(ARGS)

speed: $(VENV)/.dev
	$(BIN)/python -m benchmarks.cost $(ARGS)

bench: $(VENV)/.dev
	$(BIN)/python -m benchmarks $(ARGS)

figures: reproduce
	mkdir -p docs
	cp results/paper/case1_path.png results/paper/case2_path.png docs/

clean:
	rm -rf $(VENV) $(RLLIB) $(OFFLINE)
