# SPDX-License-Identifier: GPL-2.0-or-later
# RealtimeSanitizer: what a tick does is done by a library that ends the program at the first
# allocation, lock or system call in a function marked INCISE_REALTIME. tests/rtsan/*.c are
# programs of their own; of the unit tests those are run once more that drive what is marked.
#
#   make check-rtsan RTSAN_CC=clang-23   with another compiler

# The first that can: the sanitizer came with clang 20, its run-time library is a package of
# its own.
can_rtsan = $(shell echo 'int main(void) { return 0; }' | \
	$1 -fsanitize=realtime -x c -o /dev/null - 2>/dev/null && echo $1)
RTSAN_CC ?= $(firstword $(foreach name,clang-22 clang-21 clang-20 clang,\
	$(if $(shell command -v $(name)),$(call can_rtsan,$(name)))))

# The sanitizer sees only code that runs. That no function on a tick's way calls one that may
# wait, whether it runs in a test or not, the compiler shows: -Wfunction-effects.
rtsan_flags := -fsanitize=realtime
rtsan_warnings := -Wfunction-effects -Werror=function-effects
# The certificate of integers is found by the tick's own sources, but not in a tick.
$(O)/obj/lib/scene/bound.o: override CFLAGS := $(filter-out $(rtsan_flags) $(rtsan_warnings),$(CFLAGS))
check-rtsan: ## ticks under RealtimeSanitizer: no allocation, no lock, no system call
	+@if [ -n "$(RTSAN_CC)" ]; then \
		$(MAKE) --no-print-directory O=$(O)/rtsan CC=$(RTSAN_CC) \
			CFLAGS="-O1 -g $(rtsan_flags) $(rtsan_warnings)" LDFLAGS="$(rtsan_flags)" run-rtsan; \
	else \
		echo "skipped: rtsan, which needs clang 20 or later and its run-time library (mk/deps rtsan)"; \
	fi

# All of libincise, and what of its modules is in the loop's thread.
rtsan_objects := $(filter $(O)/obj/lib/device/can/% $(O)/obj/lib/device/polhemus/% \
	$(O)/obj/lib/device/gpio/% $(O)/obj/lib/device/kernel/%,$(sort $(foreach name,$(add_ons),$(objects_$(name)))))
$(O)/lib/libincise-rtsan.a: $(call objects,incise) $(rtsan_objects)
	@mkdir -p $(@D)
	@rm -f $@
	$(call step,AR)
	$(Q)$(AR) qcs $@ $^

rtsan_units := $(filter-out $(if $(filter stepper_can,$(left_out)),can/can_stepper),\
	can/can_stepper rig/motor kernel/stepper_kernel gpio/stepper_gpio loop/loop \
	loop/loop_control loop/state_page \
	scene/actuate scene/extreme scene/felt_axes scene/plan scene/procedure sim/sim_stepper)
rtsan_programs := $(patsubst tests/rtsan/%.c,$(O)/tests/rtsan/%,$(wildcard tests/rtsan/*.c))
rtsan_unit_programs := $(addprefix $(O)/again/tests/unit/,$(rtsan_units))

rtsan_cc = $(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 -ffp-contract=off $(warnings) \
	-Wno-missing-prototypes -Wno-unused-parameter $(CFLAGS) -Wno-function-effects \
	-MMD -MP -MF $@.d
rtsan_libs = $(shell $(PKG_CONFIG) --libs $(pc_incise)) \
	$(if $(filter stepper_can,$(add_ons)),$(shell $(PKG_CONFIG) --libs $(pc_stepper_can))) $(libs_system)

$(O)/obj/again/%.o: tests/unit/%.c
	@mkdir -p $(@D)
	$(call step,CC)
	$(Q)$(rtsan_cc) -c $(test_cflags) -o $@ $<

$(O)/again/tests/unit/scene/extreme: $(patsubst %,$(O)/obj/tests/extremes/%.o,\
	extremes fed_run ground numbers plan) $(addprefix $(O)/obj/tools/cli/,cli.o complete.o file.o file_kind.o folder.o folder_of_programs.o help.o output.o \
	scene_argument.o state_folder.o)
$(O)/again/tests/unit/%: $(O)/obj/again/%.o $(O)/lib/libincise-rtsan.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(CFLAGS) $(LDFLAGS) $(wraps) -o $@ $(filter %.o,$^) $(O)/lib/libincise-rtsan.a \
		$(rtsan_libs) $(shell $(PKG_CONFIG) --libs cmocka)

$(O)/tests/rtsan/%: tests/rtsan/%.c $(O)/lib/libincise-rtsan.a $(emulator)
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(rtsan_cc) $(LDFLAGS) -o $@ $(filter %.c %.o %.a,$^) $(rtsan_libs)

# clang's own symbolizer is in a package that is not needed for anything else.
rtsan_options := RTSAN_OPTIONS=external_symbolizer_path=$(shell command -v addr2line)

run-rtsan:
	+@status=0; $(MAKE) -k --no-print-directory rtsan-programs || status=$$?; \
	if $(CC) $(cppflags) -std=gnu11 $(rtsan_warnings) -fsyntax-only tests/rtsan/refused/waits.c \
			2>&1 | grep -q 'error: .*Wfunction-effects'; then \
		echo "ok    rtsan: the compiler refuses a tick that could wait"; \
	else \
		echo "FAIL  rtsan: the compiler takes tests/rtsan/refused/waits.c"; status=1; \
	fi; \
	for program in $(rtsan_programs); do \
		$(rtsan_options) $$program || { echo "FAIL  rtsan: $$program"; status=1; }; \
	done; \
	$(rtsan_options) tests/unit/run $(rtsan_unit_programs) || status=1; exit $$status

rtsan-programs: $(rtsan_programs) $(rtsan_unit_programs)

.PHONY: check-rtsan run-rtsan rtsan-programs
