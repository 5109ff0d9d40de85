# SPDX-License-Identifier: GPL-2.0-or-later
# Tests that need a kernel: tests/vm boots Debian's own ones in QEMU.

# Programs that the scripts in tests/vm/guest call; they reach into the library as unit
# tests do, and share tests/vm/*.c.
guest_shared := $(wildcard tests/vm/*.c)
guest_objects := $(guest_shared:%.c=$(O)/obj/%.o)
.SECONDARY: $(guest_objects)
guest_headers := $(wildcard tests/vm/*.h driver/sim/incise_sim.h driver/uapi/*.h)
guest_programs := $(patsubst tests/vm/guest/%.c,$(O)/tests/vm/%,\
	$(filter-out $(if $(filter stepper_can,$(left_out)),%/can_bus.c %/can_netlink.c) $(left_out:%=tests/vm/guest/%.c),\
		$(wildcard tests/vm/guest/*.c)))

$(O)/tests/vm/%: tests/vm/guest/%.c $(guest_objects) $(guest_headers) \
		$(O)/lib/libincise-tests.a
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(cppflags) $(CPPFLAGS) -std=gnu11 -ffp-contract=off $(warnings) $(CFLAGS) \
		$(LDFLAGS) -o $@ $< $(guest_objects) $(O)/lib/libincise-tests.a \
		$(test_libs)

# The liver's model for the scripts in tests/vm/guest.
guest_model := $(O)/tests/vm/liver.fx
$(guest_model): scenes/liver.fis $(O)/bin/incise $(O)/bin/incise-compile
	@mkdir -p $(@D)
	$(O)/bin/incise compile $< -o $@ --overwrite >/dev/null

# Virtual time for whatever asserts on time, two processors for races.
vm_boots := main:deterministic second:deterministic main:service main:smp

# For tests/vm/system, in a Debian that systemd has booted.
system_programs := $(patsubst tests/vm/system/%.c,$(O)/tests/vm/%,$(wildcard tests/vm/system/*.c))

$(system_programs): $(O)/tests/vm/%: tests/vm/system/%.c tests/vm/simulator.c \
		tests/vm/simulator.h driver/sim/incise_sim.h
	@mkdir -p $(@D)
	$(call step,LD)
	$(Q)$(CC) $(CPPFLAGS) -std=gnu11 $(warnings) $(CFLAGS) $(LDFLAGS) -o $@ $< tests/vm/simulator.c

check-vm: all $(O)/tests/sql $(guest_programs) $(guest_model) $(system_programs) $(O)/tests/polhemus/fastrak ## tests of the kernel modules, on Debian's kernels in QEMU
	+@INCISE_BUILD=$(abspath $(O)) MAKE="$(MAKE)" tests/vm/check --bed $(vm_boots)

check-service: all $(system_programs) $(O)/tests/polhemus/fastrak ## of check-vm the boot of systemd, with our packages and the service
	+@INCISE_BUILD=$(abspath $(O)) MAKE="$(MAKE)" tests/vm/check main:service

# In real time, so of use on a machine that does little else.
check-clocks: all ## two guests with clocks of their own, joined by PTP
	@mk/deps vm
	@INCISE_BUILD=$(abspath $(O)) tests/vm/clocks/check

# In real time only: with every access checked its timers are late by up to a millisecond,
# in virtual time too, so that nothing about time can be asserted.
check-vm-debug: all $(O)/tests/sql $(guest_programs) $(guest_model) $(O)/tests/polhemus/fastrak ## the same on a kernel with KASAN, lockdep, kmemleak; built once
	@mk/deps vm vm-debug
	+@tests/vm/debug-kernel >/dev/null
	+@INCISE_BUILD=$(abspath $(O)) MAKE="$(MAKE)" tests/vm/check --bed debug:smp

.PHONY: check-vm check-service check-clocks check-vm-debug
