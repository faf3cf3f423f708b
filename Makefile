# make demo   set up .venv and reconstruct the bundled part
# make test   set up .venv with the test tools and run the whole suite
# make check  what CI runs: ruff, pyright, import-linter, the suite
# make bench BENCH=folder [ARGS="--jobs 2 --scorer score.py"]   measure a folder of parts
# make bench-gate   refuse speed ratios, shares of the peak and counts of the bundled parts that are worse than benchmarks/baseline.json

PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt
# to bytecode, as an installation that is not editable is: where Python is told to write none, each process does it again in half a second
COMPILED := @$(BIN)/python -m compileall -q src
# one thread per process: several processes share the cores
export OMP_NUM_THREADS ?= 1

.PHONY: demo test check lint bench bench-gate

demo: .venv/use
	$(BIN)/python infer.py input=dataset/examples/bracket.stl output=out/demo

# three workers on two cores: a sixth of the time of two went into waiting for browsers and other tools; tests/conftest.py says who runs what
test: .venv/develop .venv/kernels
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder

# compiled once here: two workers with a browser each, and the processes that they keep ready, would all compile at the same time; a cloud
# that compiles takes most of its time for that, and ends with status 3, as a result that is not the part
.venv/kernels: .venv/develop $(shell find src -name '*.py')
	$(COMPILED)
	@$(BIN)/python -m imdim.delivery.first_run all
	@touch $@

check: lint test

lint: .venv/develop
	$(BIN)/ruff check .
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports --no-logo

bench: .venv/use
	@test -n "$(BENCH)" || { echo "give a folder of parts: make bench BENCH=folder"; exit 2; }
	$(BIN)/python scripts/bench/benchmark.py $(BENCH) $(ARGS)

bench-gate: .venv/use
	$(BIN)/python scripts/bench/gate.py

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed, $$($(PYTHON) --version 2>&1) found: make demo PYTHON=python3.12"; exit 2; }
	$(PYTHON) -m venv .venv

.venv/use: pyproject.toml constraints.txt | .venv/bin/python
	@echo "Installing into .venv (some 2 GB, a few minutes the first time)"
	$(PIP) -e '.[step,learn]'
	$(COMPILED)
	@$(BIN)/python -m imdim.delivery.first_run all
	@touch $@

.venv/develop: pyproject.toml constraints.txt | .venv/bin/python
	@echo "Installing into .venv (some 2 GB, a few minutes the first time)"
	$(PIP) -e '.[step,learn,lab,agent,dev]'
	$(COMPILED)
	@touch $@ .venv/use
