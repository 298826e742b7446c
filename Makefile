# Two commands on a fresh machine: `make trainer` and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Blender's module installs for one version of Python only and wants another numpy than we do.
BLENDER := .venv-blender
BLENDER_PYTHON ?= python3.11
# A learning record store pins other versions of what our server uses.
RALPH := .venv-ralph
# What looks at dependencies is none of them.
AUDIT := .venv-audit
# What lints the page's JavaScript.
BIOME := tests/export/node_modules/.bin/biome
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

# Two, whatever the cores: each has a browser that draws in software, and with three pages were late.
# A file's fixtures are made once; pages come first: at the end short files fill what is left.
WORKERS ?= -n 2 --dist loadfile --no-loadscope-reorder

.DEFAULT_GOAL := help
.PHONY: help trainer wheel test test-all coverage check bench docs links strings screenshots soak licences audit lint prose types layers format clean

help:  ## say what can be made
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 12

trainer: $(VENV)/.runs  ## start the trainer and print its address (ARGS= is passed on)
	@$(BIN)/bluntdissect trainer $(ARGS)

wheel: $(BIN)/python  ## build dist/bluntdissect-*.whl, which pip, pipx and uvx install
	@rm -rf build
	@$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps -w dist . && rm -rf build
	@ls dist/*.whl

# Of some hundred processes that tests start, the first compiles our modules for all.
test test-all coverage: export PYTHONDONTWRITEBYTECODE :=

test: $(VENV)/.tests $(VENV)/.readers  ## run all tests
	@$(BIN)/python -m pytest $(WORKERS) $(ARGS)

test-all: $(VENV)/.tests $(VENV)/.readers $(BLENDER)/.bpy $(RALPH)/.done  ## run the long tests too (Blender: 370 MB)
	@BLENDER_PYTHON=$(BLENDER)/bin/python RALPH_PYTHON=$(RALPH)/bin/python $(BIN)/python -m pytest $(WORKERS) -m "long or not long" $(ARGS)

coverage: $(VENV)/.coverage  ## run all tests and say which lines and branches they reach
	@$(BIN)/python -m pytest $(WORKERS) --cov --cov-report=term:skip-covered $(ARGS)

check: lint prose types layers  ## lint (the page's JavaScript and the docs' prose too), types and import layers

bench: $(VENV)/.peers  ## measure what things cost on this machine, beside peers
	@$(BIN)/python -m benchmarks

docs: $(VENV)/.tests  ## build the site in site/: open site/index.html
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet

links:  ## list the links that lead out of the docs, once each (those inside are checked by `make docs`)
	@grep -rohE 'https?://[^][ )<>"`]+' *.md docs --include='*.md' | sort -u

strings: $(VENV)/.runs  ## write every string that users read, with its place, to build/strings.pot for translators
	@mkdir -p build && $(BIN)/python tests/app/page_strings.py build/strings.pot && echo build/strings.pot

screenshots: $(VENV)/.tests  ## take the pictures in docs/images (needs Chromium)
	@PYTHONPATH=tests/export $(BIN)/python tests/app/screenshots.py docs/images
	@$(BIN)/python tests/app/film.py docs/images/dissection.webp
	@$(BIN)/python examples/gallery.py docs/gallery.md docs/images/gallery
	@$(BIN)/python examples/diagrams.py docs/images

soak: $(VENV)/.soak  ## attack and load a trainer, kill writers, mutate files; write docs/reliability.md (2 hours)
	@PYTHONPATH=. $(BIN)/python tests/app/soak.py $(ARGS)

licences: $(AUDIT)/.done $(VENV)/.tests  ## list the licences of all dependencies; GPL and AGPL fail
	@$(AUDIT)/bin/pip-licenses --python $(BIN)/python --from=mixed --order=license \
		--partial-match --fail-on "GNU General Public;GNU Affero;GPL-2;GPL-3" $(ARGS)

audit: $(AUDIT)/.done  ## look the pinned dependencies up in PyPI's list of advisories
	@$(AUDIT)/bin/pip-audit --disable-pip --no-deps --strict -r constraints.txt $(ARGS)

lint: $(VENV)/.tests $(VENV)/.readers
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@if [ -x $(BIOME) ]; then $(BIOME) lint --error-on-warnings; \
		else echo "The page's JavaScript is not linted: Biome is not here, which npm installs." >&2; fi

# Off in .proselintrc.json: archaism ('Haply' is one to it), lexical_illusions (headings), needless_variants ('clip applier'), spelling
# ('--color' is an option), typography (plain quotes and dots) and weasel_words ('very large').
prose: $(VENV)/.tests
	@$(BIN)/proselint --config .proselintrc.json check *.md docs/*.md docs/tutorials/*.md

types: $(VENV)/.tests
	@$(BIN)/pyright --threads 2

layers: $(VENV)/.tests
	@$(BIN)/lint-imports

format: $(VENV)/.tests  ## sort imports and format the code
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

clean:  ## remove the virtual environment and everything built
	rm -rf $(VENV) $(BLENDER) $(RALPH) $(AUDIT) build dist site tests/export/node_modules *.egg-info .pytest_cache .coverage .ruff_cache .hypothesis .import_linter_cache

# Debian leaves ensurepip out of python3 unless python3-venv is there: pip then fills the environment.
$(BIN)/python:
	@echo "Creating $(VENV) ..."
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "Python 3.11 or newer is needed; set PYTHON=..." >&2; exit 2; }
	@$(PYTHON) -m venv $(VENV) >/dev/null 2>&1 \
		|| { $(PYTHON) -m venv --clear --without-pip $(VENV) \
		     && $(PYTHON) -m pip --quiet --python $(BIN)/python install pip; }

$(VENV)/.runs: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing the trainer ..."
	@$(PIP_INSTALL) -e .
	@touch $@

$(VENV)/.tests: pyproject.toml constraints.txt $(VENV)/.runs
	@echo "Installing what the tests need ..."
	@$(PIP_INSTALL) -e '.[test]'
	@touch $@

$(AUDIT)/.done: tests/audit-requirements.txt
	@$(PYTHON) -m venv $(AUDIT) >/dev/null 2>&1 \
		|| { $(PYTHON) -m venv --clear --without-pip $(AUDIT) \
		     && $(PYTHON) -m pip --quiet --python $(AUDIT)/bin/python install pip; }
	@$(AUDIT)/bin/python -m pip install --quiet --disable-pip-version-check \
		-r tests/audit-requirements.txt && touch $@

$(VENV)/.coverage: pyproject.toml constraints.txt $(VENV)/.tests $(VENV)/.readers
	@echo "Installing what counts lines ..."
	@$(PIP_INSTALL) -e '.[coverage]'
	@touch $@

$(VENV)/.soak: pyproject.toml constraints.txt $(VENV)/.tests
	@echo "Installing what mutates files ..."
	@$(PIP_INSTALL) -e '.[soak]'
	@touch $@

# What reads our exports, axe for the page, Biome for its scripts: left out where npm is missing.
$(VENV)/.readers: tests/export/package.json | $(BIN)/python
	@if command -v npm >/dev/null; then \
		npm install --prefix tests/export --no-package-lock --ignore-scripts --no-audit --no-fund --silent \
			&& touch $@ || echo "Going on without three.js, the glTF validator, axe and Biome." >&2; \
	fi

$(BLENDER)/.bpy: tests/export/blender-requirements.txt
	@echo "Installing Blender's module in $(BLENDER) ..."
	@$(BLENDER_PYTHON) -m venv $(BLENDER) >/dev/null 2>&1 \
		|| { $(BLENDER_PYTHON) -m venv --clear --without-pip $(BLENDER) \
		     && $(BLENDER_PYTHON) -m pip --quiet --python $(BLENDER)/bin/python install pip; }
	@$(BLENDER)/bin/python -m pip install --quiet --disable-pip-version-check \
		-r tests/export/blender-requirements.txt && touch $@

$(RALPH)/.done: tests/ralph-requirements.txt
	@echo "Installing Ralph, a learning record store, in $(RALPH) ..."
	@$(PYTHON) -m venv $(RALPH) >/dev/null 2>&1 \
		|| { $(PYTHON) -m venv --clear --without-pip $(RALPH) \
		     && $(PYTHON) -m pip --quiet --python $(RALPH)/bin/python install pip; }
	@$(RALPH)/bin/python -m pip install --quiet --disable-pip-version-check \
		-r tests/ralph-requirements.txt && touch $@

# A peer that could not be installed is said by the benchmarks, which measure the rest.
$(VENV)/.peers: pyproject.toml constraints.txt $(VENV)/.tests
	@echo "Installing the benchmarks' peers ..."
	@$(PIP_INSTALL) -e '.[bench]' && touch $@ || echo "Going on without all of them." >&2
