# Every target sets up what it needs first: `make demo` and `make test` work in a fresh clone.

VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/installed
# Compiled Warp kernels live and die with the environment that compiled them.
export WARP_CACHE_PATH ?= $(CURDIR)/$(VENV)/warp-cache
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test check format lint types wheel check-lower gl clean

help:  ## Say what each target does
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-14s%s\n", $$1, $$2 }' Makefile

demo: $(INSTALLED) gl  ## Draw the pictures under out/
	$(BIN)/implicit-decals demo

test: $(INSTALLED) gl  ## Run the tests, less the slow ones and those that need a CUDA device or a browser
	$(BIN)/python -m pytest -m "not slow and not gpu and not browser"

check: lint types wheel  ## Check format, lint, types and the built wheel

lint: $(INSTALLED)  ## Check format and lint
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

# setuptools maps apps/ and shaders/ to implicit_decals.*; mypy reads no such mapping, so it is shown a tree
# that has the packages where an installed copy has them (pyproject.toml puts it on mypy's path).
types: $(INSTALLED)  ## Check types
	@mkdir -p build/types/implicit_decals
	@ln -sfn ../../../apps build/types/implicit_decals/apps
	@ln -sfn ../../../shaders build/types/implicit_decals/shaders
	$(BIN)/mypy -p blobtree -p decals -p implicit_decals.apps -p implicit_decals.shaders

wheel: $(INSTALLED)  ## Build the wheel and try it outside the checkout
	$(BIN)/python .ci/check_wheel.py

check-lower: $(INSTALLED) gl  ## Run the tests with the oldest dependencies that pyproject.toml allows
	$(BIN)/python .ci/check_lower.py

format: $(INSTALLED)  ## Format the code and mend what lint can mend
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

gl: | $(BIN)/python
	@.ci/install-gl $(BIN)/python

clean:  ## Remove everything that is made, the environment included
	rm -rf $(VENV) build dist out *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/python:
	@.ci/make-venv $(VENV)

# An editable install: only a changed pyproject.toml asks for another one.
# setuptools warns at each that a folder may hide the package; here the folder is the package.
$(INSTALLED): pyproject.toml | $(BIN)/python
	@echo "Installing what pyproject.toml asks for into $(VENV): the first time 1.5 GB, in some minutes"
	@PYTHONWARNINGS="ignore:Editable installation" $(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@
