# SPDX-License-Identifier: GPL-2.0-or-later
# Tests. tests/unit/NAME/*.c test a layer or a module of lib/, the parts of driver/ that build without a
# kernel, and shared parts of tools/; tests/cli runs the real programs.

# Tests of add-ons that are left out are, too: of one its own files, of a whole folder tests/unit/FOLDER.
left_out_tests = $(addprefix tests/unit/$2/,$(if $(filter $(add_ons),$(beside_$1)),$(addsuffix .c,$(notdir $(only_$1))),%))
unit_sources := $(filter-out $(if $(has_view),,tests/unit/view/%) \
	$(foreach name,$(left_out),$(call left_out_tests,$(name),$(notdir $(folder_$(name):/=)))),\
	$(wildcard tests/unit/*/*.c))
# The longest ones first: one that begins last runs alone.
unit_programs := $(patsubst tests/%.c,$(O)/tests/%,$(filter %/extremes.c %/rest_3d.c,$(unit_sources)) \
	$(filter-out %/extremes.c %/rest_3d.c,$(unit_sources)))

# A tracker that is not there: some tests, and a program of its own.
emulator := $(O)/obj/tests/polhemus/emulator.o

# LAPACK is the reference of numerical tests; nothing else links it.
test_packages := cmocka jansson lapacke lapack blas $(foreach part,$(add_ons) $(libraries),$(pc_$(part)))
test_cflags = $(eval test_cflags := $(shell $(PKG_CONFIG) --cflags '$(test_packages)'))$(test_cflags)
# A test maps only what it uses of these.
test_libs = $(eval test_libs := -Wl,--as-needed $(shell $(PKG_CONFIG) --libs '$(test_packages)') \
	$(foreach name,$(add_ons),$(libs_$(name))) $(tool_more_libs) -ldl -pthread)$(test_libs)

$(O)/obj/tests/%.o: tests/%.c
	@mkdir -p $(@D)
	$(call step,CC)
	$(Q)$(CCACHE) $(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 -ffp-contract=off $(warnings) \
		-Wno-missing-prototypes -Wno-unused-parameter $(test_main) $(test_cflags) $(CFLAGS) -MMD -MP -c -o $@ $<

# All tests of a layer are one program, LAYER/tests, and LAYER/NAME is a link to it; see
# tests/unit/layer.c. A test that defines __wrap_NAME plays NAME for all that it is linked to, so it is
# a program of its own, as one is that plays a function of the library.
wrapping := $(notdir $(shell grep -l __wrap_ tests/unit/*/*.h))
unit_apart := $(patsubst tests/%.c,$(O)/tests/%,$(filter $(addprefix tests/unit/,rig/vision.c \
	rig/foot_switch.c daq/iio_force.c),$(unit_sources)) \
	$(shell grep -l -e __wrap_ $(wrapping:%=-e 'include "%"') $(unit_sources)))
unit_layers := $(sort $(patsubst tests/unit/%/,%,$(dir $(unit_sources))))
unit_together := $(filter-out $(unit_apart),$(unit_programs))
unit_objects = $(patsubst $(O)/tests/%,$(O)/obj/tests/%.o,$(filter $(O)/tests/unit/$1/%,$(unit_together)))
wraps = $$($(NM) $(filter %/$*.o,$^) | sed -n 's/.* T __wrap_\(.*\)/-Wl,--wrap=\1/p')
$(unit_together:$(O)/tests/%=$(O)/obj/tests/%.o): test_main = -Dmain=unit_$(*F)

# Parts that only some layers use, ahead of the archive: modules that only their own tests link, as
# that of HDF5, and vision's, which is then found without being loaded.
unit_parts_tools := $(tool_parts) $(extremes)
unit_parts_scene := $(extremes)
unit_parts_view := $(tool_parts)
unit_parts_number := $(O)/obj/tests/unit/number/kinds.o
unit_parts_polhemus := $(emulator)
unit_parts_hdf5 := $(objects_export_hdf5)
unit_parts_vision := $(O)/obj/tests/vision/linked.o

link_unit = $(Q)$(CC) $(CFLAGS) $(LDFLAGS) $1 -o $@ $(filter %.o,$^) $(filter %/extremes.a %/parts.a,$^) \
	$(O)/lib/libincise-tests.a $(test_libs)
define unit_layer
$(O)/tests/unit/$1/tests: $$(call unit_objects,$1) $$(unit_parts_$1) $(O)/obj/tests/unit/layer.o \
		$(O)/lib/libincise-tests.a
	@mkdir -p $$(@D)
	$$(call step,LD)
	$$(call link_unit,-Wl$$(comma)--export-dynamic-symbol='unit_*')

$$(filter $(O)/tests/unit/$1/%,$$(unit_together)): $(O)/tests/unit/$1/tests
	@ln -sf tests $$@

$$(filter $(O)/tests/unit/$1/%,$$(unit_apart)): $$(unit_parts_$1)
endef
$(foreach layer,$(unit_layers),$(eval $(call unit_layer,$(layer))))

$(unit_apart): $(O)/tests/unit/%: $(O)/obj/tests/unit/%.o $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(call link_unit,$(wraps))
.SECONDARY: $(unit_programs:$(O)/tests/%=$(O)/obj/tests/%.o)

$(O)/tests/polhemus/fastrak: $(wildcard tests/polhemus/*.[ch])
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ \
		$(filter %.c,$^) -lm -pthread

# A locale with a decimal comma, to show that files do not depend on it.
locale := $(O)/locale/de_DE.UTF-8
$(locale):
	@mkdir -p $(@D)
	$(Q)localedef -i de_DE -f UTF-8 $@

# Programs that cannot be built are failures of their own; the others run.
run_units = LOCPATH=$(abspath $(O)/locale) LIMIT_S=$(LIMIT_S) tests/unit/run
check-unit: $(locale) ## unit tests
	+@status=0; $(MAKE) -k --no-print-directory unit-programs || status=$$?; \
		$(run_units) $(unit_programs) || status=$$?; exit $$status

unit-programs: $(unit_programs)

# Random scenes, and a judge whether those that are accepted come to rest: see tests/unit/scene/rest_3d.c.
# It takes two seconds a scene; several runs of other seeds go side by side.
SEEDS ?= 1..500
rest: $(O)/tests/unit/scene/rest_3d ## SEEDS=1..500 [KEEP=FOLDER]: leans on random scenes that are accepted; each that swings in a line
	@SEEDS=$(SEEDS) KEEP=$(KEEP) $<

# Fuzz targets by our own changes of the inputs that are kept; see tests/fuzz/mutate.c.
fuzz_targets := $(patsubst tests/fuzz/%.c,%,$(filter-out tests/fuzz/mutate.c $(if $(filter vision_opencv,$(left_out)),%/vision_frame.c) \
	$(if $(filter tracker_igtl,$(left_out)),%/igtl_stream.c %/igtl_poses.c) \
	$(if $(filter haptic_haply,$(left_out)),%/haply_frame.c),\
	$(wildcard tests/fuzz/*.c)))
kept_programs := $(fuzz_targets:%=$(O)/tests/kept/%)
kept_objects := $(fuzz_targets:%=$(O)/obj/tests/fuzz/%.o)
$(kept_objects): test_main = -DLLVMFuzzerTestOneInput=fuzz_$(*F)
link_kept = $(call link_unit,-Wl$(comma)--export-dynamic-symbol='fuzz_*')
$(O)/tests/kept/tests: $(filter-out %/vision_frame.o,$(kept_objects)) $(O)/obj/tests/fuzz/mutate.o $(tool_parts) \
		$(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(link_kept)

# It plays a function of the library, as its unit tests do.
$(O)/tests/kept/vision_frame: $(O)/obj/tests/fuzz/vision_frame.o $(O)/obj/tests/fuzz/mutate.o \
		$(O)/obj/tests/vision/linked.o $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(link_kept)

$(filter-out %/vision_frame,$(kept_programs)): $(O)/tests/kept/tests
	@ln -sf tests $@

check-kept: $(kept_programs) ## untrusted bytes: the fuzz targets on kept inputs and seeded changes of them
	@$(run_units) $(kept_programs)

# The CAN drive that tests talk to is on python-canopen, in a folder of its own.
can-drive: ## the CAN drive of the tests, $(O)/tests/can/drive; see tests/can/README.md
	@tests/venv tests/can $(O)/tests/can 'tests with the CAN drive are skipped' drive selftest moteus_drive

# The reader of MCAP's own makers, and one of ROS 2, for what is exported.
mcap-reader: ## other readers for the tests of MCAP, $(O)/tests/mcap/check and ros2
	@tests/venv tests/mcap $(O)/tests/mcap 'tests read MCAP with our own reader alone' check:--package ros2

# Readers of Arrow streams in place, and MuJoCo, for the tests of incise for Python.
python-peers: ## pyarrow, polars, DuckDB, pandas 3, xarray, scikit-learn, LightGBM, MuJoCo and mypy for the tests of python/
	@tests/venv tests/python $(O)/tests/python 'tests with pyarrow, polars, DuckDB, pandas 3, xarray, scikit-learn, LightGBM, MuJoCo and mypy are skipped'

# Programs of others that send and receive streams over a network.
receiver := $(wildcard /usr/share/doc/openigtlink-examples/examples/Receiver/ReceiveClient.cxx)
stream-peers: $(if $(filter tracker_igtl,$(add_ons)),$(if $(receiver),$(O)/tests/streams/ReceiveClient))
stream-peers: ## pylsl, with liblsl, pyigtl, and a client of libopenigtlink for tests of streams
	@tests/venv tests/streams $(O)/tests/streams 'tests with streams of LSL and pyigtl are skipped' lsl_send lsl_receive igtl_send

$(O)/tests/streams/ReceiveClient: $(receiver)
	@mkdir -p $(@D)
	$(call step,CXX)
	$(Q)$(CXX) -O1 -w -I/usr/include/openigtlink -o $@ $< -lOpenIGTLink

# Subscribers of others to topics of ROS 2; in Debian 13 Fast DDS has a library of another name.
fastdds := $(firstword $(foreach name,fastdds fastrtps,$(if $(wildcard /usr/lib/*/lib$(name).so),$(name))))
ros2-peers: $(if $(fastdds),$(O)/tests/ros2/fastdds_read)
ros2-peers: ## Cyclone DDS for Python, and a program on Fast DDS, for tests of ROS 2
	@tests/venv tests/ros2 $(O)/tests/ros2 'tests of ROS 2 with Cyclone DDS for Python are skipped' read

$(O)/tests/ros2/fastdds_read: tests/ros2/fastdds_read.cc
	@mkdir -p $(@D)
	$(call step,CXX)
	$(Q)$(CXX) -std=c++17 -O1 -w -o $@ $< -l$(fastdds) -lfastcdr

# Attacks on recordings. What is in a module is found by INCISE_MODULE_PATH.
attack_programs := $(addprefix $(O)/tests/attack/,kill faults damage record statement watch.so stall.so)

$(addprefix $(O)/tests/attack/,kill faults): tests/attack/round.c
$(O)/tests/attack/%: tests/attack/%.c $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) -MMD -MP -MF $@.d \
		$(LDFLAGS) -o $@ $(filter %.c,$^) $(O)/lib/libincise-tests.a $(test_libs)

# sqlite3 for recordings, whose samples it shows as rows; a short recording made long.
$(O)/tests/sql $(O)/tests/longer: $(O)/tests/%: tests/rows/%.c tests/rows_sql.h $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ $< \
		$(O)/lib/libincise-tests.a $(test_libs)

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

# A haptic device as a module, and a program that uses the haptic device of a rig.
haptic_peers := $(O)/tests/haptic/haptic_spring.so $(O)/tests/haptic/user
$(O)/tests/haptic/haptic_spring.so: tests/haptic/spring.c $(O)/lib/libincise.so
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 -fPIC $(warnings) $(CFLAGS) $(LDFLAGS) -shared -o $@ $< \
		-L$(O)/lib -lincise

$(O)/tests/haptic/user: tests/haptic/user.c $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ $^ $(test_libs)

# Commands leave what they hold when they end to the system.
bats = BATS_TEST_TIMEOUT=$(LIMIT_S) ASAN_OPTIONS=detect_leaks=0 LOCPATH=$(abspath $(O)/locale) INCISE_BUILD=$(abspath $(O)) CC="$(CC)" CXX="$(CXX)" \
	bats --print-output-on-failure
# What the command-line tests call beside the programs. Those of other projects come by pip.
cli-needs: all $(locale) $(O)/tests/polhemus/fastrak $(O)/tests/state/loop $(O)/tests/day $(O)/tests/sql $(O)/tests/longer \
	$(attack_programs) $(haptic_peers)
peers: can-drive mcap-reader python-peers stream-peers ros2-peers

# Tests that `make check` runs bear the tag check. Most wait now and then, so one more runs than there are processors.
bats_jobs = --jobs $(shell expr $$(nproc) + 1) --no-parallelize-within-files
check-cli: cli-needs peers ## command-line tests of the real programs
	$(Q)$(bats) $(bats_jobs) tests/cli

check-attack: all $(O)/tests/sql $(attack_programs) ## attacks on recordings: 100 kills, thousands of faults; ATTACK=few for a few
	ATTACK=$(or $(ATTACK),full) $(bats) tests/attack

# Python's own memory is not of interest: its objects of the end of the program count as leaks.
check-python: all $(O)/tests/sql ## tests of incise for Python on libraries under AddressSanitizer and UBSan
	+@$(MAKE) --no-print-directory O=$(O)/check $(sanitized) libs
	cd tests/python && INCISE_BUILD=$(abspath $(O)) INCISE_LIBDIR=$(abspath $(O))/check/lib \
		LD_PRELOAD=$$($(CC) -print-file-name=libasan.so) ASAN_OPTIONS=detect_leaks=0 \
		PATH=$(abspath $(O))/bin:$$PATH PYTHONPATH=../../python PYTHONDONTWRITEBYTECODE=1 \
		/usr/bin/python3 -m unittest test_recording test_model test_plan test_host test_names test_typed

# Threads that share memory without a lock, under ThreadSanitizer; what is not of the page
# comes from the library as it is.
tsan_programs := $(O)/tests/tsan/loop/state_reader
$(tsan_programs): tests/unit/loop/state_reader.c $(wildcard lib/loop/state_*.c) lib/rig/thread.c $(O)/lib/libincise.so
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) -Wno-missing-prototypes \
		-Wno-unused-parameter -Wno-tsan $(shell $(PKG_CONFIG) --cflags cmocka) -O1 -g \
		-fsanitize=thread -MMD -MP -MF $@.d -o $@ $(filter %.c,$^) -L$(O)/lib \
		-Wl,-rpath,$(abspath $(O)/lib) -lincise $(shell $(PKG_CONFIG) --libs cmocka) -lm

check-tsan: $(tsan_programs) ## what threads share without a lock, under ThreadSanitizer
	@tests/unit/run $(tsan_programs)

style_sources := $(shell find lib tools tests driver examples -name '*.[ch]' -o -path 'lib/*.cc' 2>/dev/null)
check-style: ## the house's form: clang-format, an SPDX line in every file, plain words
	@tests/style $(style_sources)

check-layers: libs ## no layer of lib/ uses a higher one, no files of one are a circle
	@tests/layers $(O)

doc: ## reference of the public headers in build/doc/html; fails where a comment is missing
	@mk/deps doc
	@mk/doc $(abspath $(O))/doc $(version)
	@cd $(O)/doc/html && PYTHONPATH=$(abspath python) PYTHONDONTWRITEBYTECODE=1 \
		python3 -m pydoc -w incise $(patsubst python/incise/%.py,incise.%,$(filter-out \
		python/incise/_%,$(wildcard python/incise/*.py))) >/dev/null
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

check-site: ## the site: dead links, nothing from a network, no page wider than 390 or 1280 pixels in Chromium
	+@if mk/deps site; then \
		$(MAKE) --no-print-directory site && tests/site/check $(O)/site; \
	else \
		echo "skipped: the site, for what builds it is missing"; \
	fi

.PHONY: rest doc notebooks check-doc check-site check-style check-layers check-unit unit-programs check-kept check-cli cli-needs \
	peers check-attack check-python check-tsan can-drive mcap-reader python-peers stream-peers ros2-peers

# Sums of very many pairs: time and memory, next to numpy.
$(O)/tests/corpus: tests/bench/corpus.c $(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ $< \
		$(O)/lib/libincise-tests.a $(test_libs)

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

# Virtual rigs with known truth, seen through the module of vision.
$(O)/tests/calibrate_depth: tests/bench/calibrate_depth.c $(O)/lib/libincise-tests.a | libs
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ $^ \
		$(test_libs)

check-depth: $(O)/tests/calibrate_depth ## whether stated intervals of depth hold the truth on 200 virtual rigs
	INCISE_MODULE_PATH=$(O)/lib/incise $(O)/tests/calibrate_depth

DATA ?= ../shared/data
SPLITS ?= 4
SEED ?= 0
bench-learning: all python-peers ## errors and intervals on unseen cuts next to scikit-learn's and LightGBM's; DATA=FOLDER SPLITS=4 SEED=0
	@[ ! -e $(O)/tests/python/ready ] || INCISE_BUILD=$(abspath $(O)) DATA=$(DATA) SPLITS=$(SPLITS) SEED=$(SEED) \
		$(O)/tests/python/venv/bin/python -B tests/bench/learning.py

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

.PHONY: bench-learning check-corpus check-exhaustive check-tracker check-depth check-day
