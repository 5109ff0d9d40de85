# SPDX-License-Identifier: GPL-2.0-or-later
# Fuzz targets: tests/fuzz/NAME.c defines LLVMFuzzerTestOneInput() and is found by its name
# (tests/fuzz/mutate.c runs them without libFuzzer, for `make check`);
# tests/fuzz/NAME/ holds inputs that are always tried first: starting points, and those that
# once failed. A target is linked to all of lib/fixed; fuzz_NAME names sources beside that.
#
#   make check-fuzz FUZZ_RUNS=10000000    longer
#   build/tests/fuzz/NAME FILE            one input again

FUZZ_RUNS ?= 40000
CLANG ?= $(firstword $(foreach name,clang $(addprefix clang-,22 21 20 19 18 17 16 15 14),\
	$(shell command -v $(name))))

fuzz_programs := $(fuzz_targets:%=$(O)/tests/fuzz/%)

fuzz_flags := -O1 -g -fno-omit-frame-pointer -fsanitize=address,undefined \
	-fno-sanitize-recover=all

$(O)/obj/fuzz/%.o: %.c
	@mkdir -p $(@D)
	$(call step,CC)
	$(Q)$(CCACHE) $(CLANG) $(cppflags) $(CPPFLAGS) -std=gnu11 $(warnings) -Wno-missing-prototypes \
		$(fuzz_flags) -fsanitize=fuzzer-no-link -MMD -MP -c -o $@ $<

$(O)/obj/fuzz/%.o: %.cc
	@mkdir -p $(@D)
	$(call step,CC)
	$(Q)$(CCACHE) $(CLANG) $(cppflags) $(CPPFLAGS) $(cxxflags) $(flags_vision_opencv) \
		$(fuzz_flags) -fsanitize=fuzzer-no-link -MMD -MP -c -o $@ $<

# Further sources of a target.
fuzz_vision_frame := lib/base/error.c lib/device/vision.c lib/base/module.c tests/vision/linked.c \
	$(wildcard lib/vision/*.c lib/vision/*.cc)
fuzz_libs_vision_frame := $(libs_vision_opencv)
fuzz_slcan_line := lib/device/can/bus/slcan_protocol.c
fuzz_can_frames := lib/base/error.c $(wildcard lib/device/can/canopen/*.c lib/device/can/cia402/cia402*.c)

fuzz_polhemus_records := lib/base/error.c lib/base/ring.c lib/device/pose_flags.c lib/device/tracker_feed.c \
	$(addprefix lib/device/polhemus/polhemus_,model.c records.c stream.c)
fuzz_polhemus_status := lib/base/error.c lib/device/polhemus/polhemus_dialogue.c

fuzz_igtl_stream := lib/device/igtl/igtl_message.c
fuzz_igtl_poses := $(addprefix lib/base/,error.c ring.c) \
	$(addprefix lib/device/,pace.c tracker_feed.c igtl/igtl_message.c igtl/igtl_poses.c)
fuzz_libs_igtl_stream := $(libs_tracker_igtl)
fuzz_libs_igtl_poses := $(libs_tracker_igtl)

fuzz_wall_packets := $(addprefix lib/record/write/wall_,packets.c kernel.c)

fuzz_statement := lib/base/error.c lib/record/statement.c
fuzz_block := lib/record/batch.c lib/record/ledger.c lib/base/crc32c.c
fuzz_libs_block = $(shell $(PKG_CONFIG) --libs sqlite3)
fuzz_origin := lib/record/prove/origin.c
fuzz_timestamp_reply := lib/base/error.c lib/base/infile.c lib/base/crypto/sha256.c lib/record/prove/timestamp.c
fuzz_libs_timestamp_reply = $(shell $(PKG_CONFIG) --libs libcrypto)

fuzz_state_page := lib/base/error.c $(addprefix lib/loop/state_,file.c page.c reader.c)

# A scene is read with all that it names.
fuzz_scene_file := $(filter-out lib/fixed/%,$(call sources,incise))
fuzz_libs_scene_file = $(pc_libs_incise) $(libs_incise) -pthread
fuzz_calibration_text := $(fuzz_scene_file)
fuzz_libs_calibration_text = $(fuzz_libs_scene_file)
fuzz_settings := $(fuzz_scene_file)
fuzz_libs_settings = $(fuzz_libs_scene_file)
fuzz_sd_file := $(fuzz_scene_file)
fuzz_libs_sd_file = $(fuzz_libs_scene_file)
fuzz_session_file := $(fuzz_scene_file) $(addprefix tools/session/,digest.c judge.c \
	session_file.c) tools/cli/json.c tools/cli/loop_report.c tools/cli/stopwatch.c
fuzz_libs_session_file = $(fuzz_libs_scene_file) $(shell $(PKG_CONFIG) --libs jansson)
fuzz_factor_file := $(fuzz_scene_file) lib/base/crypto/sha256.c $(wildcard lib/learn/*.c)
fuzz_libs_factor_file = $(fuzz_libs_scene_file) $(shell $(PKG_CONFIG) --libs $(pc_incise-learn))

fuzz_core := $(patsubst %.c,$(O)/obj/fuzz/%.o,$(wildcard lib/fixed/*.c))
define fuzz_program
$(O)/tests/fuzz/$1: $(O)/obj/fuzz/tests/fuzz/$1.o $(fuzz_core) \
		$$(addprefix $(O)/obj/fuzz/,$$(addsuffix .o,$$(basename $$(fuzz_$1))))
	@mkdir -p $$(@D)
	$$(call step,LD)
	$$(Q)$$(CLANG) $$(fuzz_flags) -fsanitize=fuzzer -o $$@ $$^ $$(fuzz_libs_$1) -lm
endef
$(foreach name,$(fuzz_targets),$(eval $(call fuzz_program,$(name))))

# Whether there is a clang, and its libFuzzer with it, which is a package of its own.
has_fuzzer = $(if $(CLANG),$(shell echo 'int LLVMFuzzerTestOneInput(void) { return 0; }' | \
	$(CLANG) -fsanitize=fuzzer,address,undefined -x c -o /dev/null - 2>/dev/null && echo yes))

check-fuzz: ## fuzz targets, a bounded number of runs each
	+@if [ -n "$(has_fuzzer)" ]; then \
		status=0; $(MAKE) -k --no-print-directory fuzz-programs || status=$$?; \
		tests/fuzz/run $(FUZZ_RUNS) $(fuzz_programs) || status=$$?; exit $$status; \
	else \
		echo "skipped: fuzz, which needs clang and libclang-rt-dev (here: $(or $(CLANG),none))"; \
	fi

fuzz-programs: $(fuzz_programs)

.PHONY: check-fuzz fuzz-programs
