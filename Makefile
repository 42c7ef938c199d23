# make demo    set up, render a small walkthrough into runs/demo, and a page that shows it
# make test    set up, run the tests, two files at a time (JOBS=4: four); Chromium, which tests the page, by apt where it is missing
# make validate-metric   set up, judge the metric by what people saw
# make bench   set up, race our methods against their rivals on ROOM and ATRIUM; it says first how long it takes
# make case-studies   set up, run the paper's experiments again, write studies/cases/README.md; PRESET=small is quick
# make check   set up, run format, lint, type and import-floor checks
# make setup   only set up: .venv with locked versions, and system libraries by apt where they are missing
# make lock    write requirements.lock anew from pyproject.toml
# make clean   remove what the above have made; runs/ stays

VENV ?= .venv
BIN := $(VENV)/bin
DEMO ?= runs/demo
.DEFAULT_GOAL := help
.PHONY: help setup python libraries browser demo test validate-metric bench case-studies check format lock clean

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
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache tests/failed
	find src tests studies -name __pycache__ -type d -prune -exec rm -rf {} +
