# make demo    set up, render a small walkthrough into runs/demo, and write its report
# make test    set up, run the tests in two processes (JOBS=4: four); installs Chromium by apt if it is missing
# make validate-metric   set up, validate the metric on published experiments with observers (seven minutes)
# make bench   set up, compare enfilade's methods with baselines on the generated scenes (BENCH=--quick: ten minutes)
# make judge   set up ColorVideoVDP in .venv-judge, for the bench (two minutes, 1.7 GB)
# make case-studies   set up, reproduce the paper's experiments, write studies/cases/README.md (PRESET=small: ten minutes)
# make blender set up, install Blender as the Python module bpy in .venv-blender (374 MB to load; two minutes)
# make addon   write dist/enfilade-addon.zip, an extension of Blender 4.2 and newer
# make check   set up, check formatting, lint, types and import rules
# make setup   create .venv with the locked versions; installs system libraries by apt if they are missing
# make lock    update requirements.lock from pyproject.toml
# make clean   remove .venv, caches and build files; runs/ is kept

VENV ?= .venv
BIN := $(VENV)/bin
DEMO ?= runs/demo
.DEFAULT_GOAL := help
.PHONY: help setup judge blender addon python libraries browser demo test validate-metric bench case-studies check format lock clean

help:
	@sed -n 's/^# //p' Makefile

setup: python libraries $(VENV)/.ready

python:
	@test -e $(VENV)/.ready || sh setup/python.sh >/dev/null

libraries:
	@sh setup/libraries.sh

$(VENV)/.ready: requirements.lock pyproject.toml setup/venv.sh setup/python.sh
	@sh setup/venv.sh $(VENV)
	@touch $@

demo: setup
	@sh setup/demo.sh $(BIN) $(DEMO)

browser:
	@sh setup/browser.sh

test: setup browser
	$(BIN)/python -m pytest -n $(or $(JOBS),2) --dist loadfile --max-worker-restart 0 $(TESTS)

validate-metric: setup
	$(BIN)/python -m studies validate $(VALIDATE)

bench: setup
	$(BIN)/python -m studies.bench $(BENCH)

judge:
	@test -e .venv-judge/.ready || sh studies/bench/colorvideovdp/setup.sh .venv-judge

blender: setup
	$(BIN)/enfilade doctor --install-blender

addon: python
	@mkdir -p dist
	@cd blender_addon && "$$(sh ../setup/python.sh)" -m zipfile -c ../dist/enfilade-addon.zip blender_manifest.toml __init__.py command.py
	@echo "dist/enfilade-addon.zip"

case-studies: setup
	$(BIN)/python -m studies.cases --preset $(or $(PRESET),full) $(CASES)

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lock: setup
	@sh setup/lock.sh $(VENV)

clean:
	rm -rf $(VENV) .venv-judge .venv-blender build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache tests/failed
	find src tests studies -name __pycache__ -type d -prune -exec rm -rf {} +
