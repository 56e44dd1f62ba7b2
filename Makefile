# Two targets set everything up on a fresh machine: `make book` and `make test`.
PYTHON ?= python3
export UV_PYTHON_DOWNLOADS := never
unexport PYTHONDONTWRITEBYTECODE  # or every process would compile what it imports: 8 s for a notebook
BIN := .venv/bin
# With the checkout's path: an environment that was copied or moved with it would run the other's code.
digest = $(firstword $(shell (pwd -P; cat $(1)) | cksum))
BOOK := .venv/.book-$(call digest,requirements/*.txt)
ALL := .venv/.all-$(call digest,requirements.lock)
UV := $(BIN)/uv pip install --quiet --python $(BIN)/python --no-deps
WHEELS := --only-binary :all: --require-hashes
LOCK := $(BIN)/uv pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes --no-header \
	--no-emit-index-url --no-emit-find-links
# Three on two processors: tests also wait, for kernels and browsers.
WORKERS ?= 3
PYTEST = $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile \
	--nbval tests $(NOTEBOOKS)
NOTEBOOKS := notebooks/beam-distance.ipynb notebooks/sound-distance.ipynb
# The folders of tests of what differs from the last commit, new files included: of src/thesis_lib/vision/ tests/vision/,
# of a notebook tests/notebook/.
EDITED = $(shell git status --porcelain | sed -nE 's,^.. (src/thesis_lib|tests)/([a-z_]+)/.*,tests/\2/,p; s,^.. notebooks/.*,tests/notebook/,p')

.PHONY: book pdf test tests test-all test-nightly test-cpus test-newest quick check bench photographs platforms lock clean

book: $(BOOK)  ## the executed book, in build/html
	$(BIN)/thesis book

pdf: book $(ALL)  ## the book as one PDF, in build; needs Chromium
	$(BIN)/thesis pdf

test: $(ALL)  ## what a contributor needs, in minutes and without a book or a browser
	$(MAKE) --no-print-directory --jobs 2 check tests

tests: $(ALL)
	$(PYTEST) -m "not (slow or book or nightly)"

test-all: check book  ## all tests but those of the night, those of the rendered book included
	$(PYTEST) -m "not nightly" --hypothesis-seed 0 --junitxml build/conformance.xml

quick: $(ALL)  ## the quick tests of the folders that you have edited since the last commit
	$(BIN)/python -m pytest -q -n 2 --dist loadfile -m "not (slow or book or nightly)" \
		$(or $(filter $(wildcard tests/*/),$(sort $(EDITED))),$(error no folder is edited: make test runs all))

test-nightly: book $(ALL)  ## what takes an hour or two: long recordings, the printed book, scatter, thousands of inputs, all notebooks
	$(BIN)/thesis pdf || echo "no PDF: the tests that read it are skipped"
	$(PYTEST) -m nightly
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --nbval notebooks
	$(BIN)/python -m pytest -m "" --hypothesis-profile night tests/runs/test_any_input.py

test-cpus: $(ALL)  ## all cubes as on other processors; takes an hour
	$(BIN)/python tests/cpus.py

test-newest: $(BOOK)  ## the tests with the newest of every dependency, in an environment of its own
	$(PYTHON) -m venv --clear build/newest
	$(BIN)/uv pip install --quiet --upgrade --python build/newest/bin/python --editable '.[book,dev]'
	build/newest/bin/python -m pytest -n $(WORKERS) --dist loadfile -m "not (slow or book or nightly)" tests

check: $(ALL)  ## lint, format, rooms, types, words
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/mypy
	$(BIN)/codespell $$(git ls-files README.md CONTRIBUTING.md CHANGELOG.md dodo.py book notebooks src)

photographs: build/photographs/left01.jpg  ## real pictures of a board, for tests that are else skipped

build/photographs/left01.jpg: | $(ALL)
	$(BIN)/python tests/scenes/foreign/photographs.py

bench: $(ALL)  ## speed, as ratios measured in one run, beside the peers that are installed
	$(BIN)/python -m benchmarks

platforms: $(BOOK)  ## whether all wheels are there for every platform and Python; asks the registry
	$(BIN)/python requirements/platforms.py

lock: $(BOOK)  ## renew all pins: one resolution of pyproject.toml, and the book's part of it
	$(LOCK) --extra book --extra pdf --extra heic --extra dev pyproject.toml -o requirements.lock
	$(LOCK) --extra book --constraint requirements.lock pyproject.toml -o requirements/book.txt
	echo distributed | $(LOCK) --constraint requirements.lock - -o requirements/scale.txt
	$(LOCK) --group install -o requirements/uv.txt
	$(LOCK) --group npm -o requirements/npm.txt

clean:
	rm -rf build runs data/results book/executed

# The environment: what the book needs, and with the tests all of requirements.lock. Named by what the
# locks say and where it is, so that only their change makes it anew, and an interrupted one is not taken for whole.
$(BOOK):
	@$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and '$(PYTHON) is too old: give one from 3.11 on, as in make PYTHON=python3.12')"
	$(PYTHON) -m venv --clear .venv
	$(BIN)/python -I -m pip install --quiet --disable-pip-version-check --no-deps $(WHEELS) -r requirements/uv.txt
	$(UV) $(WHEELS) -r requirements/book.txt
	command -v npm >/dev/null || $(UV) $(WHEELS) -r requirements/npm.txt
	$(UV) --no-build-isolation -e .
	touch $@

# Dask stands apart: wherever it is installed, xarray imports it, which costs every process a second.
$(ALL): | $(BOOK)
	$(UV) $(WHEELS) -r requirements.lock
	$(UV) $(WHEELS) --target .venv/scale -r requirements/scale.txt
	touch $@
