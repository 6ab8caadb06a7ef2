# Needs Python 3.10 to 3.13 and make, nothing else. `make demo PYTHON=python3.12` chooses the interpreter.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT := out
# What `make profile` measures: a bundled scene's name or a file, and a method if not the scene's own.
SCENE ?= pool
METHOD ?=
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.DEFAULT_GOAL := help
.PHONY: help demo test bench profile lint clean

help:
	@echo "make demo   render the bundled beach into $(OUT)/"
	@echo "make test   run the whole test suite"
	@echo "make bench  measure error, time and memory into bench/results/ and docs/tables/, hours"
	@echo "make profile SCENE=pool [METHOD=beam]  print where a frame's time and memory go, and write it into $(OUT)/"
	@echo "make lint   ruff and mypy"
	@echo "make clean  remove what the other targets made, except $(VENV)/"

demo: $(VENV)/.installed
	@mkdir -p $(OUT)
	@$(BIN)/warp-caustics render beach -o $(OUT)/beach.exr -o $(OUT)/beach.png

# Files are spread over all cores: tests of a file share its kernels.
test: $(VENV)/.installed-test
	$(BIN)/python -m pytest -n auto --dist loadfile

# The ladders come first: every form of each sum in one table. The comparisons of two scenes alone are ten minutes on
# two cores, and the largest light views a minute a frame; growth has maps of 4096 x 4096 pixels. Mitsuba and Numba are
# measured where they are installed (`pip install '.[peer]'`). Timings want an idle machine.
bench: $(VENV)/.installed-test
	@set -e; folder="$$($(BIN)/python bench/compare_scenes.py --folder)"; \
	  $(BIN)/python bench/ladders.py -o "$$folder/ladders"; \
	  $(BIN)/python bench/threads.py -o "$$folder/threads.json"; \
	  $(BIN)/python bench/growth.py -o "$$folder/growth"; \
	  $(BIN)/python bench/compare_scenes.py; \
	  $(BIN)/python -m pytest bench --benchmark-only --benchmark-json="$$folder/frames.json"; \
	  $(BIN)/python bench/leaving_out.py -o "$$folder/leaving_out"; \
	  $(BIN)/python bench/gather_terrain.py -o docs/tables; \
	  $(BIN)/python bench/comparators.py -o docs/tables; \
	  $(BIN)/python bench/cascades.py -o docs/tables; \
	  $(BIN)/python bench/stability/run.py -o "$$folder/stability"; \
	  $(BIN)/python bench/stability/stiff.py -o "$$folder/stability"; \
	  $(BIN)/python bench/ratio.py -o "$$folder/ratio"

profile: $(VENV)/.installed
	@mkdir -p $(OUT)
	@$(BIN)/warp-caustics render "$(SCENE)" $(if $(METHOD),--method $(METHOD)) --profile \
	  -o "$(OUT)/$(notdir $(basename $(SCENE))).profile.json"

lint: $(VENV)/.installed-lint
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

clean:
	rm -rf $(OUT) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks
	find warp_caustics kernels tests bench examples -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamps live in the environment, so that removing it removes them too. The install is editable: only a changed
# pyproject.toml asks for another one.
$(VENV)/.installed: EXTRAS :=
$(VENV)/.installed-test: EXTRAS := [test]
$(VENV)/.installed-lint: EXTRAS := [dev,test]

$(VENV)/.installed $(VENV)/.installed-test $(VENV)/.installed-lint: pyproject.toml | $(BIN)/python
	@echo "Installing warp-caustics$(EXTRAS) into $(VENV)/ ..."
	@$(PIP_INSTALL) --editable '.$(EXTRAS)'
	@touch $@

$(BIN)/python:
	@command -v "$(PYTHON)" >/dev/null || { \
	  echo "error: '$(PYTHON)' was not found; name a Python 3.10 to 3.13: make $(MAKECMDGOALS) PYTHON=/path/to/python" >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] < (3, 14))' || { \
	  echo "error: Python 3.10 to 3.13 is needed, and '$(PYTHON)' is $$("$(PYTHON)" -V 2>&1); name another: make $(MAKECMDGOALS) PYTHON=python3.12" >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "error: '$(PYTHON)' cannot make environments: it lacks venv or ensurepip (Debian and Ubuntu: apt-get install python3-venv)" >&2; exit 1; }
	@echo "Making $(VENV)/ with $(PYTHON) ..."
	@"$(PYTHON)" -m venv $(VENV) || { rm -rf $(VENV); exit 1; }
