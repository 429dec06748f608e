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

.PHONY: validate benchmark test lint lock clean

validate: .venv/installed
	$(BIN)/python -m pytest validation -n $(JOBS) --dist loadfile $(if $(filter-out 0,$(QUICK)),--quick)

# minutes each, beside pyMOTO and Kratos; one process, so that CPU times are not those of a crowded machine
benchmark: .venv/peers
	$(BIN)/python -m pytest validation -m benchmark --benchmark

test: .venv/installed
	$(BIN)/python -m pytest tests -n $(JOBS)

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
	rm -rf .venv build *.egg-info .pytest_cache .mypy_cache .ruff_cache
