# Two commands: `make validate` regenerates the report, `make test` runs the tests. Python 3.11+, make and git suffice.
PYTHON ?= python3
# studies and tests run beside each other, one process for each core
JOBS ?= auto
# QUICK=1 leaves out the studies' long tests; what they last recorded stays in the report
QUICK ?=
BIN := .venv/bin
# one thread per process: a second BLAS thread gains little at these sizes and loses much on a busy machine
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1
export MKL_NUM_THREADS ?= 1

.PHONY: validate paper benchmark test lowest lint lock clean

validate: .venv/installed
	$(BIN)/python -m pytest validation -n $(JOBS) $(if $(filter-out 0,$(QUICK)),--quick)
	$(BIN)/python -m validation readme

# the pages about the paper's own figures only; of the others the report keeps what they last recorded
paper: .venv/installed
	$(BIN)/python -m pytest validation -n $(JOBS) --group "The paper" $(if $(filter-out 0,$(QUICK)),--quick)
	$(BIN)/python -m validation readme

# finest levels, sweeps, hostile inputs in full, times beside pyMOTO and Kratos; one process, so that CPU times are not
# those of a crowded machine. One study of it: pytest validation/studies/stability --benchmark -m benchmark -n auto
benchmark: .venv/peers
	$(BIN)/python -m pytest validation -m benchmark --benchmark

# each process takes neighbouring tests, which share what is costly to set up; one that is done takes over from another
test: .venv/installed
	$(BIN)/python -m pytest tests -n $(JOBS) --dist worksteal

# a short part of the tests with the lowest versions that pyproject.toml admits, on the lowest Python where it is there
lowest: .lowest/installed
	.lowest/bin/python -m pytest -n $(JOBS) -m "not slow" $(LOWEST_TESTS)

LOWEST_PYTHON ?= $(shell command -v python3.11 || echo $(PYTHON))
# what has failed with old versions: scikit-fem's use, files, pictures, the report, Dask; and a run of each solver
LOWEST_TESTS ?= tests/methods tests/mpmtop/test_export.py tests/mpmtop/test_plot.py tests/reference_fem/test_elasticity.py \
  tests/reference_fem/test_hole.py tests/reference_fem/test_quads.py tests/reference_fem/test_simp.py \
  tests/studies/test_scatter.py tests/harness/test_report.py

.lowest/installed: pyproject.toml .ci/lowest.py
	$(LOWEST_PYTHON) -m venv .lowest || $(LOWEST_PYTHON) -m venv --without-pip .lowest
	$(LOWEST_PYTHON) .ci/lowest.py >.lowest/constraints.txt
	if command -v uv >/dev/null; then \
	  uv pip install --python .lowest/bin/python -c .lowest/constraints.txt -e '.[test]'; \
	else $(LOWEST_PYTHON) -m pip --python .lowest/bin/python install -q --disable-pip-version-check \
	  -c .lowest/constraints.txt -e '.[test]'; fi
	touch $@

lint: .venv/installed
	$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

# uv if it is there (2 s), else pip (20 s), also on a Python whose venv brings no pip
.venv/installed: pyproject.toml requirements.lock
	$(PYTHON) -m venv .venv || $(PYTHON) -m venv --without-pip .venv
	$(call install,test$(comma)dev)
	touch $@

.venv/peers: .venv/installed
	$(call install,test$(comma)dev$(comma)peers)
	touch $@

comma := ,
define install
	if command -v uv >/dev/null; then uv pip install --compile-bytecode --python $(BIN)/python -c requirements.lock -e '.[$(1)]'; \
	else $(PYTHON) -m pip --python $(BIN)/python install -q --disable-pip-version-check -c requirements.lock -e '.[$(1)]'; fi
endef

lock:
	uv pip compile -q --universal --python-version 3.11 --all-extras --no-emit-index-url --no-annotate \
	  --custom-compile-command "make lock" pyproject.toml -o requirements.lock

clean:
	rm -rf .venv .lowest build *.egg-info .pytest_cache .mypy_cache .ruff_cache
