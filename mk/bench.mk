# SPDX-License-Identifier: GPL-2.0-or-later
# Benchmarks for developers: programs of tests/bench that are not installed, each next to what
# `incise bench` has for users. tests/bench/README.md says what each measures.

# Properties of the library under extreme inputs: tests/bench/extremes tries all cases, unit tests
# some. They build without what only tests need.
extremes := $(O)/obj/tests/extremes.a
$(O)/obj/tests/extremes/%.o: test_cflags =
$(extremes): $(patsubst %.c,$(O)/obj/%.o,$(wildcard tests/extremes/*.c $(addprefix tools/cli/,cli.c complete.c f*.c help.c output.c scene_argument.c state_folder.c)) tools/bench/closed_loop.c)
	@rm -f $@
	$(call step,AR)
	$(Q)$(AR) rcs $@ $^

bench_names := capture coverage extremes integers prediction $(filter serve,$(commands)) settings timeline vision
bench_programs := $(bench_names:%=$(O)/tests/bench/%)
bench_objects := $(bench_names:%=$(O)/obj/tests/bench/%.o) $(O)/obj/tests/bench/main.o
$(bench_objects): test_cflags = $(shell $(PKG_CONFIG) --cflags jansson)
$(O)/obj/tests/bench/main.o: cppflags += -DBUILD_FOLDER='"$(abspath $(O))"'
$(O)/obj/tests/bench/capture.o: cppflags += $(if $(has_jpeg),-DHAVE_JPEG)

# They also measure parts that the shared objects do not export; the linker takes those from the
# archive.
$(O)/tests/bench/serve: tool_more_libs += $(libs_tracker_igtl)
$(bench_programs): $(O)/tests/bench/%: $(O)/obj/tests/bench/%.o $(O)/obj/tests/bench/main.o $(tool_parts) $(extremes) \
		$(O)/lib/libincise-tests.a $(foreach lib,$(libraries),$(O)/lib/lib$(lib).so)
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(CFLAGS) $(LDFLAGS) -Wl,--as-needed -Wl,-rpath,'$$ORIGIN/../../lib' -Wl,-rpath-link,$(O)/lib -L$(O)/lib -o $@ \
		$(filter %.o,$^) $(tool_parts) $(tool_libs) $(extremes) $(O)/lib/libincise-tests.a \
		$(tool_more_libs) $(shell $(PKG_CONFIG) --libs jansson $(foreach lib,$(libraries),$(pc_$(lib)))) -ldl -pthread

bench-all: all $(bench_programs) ## build the benchmarks for developers, build/tests/bench/NAME

# Their tests are slow ones.
check-cli: $(bench_programs)

# A page shows half the pixels of a figure.
doc-pictures: all ## force-surface.png, neck.png and lesson.png of doc/, as the demo and incise view draw them today
	rm -rf $(O)/pictures
	$(O)/bin/incise demo -o $(O)/pictures >/dev/null
	cd $(O)/pictures/plot && sed -i '/pngcairo/,/pointscale/{s/2 [*] figure_/figure_/g;s/1[.]5/0.75/;s/2[.]4/1.2/;s/2[.]6/1.3/}' style.gp && \
		gnuplot fig3b-surface.gp && cp ../fig3b-surface.png $(abspath doc)/force-surface.png
	$(O)/bin/incise view neck --procedure -o doc/neck.png --at 2.5s,8s,13s,21s --size 480x360 --overwrite >/dev/null
	$(O)/bin/incise view neck --procedure -o doc/lesson.png --at 0.1s --duration 0.15s --size 480x300 --no-panel \
		--viewpoint "$$(sed -n 's/.*--viewpoint \([^ ]*\) .*/\1/p' doc/lesson.md)" --overwrite >/dev/null

.PHONY: bench-all doc-pictures
