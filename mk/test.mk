# SPDX-License-Identifier: GPL-2.0-or-later
# Tests. tests/unit/NAME/*.c test a layer or a module of lib/, the parts of driver/ that build without a
# kernel, and shared parts of tools/; tests/cli runs the real programs.

unit_sources := $(filter-out $(if $(has_libmnl),,tests/unit/can/socketcan%) \
	$(if $(has_libiio),,tests/unit/daq/iio_%) $(if $(has_comedilib),,tests/unit/daq/comedi_%) \
	$(if $(has_libusb),,%/polhemus_usb.c) \
	$(if $(has_vision),,tests/unit/vision/%) $(if $(has_frames),,tests/unit/mkv/% tests/unit/film/%) \
	$(if $(has_hdf5),,tests/unit/hdf5/%) $(if $(has_view),,tests/unit/view/%),\
	$(wildcard tests/unit/*/*.c))
# WITHOUT: names of some that are left out.
unit_programs := $(filter-out $(WITHOUT:%=$(O)/tests/unit/%),$(patsubst tests/%.c,$(O)/tests/%,$(unit_sources)))

# A tracker that is not there: some tests, and a program of its own.
emulator := $(O)/obj/tests/polhemus/emulator.o

# LAPACK is the reference of numerical tests; nothing else links it.
test_packages := cmocka jansson lapacke lapack blas $(if $(has_libmnl),libmnl) $(if $(has_libiio),libiio) \
	$(if $(has_comedilib),comedilib) $(if $(has_libusb),libusb-1.0) \
	$(if $(has_frames),$(pc_frames_mkv)) $(if $(has_hdf5),$(pc_export_hdf5)) \
	$(foreach lib,$(libraries),$(pc_$(lib)))
test_cflags = $(eval test_cflags := $(shell $(PKG_CONFIG) --cflags $(test_packages)))$(test_cflags)
# The reference for messages of OpenIGTLink; it has no file of pkg-config.
has_igtl := $(wildcard /usr/include/openigtlink/igtl_header.h)
# A test maps only what it uses of these.
test_libs = $(eval test_libs := -Wl,--as-needed $(shell $(PKG_CONFIG) --libs $(test_packages)) \
	$(if $(has_vision),$(libs_vision_opencv)) $(if $(has_igtl),-lOpenIGTLink) -lm -ldl -pthread)$(test_libs)

$(O)/obj/tests/%.o: tests/%.c
	@mkdir -p $(@D)
	$(call step,CC)
	$(Q)$(CCACHE) $(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 -ffp-contract=off $(warnings) \
		-Wno-missing-prototypes -Wno-unused-parameter $(test_cflags) $(CFLAGS) -MMD -MP -c -o $@ $<

# A test that defines __wrap_NAME plays NAME for all that it is linked to.
wraps = $$(nm $(filter %/$*.o,$^) | sed -n 's/.* T __wrap_\(.*\)/-Wl,--wrap=\1/p')
$(filter $(O)/tests/unit/tools/%,$(unit_programs)): $(tool_parts)
$(filter $(O)/tests/unit/scene/% $(O)/tests/unit/tools/%,$(unit_programs)): $(extremes)
$(filter $(O)/tests/unit/polhemus/%,$(unit_programs)): $(emulator)
# Modules that only their own tests link, ahead of the archive: that of HDF5, and vision's,
# which is then found without being loaded.
$(filter $(O)/tests/unit/hdf5/%,$(unit_programs)): $(objects_export_hdf5)
$(filter $(O)/tests/unit/vision/%,$(unit_programs)): $(O)/obj/tests/vision/linked.o
$(O)/tests/unit/%: $(O)/obj/tests/unit/%.o $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(CFLAGS) $(LDFLAGS) $(wraps) -o $@ $(filter %.o,$^) $(filter %/extremes.a %/parts.a,$^) \
		$(O)/lib/libincise-tests.a $(test_libs)
.SECONDARY: $(unit_programs:$(O)/tests/%=$(O)/obj/tests/%.o)

$(O)/tests/polhemus/fastrak: $(wildcard tests/polhemus/*.[ch])
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ \
		$(filter %.c,$^) -lm -pthread

# What `check` is made of: each part is a target, timed. Those of the first line build what the
# others use, in one make: two would write the same objects. Of the others one more runs than there
# are processors, as some wait for devices, or as many as -j says. A part that fails keeps none from
# running but those that use what it builds.
times := $(O)/times
jobs = $(if $(findstring --jobserver,$(MAKEFLAGS)),,-j$(shell expr $$(nproc) + 1))
check-parts:
	+@status=0; \
	$(MAKE) $(jobs) -k --no-print-directory $(addprefix timed-,check-style cli-needs) || status=$$?; \
	$(MAKE) $(jobs) -k --no-print-directory $(addprefix timed-,$(parts) cli-tests check-vm check-layers \
		waiting-tests check-fuzz check-rtsan check-deb check-module) || status=$$?; \
	exit $$status
timed-%:
	+@$(if $(filter $*,cli-tests waiting-tests check-layers check-vm),NEEDS=cli-needs) tests/timed $(times) $* $(MAKE) -k --no-print-directory $*

check_deps = mk/deps build check demo; \
	mk/deps vm || echo "going on without what the test bed needs"; \
	mk/deps module || echo "going on without what checking the module needs"; \
	mk/deps rtsan || echo "going on without RealtimeSanitizer"; \
	mk/deps deb debian || echo "going on without what building packages needs"
in_parts = +@set -e; $(check_deps); mkdir -p $(O); rm -rf $(times) $(times).logs; status=0; \
	tests/timed $(times) whole $(MAKE) --no-print-directory check-parts $1 || status=$$?; \
	tests/timed $(times); exit $$status

check: ## install what is missing, build, and test
	@echo "left out, and run by make check-all: $$(cat tests/cli/*.bats | grep -c test_tags=slow) slow tests" \
		"of benches, most unit tests again without sanitizers, the slowest again with them, most cases of their properties," \
		"packages that are optimized," \
		"ThreadSanitizer, nine of ten fuzz runs, full attacks on recordings, the test bed's own tests," \
		"the boots of the second kernel, of two processors and of systemd with the service, long tests of the" \
		"first one, its modules, checkpatch," \
		"the tests of Python once more under sanitizers, two guests with clocks of their own"
	$(call in_parts,parts=check-unit-once cli_filter="--filter-tags '!slow'" \
		FUZZ_RUNS=4000 deb_options="noopt noautodbgsym" vm_boots=main:deterministic vm_bed= INCISE_VM_SHORT=1 module_kernels=main)

check-all: ## the same with all tests in all builds, on all kernels: an hour
	$(call in_parts,parts="check-sanitize check-unit check-tsan check-clocks" ATTACK=full)

# For tests whose outcome may be left to chance; the load is whatever the machine has else to do.
N ?= 20
check-repeat: ## PART=check-fuzz N=20: a part of check so many times, with what failed
	@mkdir -p $(O)/repeat
	+@failed=0; for i in $$(seq $(N)); do \
		log=$(O)/repeat/$(PART).$$i; \
		if $(MAKE) --no-print-directory $(PART) >$$log 2>&1; then echo "$$i of $(N): passed"; \
		else failed=$$((failed + 1)); echo "$$i of $(N): FAILED, see $$log"; \
			grep -E '^(not ok|FAIL)' $$log; fi; \
	done; echo "$(PART): $(N) times, $$failed failed"; [ $$failed = 0 ]

# A locale with a decimal comma, to show that files do not depend on it.
locale := $(O)/locale/de_DE.UTF-8
$(locale):
	@mkdir -p $(@D)
	$(Q)localedef -i de_DE -f UTF-8 $@

# Programs that cannot be built are failures of their own; the others run.
check-unit: $(locale) ## unit tests
	+@status=0; $(MAKE) -k --no-print-directory unit-programs || status=$$?; \
		LOCPATH=$(abspath $(O)/locale) LSAN_OPTIONS=suppressions=$(abspath tests/unit/lsan.supp):print_suppressions=0 \
		tests/unit/run $(unit_programs) || status=$$?; exit $$status

unit-programs: $(unit_programs)

# The CAN drive that tests talk to is on python-canopen, in a folder of its own.
can-drive: ## the CAN drive of the tests, $(O)/tests/can/drive; see tests/can/README.md
	@tests/venv tests/can $(O)/tests/can 'tests with the CAN drive are skipped' drive selftest

# The reader of MCAP's own makers, and one of ROS 2, for what is exported.
mcap-reader: ## other readers for the tests of MCAP, $(O)/tests/mcap/check and ros2
	@tests/venv tests/mcap $(O)/tests/mcap 'tests read MCAP with our own reader alone' check:--package ros2

# What reads Arrow streams in place, for the tests of incise for Python.
python-peers: ## pyarrow, polars, DuckDB, pandas 3 and scikit-learn for the tests of python/
	@tests/venv tests/python $(O)/tests/python 'tests with pyarrow, polars, DuckDB, pandas 3 and scikit-learn are skipped'

# Programs of others that send and receive streams over a network.
receiver := $(wildcard /usr/share/doc/openigtlink-examples/examples/Receiver/ReceiveClient.cxx)
stream-peers: $(if $(has_igtl),$(if $(receiver),$(O)/tests/streams/ReceiveClient))
stream-peers: ## pylsl, with liblsl, pyigtl, and a client of libopenigtlink for tests of streams
	@tests/venv tests/streams $(O)/tests/streams 'tests with streams of LSL and pyigtl are skipped' lsl_send lsl_receive igtl_send

$(O)/tests/streams/ReceiveClient: $(receiver)
	@mkdir -p $(@D)
	$(call step,CXX)
	$(Q)$(CXX) -O1 -w -I/usr/include/openigtlink -o $@ $< -lOpenIGTLink

# Attacks on recordings. What is in a module is found by INCISE_MODULE_PATH.
attack_programs := $(addprefix $(O)/tests/attack/,kill faults damage record statement watch.so stall.so)

$(addprefix $(O)/tests/attack/,kill faults): tests/attack/round.c
$(O)/tests/attack/%: tests/attack/%.c $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) -MMD -MP -MF $@.d \
		$(LDFLAGS) -o $@ $(filter %.c,$^) $(O)/lib/libincise-tests.a $(test_libs)

# Loaded into the real programs; under a sanitizer it would have to come behind its library.
$(O)/tests/attack/%.so: tests/attack/%.c
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 -fPIC $(warnings) -Wno-missing-prototypes \
		$(CFLAGS) -MMD -MP -MF $@.d -shared $(LDFLAGS) -o $@ $< -ldl \
		$(shell $(PKG_CONFIG) --libs sqlite3)

# A loop that publishes its state, for tests of readers.
$(O)/tests/state/loop: tests/state/loop.c $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ $^ \
		$(test_libs)

bats = LOCPATH=$(abspath $(O)/locale) INCISE_BUILD=$(abspath $(O)) CC="$(CC)" CXX="$(CXX)" \
	bats --print-output-on-failure
check-attack: all $(attack_programs) ## attacks on recordings with their full counts: 100 kills, thousands of faults
	ATTACK=full $(bats) tests/attack

# Benches measure for seconds: tests that are tagged slow are not in `check`.
cli-needs: all $(locale) can-drive mcap-reader python-peers stream-peers $(O)/tests/polhemus/fastrak $(O)/tests/state/loop \
		$(O)/tests/day $(attack_programs)

check-cli: cli-needs ## command-line tests of the real programs
	+@$(MAKE) --no-print-directory cli-tests waiting-tests

# Without building first; `check` starts with these. The tests of bench_all leave their reports to
# those of each benchmark. Those that mostly wait, for buses, networks and disks, run beside the others.
waiting_files = $(addprefix tests/cli/,can.bats capture_streams.bats infile.bats serve.bats sign.bats \
	sources.bats status.bats streams.bats supervised.bats wall.bats) tests/attack
cli_files = tests/cli/bench_all.bats $(filter-out %/bench_all.bats $(waiting_files),\
	$(sort $(wildcard tests/cli/*.bats)))
cli-tests:
	@$(if $(cli_filter),echo "left out: slow tests of benches; make check-cli runs them; bench_all.bats runs each word once")
	$(Q)$(bats) $(cli_filter) $(cli_files)

waiting-tests:
	$(Q)$(bats) $(cli_filter) $(waiting_files)

# The unit tests once more, on a build that stops at any bad access or undefined operation.
sanitize_flags := -fsanitize=address,undefined -fno-sanitize-recover=all
skipped_there := $(O)/sanitize/skipped
check-sanitize: ## unit tests and tests of Python under AddressSanitizer and UBSan
	+@status=0; $(MAKE) --no-print-directory check-unit-sanitized || status=$$?; \
		$(MAKE) --no-print-directory check-python-sanitize || status=$$?; exit $$status

check-unit-sanitized:
	@mkdir -p $(O)/sanitize
	+@SKIPPED=$(abspath $(skipped_there)) $(MAKE) --no-print-directory O=$(O)/sanitize \
		CFLAGS="-O1 -g1 $(sanitize_flags)" LDFLAGS="$(sanitize_flags)" check-unit

# Python's own memory is not of interest: its objects of the end of the program count as leaks.
check-python-sanitize: all ## tests of incise for Python on libraries under AddressSanitizer and UBSan
	+@$(MAKE) --no-print-directory O=$(O)/sanitize \
		CFLAGS="-O1 -g1 $(sanitize_flags)" LDFLAGS="$(sanitize_flags)" libs
	cd tests/python && INCISE_BUILD=$(abspath $(O)) INCISE_LIBDIR=$(abspath $(O))/sanitize/lib \
		LD_PRELOAD=$$($(CC) -print-file-name=libasan.so) ASAN_OPTIONS=detect_leaks=0 \
		PYTHONPATH=../../python PYTHONDONTWRITEBYTECODE=1 \
		/usr/bin/python3 -m unittest test_recording test_model test_plan

# Plainly, after that, those that skipped something there, those that do less there and so
# name __SANITIZE_ADDRESS__, and those about bits, which are of the flags that are shipped.
# Those of many ticks, the slowest, only plainly.
plain_only := scene/extreme scene/choose scene/inputs scene/rest
plain_programs = $(sort $(filter $(plain_only:%=$(O)/tests/unit/%) $(O)/tests/unit/fixed/% $(O)/tests/unit/model/% \
	$(patsubst tests/%.c,$(O)/tests/%,$(shell grep -l __SANITIZE_ADDRESS__ $(unit_sources))) \
	$(addprefix $(O)/tests/unit/,$(shell cat $(skipped_there))),$(unit_programs)))
check-unit-once: ## check-unit-sanitized, and of check-unit what differs plainly
	+@status=0; $(MAKE) --no-print-directory check-unit-sanitized WITHOUT="$(plain_only)" || status=$$?; \
		$(MAKE) --no-print-directory check-unit-plain || status=$$?; exit $$status

check-unit-plain:
	@echo "unit tests: all but $(words $(plain_only)) ran under the sanitizers; plainly run $(words $(plain_programs)) that skip" \
		"or do less there, are left out there, or are about bits; make check-unit runs all"
	+@$(MAKE) --no-print-directory check-unit unit_programs="$(plain_programs)"

# Threads that share memory without a lock, under ThreadSanitizer; what is not of the page
# comes from the library as it is.
tsan_programs := $(O)/tests/tsan/loop/state_reader
$(tsan_programs): tests/unit/loop/state_reader.c $(wildcard lib/loop/state_*.c) lib/device/thread.c $(O)/lib/libincise.so
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) -Wno-missing-prototypes \
		-Wno-unused-parameter -Wno-tsan $(shell $(PKG_CONFIG) --cflags cmocka) -O1 -g \
		-fsanitize=thread -MMD -MP -MF $@.d -o $@ $(filter %.c,$^) -L$(O)/lib \
		-Wl,-rpath,$(abspath $(O)/lib) -lincise $(shell $(PKG_CONFIG) --libs cmocka) -lm

check-tsan: $(tsan_programs) ## what threads share without a lock, under ThreadSanitizer
	@tests/unit/run $(tsan_programs)

style_sources := $(shell find lib tools tests driver examples -name '*.[ch]' -o -path 'lib/*.cc' 2>/dev/null)
check-style: ## the house's form: clang-format, an SPDX line in every file
	@tests/style $(style_sources)

check-layers: libs ## no layer of lib/ uses a higher one
	@tests/layers $(O)

doc: ## reference of the public headers in build/doc/html; fails where a comment is missing
	@mk/deps doc
	@mk/doc $(abspath $(O))/doc $(version)
	@cd $(O)/doc/html && PYTHONPATH=$(abspath python) PYTHONDONTWRITEBYTECODE=1 \
		python3 -m pydoc -w incise $(patsubst python/incise/%.py,incise.%,$(filter-out \
		python/incise/_% python/incise/sklearn.py,$(wildcard python/incise/*.py))) >/dev/null
	@echo $(O)/doc/html/index.html and $(O)/doc/html/incise.html, of incise for Python

# The documents of the notebooks, with figures; tests only run the code.
notebooks: all ## run doc/notebooks and write them with their figures to build/notebooks
	@tests/venv doc/notebooks $(O)/notebooks 'no notebooks are written'
	@for source in doc/notebooks/*.py; do \
		name=$$(basename $$source .py); \
		PATH=$(abspath $(O))/bin:$(abspath $(O))/notebooks/venv/bin:$$PATH PYTHONPATH=$(abspath python) \
			sh -ec 'jupytext -q --to ipynb -o $(O)/notebooks/$$0.ipynb doc/notebooks/$$0.py; \
			jupyter nbconvert --log-level ERROR --to notebook --execute --inplace \
			--ExecutePreprocessor.kernel_name=python3 $(O)/notebooks/$$0.ipynb; \
			jupyter nbconvert --log-level ERROR --to markdown --output-dir $(O)/notebooks \
			$(O)/notebooks/$$0.ipynb' $$name || exit 1; \
		echo $(O)/notebooks/$$name.md; \
	done

check-doc: doc

.PHONY: doc notebooks check-doc check check-all check-parts check-repeat check-style check-layers check-unit check-unit-once check-unit-plain unit-programs check-cli cli-needs cli-tests waiting-tests check-attack check-sanitize check-unit-sanitized check-python-sanitize check-tsan can-drive mcap-reader python-peers stream-peers

# Sums of very many pairs: time and memory, next to numpy.
$(O)/tests/corpus: tests/bench/corpus.c $(O)/lib/libincise-learn.so
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ $< \
		-L$(O)/lib -Wl,-rpath,'$$ORIGIN/../lib' -lincise-learn -lincise -lm

# All 2^32 pairs of 16-bit inputs: the proof of the bound by trying everything.
$(O)/tests/exhaustive: tests/bench/exhaustive.c $(O)/lib/libincise.so
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ $< \
		-L$(O)/lib -Wl,-rpath,'$$ORIGIN/../lib' -lincise -lm -pthread

# A tracker at a line, in real time.
$(O)/tests/tracker_line: tests/bench/tracker_line.c $(emulator) $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) -MMD -MP -MF $@.d \
		$(LDFLAGS) -o $@ $^ $(test_libs)

# Pictures into a file, what they cost.
$(O)/tests/frames: tests/bench/frames.c $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) -MMD -MP -MF $@.d \
		$(LDFLAGS) -o $@ $(filter %.c %.a,$^) $(test_libs)

check-frames: $(O)/tests/frames ## CPU per picture and bytes per hour of each format
	$(O)/tests/frames $(O)/tests

# Virtual rigs with known truth, seen through the module of vision.
$(O)/tests/calibrate_depth: tests/bench/calibrate_depth.c $(O)/lib/libincise-tests.a | libs
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ $^ \
		$(test_libs)

check-depth: $(O)/tests/calibrate_depth ## whether stated intervals of depth hold the truth on 200 virtual rigs
	INCISE_MODULE_PATH=$(O)/lib/incise $(O)/tests/calibrate_depth

# Time that the loop needs to publish its state.
$(O)/tests/state_tick: tests/bench/state_tick.c $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ $^ \
		$(test_libs)

check-state: $(O)/tests/state_tick ## what it costs the loop to tell its state, ns
	$(O)/tests/state_tick

ROWS ?= 10000000
check-python-speed: all ## rows/s and memory of streams in Python next to sqlite3; ROWS=100000000
	INCISE_BUILD=$(abspath $(O)) PYTHONPATH=python PYTHONDONTWRITEBYTECODE=1 \
		/usr/bin/python3 tests/bench/python_streams.py $(ROWS)

DATA ?=
SPLITS ?= 4
check-few-cuts: all python-peers ## errors on unseen cuts next to scikit-learn's; DATA='a.csv b.csv' SPLITS=8
	@[ ! -e $(O)/tests/python/ready ] || INCISE_BUILD=$(abspath $(O)) SPLITS=$(SPLITS) \
		$(O)/tests/python/venv/bin/python -B tests/bench/few_cuts.py $(DATA)

TRACKER_SECONDS ?= 600
check-tracker: $(O)/tests/tracker_line ## a FASTRAK at a serial line for ten minutes, clean and with harm on the way
	$(O)/tests/tracker_line $(TRACKER_SECONDS)

# A day of ticks; the rig's clock starts where the test says.
$(O)/tests/day: tests/bench/day.c $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) -MMD -MP -MF $@.d \
		$(LDFLAGS) -Wl,--wrap=incise_clock_new_simulated -o $@ $(filter %.c %.a,$^) \
		$(test_libs)

DAY_HOURS ?= 24
check-day: $(O)/tests/day ## 24 h of the wall scene in simulated time: no drift, leak or counter wrap
	$(O)/tests/day scenes/wall.scene $(DAY_HOURS)

PAIRS ?= 1000000
check-corpus: $(O)/tests/corpus ## training sums of PAIRS pairs made on the fly, and numpy's lstsq on the same
	python3 -B tests/bench/corpus.py $(O)/tests/corpus $(PAIRS)

check-exhaustive: $(O)/tests/exhaustive ## every pair of 16-bit inputs of the shipped model, about a minute
	$(O)/tests/exhaustive scenes/liver.fis
	$(O)/tests/exhaustive scenes/liver.fis force

.PHONY: check-corpus check-few-cuts check-python-speed check-exhaustive check-frames check-tracker check-depth check-day check-state
