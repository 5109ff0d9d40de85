# SPDX-License-Identifier: GPL-2.0-or-later
# Fuzz targets: tests/fuzz/NAME.c defines LLVMFuzzerTestOneInput() and is found by its name
# (tests/fuzz/mutate.c runs them without libFuzzer, for `make check`);
# tests/fuzz/NAME/ holds inputs that are always tried first: starting points, and those that
# once failed. A target is linked to what it uses of the library.
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
		$(test_cflags) $(fuzz_flags) -fsanitize=fuzzer-no-link -MMD -MP -c -o $@ $<

$(O)/obj/fuzz/%.o: %.cc
	@mkdir -p $(@D)
	$(call step,CC)
	$(Q)$(CCACHE) $(CLANG) $(cppflags) $(CPPFLAGS) $(cxxflags) $(flags_vision_opencv) \
		$(test_cflags) $(fuzz_flags) -fsanitize=fuzzer-no-link -MMD -MP -c -o $@ $<

# The library as unit tests link it, and the reader of sessions, by clang and with the fuzzer's own instructions; a target maps what it uses.
fuzz_lib := $(O)/obj/fuzz/lib.a
$(fuzz_lib): $(patsubst $(O)/obj/%,$(O)/obj/fuzz/%,$(unit_lib_objects)) \
		$(addprefix $(O)/obj/fuzz/tools/,$(addprefix session/,digest.o judge.o session_file.o) \
		$(addprefix cli/,json.o loop_report.o stopwatch.o))
	@rm -f $@
	$(call step,AR)
	$(Q)$(AR) qcs $@ $^

# It plays a function of the library; see $(O)/tests/kept/vision_frame.
$(O)/tests/fuzz/vision_frame: $(O)/obj/fuzz/tests/vision/linked.o

$(fuzz_programs): $(O)/tests/fuzz/%: $(O)/obj/fuzz/tests/fuzz/%.o $(fuzz_lib)
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CLANG) $(fuzz_flags) -fsanitize=fuzzer -o $@ $(filter %.o,$^) $(fuzz_lib) $(test_libs) -lm

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
