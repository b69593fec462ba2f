# Each target sets up what it needs first: `make demo` and `make test` work in a fresh clone.

VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/installed
export PIP_DISABLE_PIP_VERSION_CHECK := 1

# Tests that no ordinary machine can run: those that need a CUDA device or a browser.
ORDINARY := not gpu and not browser
# Bytecode is kept also where containers forbid it: tests start many processes, and pytest rewrites every test.
# Pictures of tests are small: the software rasteriser compiles shaders fast rather than well. Two tests run at a time.
TESTED := PYTHONDONTWRITEBYTECODE= GALLIVM_PERF=nopt LP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
PYTEST := $(TESTED) $(BIN)/python -m pytest --durations=10 --numprocesses 2 --dist loadfile

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo sandbox test test-slow test-all check format lint prose types wheel check-lower docs gl clean

help:  ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-14s%s\n", $$1, $$2 }' Makefile

demo: $(INSTALLED) gl  ## Draw the pictures under out/
	$(BIN)/implicit-decals demo

sandbox: $(VENV)/browser gl  ## Open the modeller and editor in the browser, with the extra `browser`
	$(BIN)/implicit-decals sandbox

test: $(INSTALLED) gl  ## Run the tests, except those that are slow or need a CUDA device or a browser
	$(PYTEST) -m "not slow and $(ORDINARY)"

test-slow: $(INSTALLED) gl  ## Run the slow tests, except those that need a CUDA device or a browser
	$(PYTEST) -m "slow and $(ORDINARY)"

test-all: test test-slow  ## Run both

check: lint prose types wheel  ## Check format, lint, prose, types and the built wheel

lint: $(INSTALLED)  ## Check format and lint, those of JavaScript where Node.js is installed
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/python .ci/check_javascript.py

prose: $(INSTALLED)  ## List words and docstrings that the style rules exclude
	$(BIN)/python .ci/check_prose.py

# setuptools installs apps/ and shaders/ as decals.apps and decals.shaders; mypy cannot read that mapping.
# It checks a tree of links that has the packages where an installed copy has them.
LINKS := build/types
MYPY = cd $(LINKS) && $(CURDIR)/$(BIN)/mypy --config-file $(CURDIR)/pyproject.toml --cache-dir $(CURDIR)/.mypy_cache
$(LINKS): FORCE
	@rm -rf $@ && mkdir -p $@/decals
	@ln -s $(CURDIR)/blobtree $(CURDIR)/tests $@/
	@ln -s $(CURDIR)/decals/* $(CURDIR)/apps $(CURDIR)/shaders $@/decals/
FORCE:

types: $(INSTALLED) $(LINKS)  ## Check types, those of the tests too
	$(MYPY) -p blobtree -p decals -p tests

wheel: $(INSTALLED)  ## Compile the kernels, build the wheel and try it outside the checkout
	$(BIN)/python .ci/check_wheel.py

check-lower: $(INSTALLED) gl  ## Run the tests with the oldest dependencies that pyproject.toml allows
	$(BIN)/python .ci/check_lower.py

docs: $(INSTALLED) gl  ## Build the documentation under build/docs, with the extra `docs`
	$(BIN)/python -m pip install --quiet --editable '.[dev,docs]'
	$(BIN)/python -m sphinx -E -W --keep-going -b html docs build/docs

format: $(INSTALLED)  ## Format the code and apply lint's automatic corrections
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/python .ci/check_javascript.py --fix

gl: | $(BIN)/python
	@.ci/install-gl $(BIN)/python

clean:  ## Remove all generated files, the environment included
	rm -rf $(VENV) build dist out blobtree/compiled *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/python:
	@.ci/make-venv $(VENV)

# An editable install: repeated only after a change of pyproject.toml.
# setuptools warns at each that a folder may hide the package; here the folder is the package.
$(INSTALLED): pyproject.toml | $(BIN)/python
	@echo "Installing the dependencies of pyproject.toml into $(VENV): the first time 1.5 GB, some minutes"
	@PYTHONWARNINGS="ignore:Editable installation" $(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@

$(VENV)/browser: $(INSTALLED)
	@echo "Installing what the sandbox needs into $(VENV)"
	@PYTHONWARNINGS="ignore:Editable installation" $(BIN)/python -m pip install --quiet --editable '.[dev,browser]'
	@touch $@
