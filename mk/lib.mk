# SPDX-License-Identifier: GPL-2.0-or-later
# The shared objects.

# The keys of rig.conf that a device brings are read where its module is not, too.
sources = $(sort $(filter-out %.proto.c,$(foreach layer,$(layers_$1),$(wildcard lib/$(layer)/*.c lib/$(layer)/*.cc lib/$(layer)/*/*_settings.c))))
objects = $(addprefix $(O)/obj/,$(addsuffix .o,$(basename $(call sources,$1))))

$(O)/obj/%.o: %.c
	@mkdir -p $(@D)
	$(call step,CC)
	$(Q)$(CCACHE) $(CC) $(cppflags) $(CPPFLAGS) $(cflags) $(pc_cflags) $(CFLAGS) -MMD -MP -c -o $@ $<

$(O)/obj/%.o: %.cc
	@mkdir -p $(@D)
	$(call step,CXX)
	$(Q)$(CCACHE) $(CXX) $(cppflags) $(CPPFLAGS) $(cxxflags) $(pc_cflags) $(CXXFLAGS) -MMD -MP -c -o $@ $<

# The integer core builds without any library and, where the compiler can be told so,
# without floating-point registers: it will be linked into a kernel.
fixed_cflags := -ffreestanding
fixed_cflags += $(if $(filter x86_64-%,$(shell $(CC) -dumpmachine 2>/dev/null)),-mgeneral-regs-only)
$(O)/obj/lib/fixed/%.o: cflags += $(fixed_cflags)

# C++ for its operators only: nothing of its runtime, which the haptic loop must not map.
$(O)/obj/lib/scene/bound.o: cxxflags += -fno-exceptions

# The physics as the compiler sees it, without the headers.
tick.i: ## the stages of a tick for each kind of numbers, preprocessed, in build/tick.*.i
	@mkdir -p $(O)
	$(Q)for kind in double=tissue integers=fixed; do \
		$(CC) -E -std=gnu11 $(cppflags) lib/$${kind#*=}/tick.c | \
		awk '/^# [0-9]+ "/ { on = $$3 ~ /proto\.c"/; next } on' | cat -s >$(O)/tick.$${kind%=*}.i; \
	done
	@echo $(O)/tick.double.i $(O)/tick.integers.i
.PHONY: tick.i

hidden := $(O)/obj/lib/hidden.a
crypto_objects := $(O)/obj/lib/base/crypto/sha256.o
$(crypto_objects): pc_cflags = $(shell $(PKG_CONFIG) --cflags libcrypto)
define library
pc_flags_$1 = $$(if $$(pc_$1),$$(shell $$(PKG_CONFIG) --cflags $$(pc_$1)))
pc_libs_$1 = $$(if $$(pc_$1),$$(shell $$(PKG_CONFIG) --libs $$(pc_$1)))
$$(call objects,$1): pc_cflags = $$(pc_flags_$1)

$(O)/lib/lib$1.so.$(version): $$(call objects,$1) lib/lib$1.map \
		$$(foreach lib,$$(needs_$1),$(O)/lib/lib$$(lib).so $(hidden))
	@mkdir -p $$(@D)
	$$(call step,LD)
	$$(Q)$$(CC) -shared -Wl,-soname,lib$1.so.$(soversion) -Wl,-z,defs -Wl,--as-needed \
		-Wl,--version-script,lib/lib$1.map $$(call runpath) \
		-L$(O)/lib $$(CFLAGS) $$(LDFLAGS) -o $$@ $$(call objects,$1) \
		$$(addprefix -l,$$(needs_$1)) $$(filter %.a,$$^) $$(pc_libs_$1) $(libs_system)

$(O)/lib/lib$1.so.$(soversion): $(O)/lib/lib$1.so.$(version)
	$$(Q)ln -sf $$(<F) $$@

$(O)/lib/lib$1.so: $(O)/lib/lib$1.so.$(soversion)
	$$(Q)ln -sf $$(<F) $$@

libs: $(O)/lib/lib$1.so
endef
$(foreach lib,$(libraries),$(eval $(call library,$(lib))))

# What libincise has and does not export, and SHA-256, for which it would map libcrypto: its other
# libraries and the add-ons hold what they use of it themselves.
$(hidden): $(call objects,incise) $(crypto_objects)
	@rm -f $@
	$(call step,AR)
	$(Q)$(AR) qcs $@ $^

# Add-ons: modules $(O)/lib/incise/KIND_NAME.so, loaded when they are named. They bring a library into
# the process that others do not need. module.mk in a folder says which are made of its sources:
#
#   modules := tracker_usb tracker_tty   each has all sources of the folder, but
#   only_MODULE := polhemus_usb          those that only another one has
#   not_MODULE := gpio_v1                or that it does not want
#   also_MODULE := can/bus/socketcan     and those of lib/device that begin so
#   pc_MODULE := libusb-1.0              it needs packages of pkg-config, or
#   headers_MODULE := jpeglib.h          headers, which the compiler finds with flags_MODULE, and
#   libs_MODULE := -ljpeg                their libraries
#   commands_MODULE := serve             commands that need the same
#
# One that misses what it needs is left out; the last line of make names it with its packages in
# lib/base/features.def.
left_out := $(if $(has_view),,incise-view)
commands_incise-view := view bench-view

lacks = $(strip $(if $(pc_$1),$(shell $(PKG_CONFIG) --exists '$(pc_$1)' || echo '$(pc_$1)')) \
	$(if $(headers_$1),$(shell $(CXX) -E -x c++ $(flags_$1) $(headers_$1:%=-include %) /dev/null \
	>/dev/null 2>&1 || echo '$(headers_$1)') \
	$(if $(libs_$1),$(shell $(CXX) -shared -o /dev/null -x c /dev/null $(libs_$1) >/dev/null 2>&1 || echo '$(libs_$1)'))))
take_module = $(eval folder_$1 := $2)$(eval beside_$1 := $(filter-out $1,$(modules)))\
	$(eval lacks_$1 := $(call lacks,$1))$(eval $(if $(lacks_$1),left_out,add_ons) += $1)
take_modules = $(foreach name,$(modules),$(call take_module,$(name),$1))
add_ons :=
$(foreach file,$(wildcard lib/*/module.mk lib/*/*/module.mk),$(eval include $(file))$(call take_modules,$(dir $(file))))

# The keys of rig.conf that an add-on brings, %_settings.c, are libincise's.
define add_on
objects_$1 := $$(patsubst %,$(O)/obj/%.o,$$(filter-out %_settings $$(addprefix $$(folder_$1),$$(not_$1) \
	$$(foreach other,$$(beside_$1),$$(only_$$(other)))),\
	$$(basename $$(wildcard $$(addprefix $$(folder_$1),*.c *.cc */*.c */*.cc) $$(also_$1:%=lib/device/%*.c)))))
$$(objects_$1): pc_cflags += $$(flags_$1) \
	$$(if $$(pc_$1),$$(patsubst -I%,-isystem %,$$(shell $$(PKG_CONFIG) --cflags '$$(pc_$1)')))

$(O)/lib/incise/$1.so: $$(objects_$1) $(hidden) $(O)/lib/libincise.so
	@mkdir -p $$(@D)
	$$(call step,LD)
	$$(Q)$$(CC) -shared -Wl,-z,defs -Wl,--as-needed $$(call runpath,/..) -L$(O)/lib \
		$$(CFLAGS) $$(LDFLAGS) -o $$@ $$(objects_$1) -lincise $(hidden) \
		$$(if $$(pc_$1),$$(shell $$(PKG_CONFIG) --libs '$$(pc_$1)')) $$(libs_$1) $(libs_system)

libs: $(O)/lib/incise/$1.so
endef
$(foreach name,$(add_ons),$(eval $(call add_on,$(name))))

# For unit tests, which reach into what the shared objects hide.
# q, not r: rig/vision.c and vision/vision.cc are both vision.o.
unit_lib_objects := $(foreach lib,$(libraries),$(call objects,$(lib))) $(crypto_objects) \
	$(sort $(foreach name,$(add_ons),$(objects_$(name)))) $(O)/obj/tests/vision/scalpel_picture.o
$(O)/lib/libincise-tests.a: $(unit_lib_objects)
	@mkdir -p $(@D)
	@rm -f $@
	$(call step,AR)
	$(Q)$(AR) qcs $@ $^

.PHONY: libs
