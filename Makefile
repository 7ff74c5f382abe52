# Every target first makes the environment .venv; see tools/setup.sh. Once made, that costs nothing.
BIN := .venv/bin
STAMP := .venv/.stamp

.PHONY: demo test test-quick lint format references stress docs bench lock clean

demo: $(STAMP)  ## render the Cornell box
	@mkdir -p out
	@$(BIN)/drpt-render cornell-box --spp 256 --bounces 2 --mode explicit \
		-o out/cornell-box.exr -o out/cornell-box.png

test: $(STAMP)  ## every test; those of the browser need Chromium, which is installed if it may be
	@tools/browser.sh
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

test-quick: $(STAMP)  ## the tests that take no more than a few seconds
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder -m "not slow"

lint: $(STAMP)  ## what CI checks before the tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(STAMP)  ## let ruff write the code's format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

references: $(STAMP)  ## make Mitsuba's pictures in reference/ again, a quarter of an hour
	$(BIN)/python -m reference.make

stress: $(STAMP)  ## numbers at the edges: a table of errors and bounds; fails where one is exceeded
	$(BIN)/python -m benchmarks.stress

docs: $(STAMP) out/docs/gallery/index.html  ## build the documentation to out/docs, the gallery too
	$(BIN)/python -m sphinx -b html -W --keep-going -q docs out/docs

out/docs/gallery/index.html: $(shell find src/drpt scenes -type f -not -name '*.pyc') | $(STAMP)
	$(BIN)/drpt gallery -o $(@D)

bench: $(STAMP)  ## error against time, beside Mitsuba: tables and plots in out/bench, 40 minutes
	$(BIN)/python -m benchmarks.bench

lock:  ## take the newest versions that pyproject.toml allows
	@tools/lock.sh

clean:  ## remove everything that was made here
	rm -rf .venv out dist build .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(STAMP): pyproject.toml constraints.txt tools/setup.sh
	@tools/setup.sh
