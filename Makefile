PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test docs benchmark clean

demo: .venv/.installed
	$(BIN)/navreplay run examples/drive_0708/drive_0708.mcap -c examples/drive_0708/drive.toml -o out/drive_0708 --force

test: .venv/.tested
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2

docs: .venv/.documented
	$(BIN)/mkdocs build --strict --quiet
	@echo "site/index.html"

benchmark: .venv/.tested
	$(BIN)/python benchmarks/import_speed.py
	$(BIN)/python benchmarks/run_speed.py
	$(BIN)/python benchmarks/method_speed.py

clean:
	rm -rf .venv out build dist site *.egg-info .pytest_cache .ruff_cache .mypy_cache .hypothesis .import_linter_cache

# The installation is editable, so only a change of the requirements calls for another one.
.venv/.installed: pyproject.toml | .venv
	@echo "Installing navreplay and what it needs into .venv ..."
	$(BIN)/python -m pip install -qq --disable-pip-version-check -e .
	touch $@

.venv/.tested: pyproject.toml | .venv
	@echo "Installing navreplay and what its tests need into .venv ..."
	$(BIN)/python -m pip install -qq --disable-pip-version-check -e ".[test]"
	touch $@ .venv/.installed

.venv/.documented: pyproject.toml | .venv
	$(BIN)/python -m pip install -qq --disable-pip-version-check -e ".[docs]"
	touch $@

.venv:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "navreplay needs Python 3.11 or later; name one with make PYTHON=python3.x"; exit 1; }
	@$(PYTHON) -m venv .venv \
		|| { rm -rf .venv; echo "python3 -m venv failed; on Debian and Ubuntu: apt install python3-venv"; exit 1; }
