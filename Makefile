# Two targets set everything up on a fresh machine: `make book` and `make test`.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder --nbval tests notebooks

.PHONY: book pdf test test-all test-nightly quick check bench photographs lock clean

book: $(READY)  ## the executed book, in build/html
	$(BIN)/thesis book

pdf: book  ## the book as one PDF, in build; needs Chromium
	$(BIN)/thesis pdf

test: check  ## what a contributor needs, in minutes and without a book
	$(PYTEST) -m "not (slow or book or nightly)"

test-all: check book  ## all tests, those of the rendered book and all notebooks included
	$(PYTEST) -m "not nightly" --conformance build/conformance.json

quick: $(READY)  ## half a minute of tests: those that the edited files reach, the nearest first
	$(BIN)/python tests/quick.py

test-nightly: $(READY)  ## what takes an hour: thousands of inputs, kills at every step
	$(PYTEST) -m nightly

check: $(READY)  ## lint, format, types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

photographs: build/photographs/left01.jpg  ## real pictures of a board, for tests that are else skipped

build/photographs/left01.jpg: | $(READY)
	$(BIN)/python tests/foreign/photographs.py

bench: $(READY)  ## speed, as ratios measured in one run, beside the peers that are installed
	$(BIN)/python -m benchmarks

lock:  ## requirements.lock anew from pyproject.toml; needs uv
	uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
		--no-header --all-extras pyproject.toml -o requirements.lock

clean:
	rm -rf build runs data/results book/executed

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	touch $@
