# `make demo` and `make test` do all the set-up they need on a fresh machine.
PYTHON ?= python3
BIN := .venv/bin
DEMO_OUT ?= results/demo

.PHONY: demo test lint bench clean

.venv/.installed: pyproject.toml
	$(PYTHON) -m venv --clear .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --editable '.[test]'
	touch $@

demo: .venv/.installed
	$(BIN)/reconros demo --out $(DEMO_OUT) $(DEMO_ARGS)

test: .venv/.installed
	$(BIN)/python -m pytest

lint: .venv/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: .venv/.installed
	for benchmark in tests/benchmarks/[a-z]*.py; do $(BIN)/python $$benchmark || exit 1; done

clean:
	rm -rf .venv build *.egg-info results
