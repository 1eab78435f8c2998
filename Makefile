# `make demo` and `make test` do all their own set-up (see tools/setup.sh).
# Use another interpreter with:     make demo PYTHON=python3.12
# Pass further arguments with:      make test ARGS="-k name -x"
# One test after the other:         make test WORKERS=

VENV = .venv
ARGS =
# Tests of one file stay together, and with them what they share, until a worker has none of its own left.
WORKERS = -n auto --maxprocesses 2 --dist worksteal

.PHONY: help setup demo test test-slow hidden mutants lint clean

help:
	@echo "make demo       run the demonstration; it writes the folder demo/"
	@echo "make test       run the tests: of like cases one, some minutes on two cores"
	@echo "make test-slow  run the others: campaigns, long answers, and cases like those of make test"
	@echo "make hidden     hide every effect in data and ask for it"
	@echo "make mutants    change the code at random, and see whether the tests notice"
	@echo "make lint       check the code style"
	@echo "make clean      remove the environment, the demo and all caches"

setup:
	@sh tools/setup.sh

demo: setup
	PYTHONPATH= $(VENV)/bin/drake-ispace demo $(ARGS)

test: setup
	PYTHONPATH= PYTHONDONTWRITEBYTECODE= $(VENV)/bin/python -m pytest $(WORKERS) $(ARGS)

test-slow: setup
	PYTHONPATH= PYTHONDONTWRITEBYTECODE= $(VENV)/bin/python -m pytest -m slow $(ARGS)

hidden: setup
	PYTHONPATH= PYTHONDONTWRITEBYTECODE= $(VENV)/bin/python -m pytest -m hidden $(ARGS)

mutants: setup
	@$(VENV)/bin/python -c 'import cosmic_ray' 2>/dev/null || $(VENV)/bin/python -m pip install --quiet -e '.[test,mutants]'
	PYTHONPATH= $(VENV)/bin/python tools/mutants.py $(ARGS)

lint: setup
	@test -x $(VENV)/bin/ruff || $(VENV)/bin/python -m pip install --quiet -e '.[dev]'
	$(VENV)/bin/ruff check $(ARGS) .

clean:
	rm -rf $(VENV) demo build dist src/*.egg-info .pytest_cache .ruff_cache .hypothesis
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +
