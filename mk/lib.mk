# SPDX-License-Identifier: GPL-2.0-or-later
# The shared objects.

# The keys of rig.conf that a device brings are read where its module is not, too.
sources = $(sort $(filter-out %.proto.c,$(foreach layer,$(layers_$1),$(wildcard lib/$(layer)/*.c lib/$(layer)/*.cc lib/$(layer)/*/*_settings.c))))
# also_LIB: objects of another library that does not export them; this one has its own copy.
objects = $(addprefix $(O)/obj/,$(addsuffix .o,$(basename $(call sources,$1))) $(also_$1))

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

define library
pc_flags_$1 = $$(if $$(pc_$1),$$(shell $$(PKG_CONFIG) --cflags $$(pc_$1)))
pc_libs_$1 = $$(if $$(pc_$1),$$(shell $$(PKG_CONFIG) --libs $$(pc_$1)))
$$(call objects,$1): pc_cflags = $$(pc_flags_$1)

$(O)/lib/lib$1.so.$(version): $$(call objects,$1) lib/lib$1.map \
		$$(foreach lib,$$(needs_$1),$(O)/lib/lib$$(lib).so)
	@mkdir -p $$(@D)
	$$(call step,LD)
	$$(Q)$$(CC) -shared -Wl,-soname,lib$1.so.$(soversion) -Wl,-z,defs -Wl,--as-needed \
		-Wl,--version-script,lib/lib$1.map $$(call runpath) \
		-L$(O)/lib $$(CFLAGS) $$(LDFLAGS) -o $$@ $$(call objects,$1) \
		$$(addprefix -l,$$(needs_$1)) $$(pc_libs_$1) $$(libs_$1)

$(O)/lib/lib$1.so.$(soversion): $(O)/lib/lib$1.so.$(version)
	$$(Q)ln -sf $$(<F) $$@

$(O)/lib/lib$1.so: $(O)/lib/lib$1.so.$(soversion)
	$$(Q)ln -sf $$(<F) $$@

libs: $(O)/lib/lib$1.so
endef
$(foreach lib,$(libraries),$(eval $(call library,$(lib))))

# Modules of devices, $(O)/lib/incise/KIND_NAME.so: loaded when rig.conf names them. They
# bring a library into the process that others do not need. What of libincise they use and
# it does not export, they hold themselves.
has_libmnl := $(shell $(PKG_CONFIG) --exists libmnl && echo yes)
has_libiio := $(shell $(PKG_CONFIG) --exists 'libiio < 1' && echo yes)
has_comedilib := $(shell $(PKG_CONFIG) --exists comedilib && echo yes)
device_modules := $(if $(shell $(PKG_CONFIG) --exists libgpiod && echo yes),stepper_gpio) \
	$(if $(has_libmnl),stepper_can) stepper_slcan \
	$(if $(has_libiio),force_iio) $(if $(has_comedilib),force_comedi)
# A motor that is moved from a thread here.
motor_core := $(addprefix $(O)/obj/lib/,fixed/profile.o fixed/ramp.o \
	$(addprefix device/,motor.o motion.o page.o thread.o))
pc_stepper_gpio := libgpiod
objects_stepper_gpio := $(motor_core) $(addprefix $(O)/obj/lib/device/,gpio/pulser.o gpio/stepper_gpio.o \
	$(if $(shell $(PKG_CONFIG) --atleast-version=2 libgpiod && echo yes),gpio/gpio_v2.o,gpio/gpio_v1.o))

# A drive on one of two kinds of bus: each module has the files of its own transport only.
can_core := $(motor_core) $(patsubst %.c,$(O)/obj/%.o,$(wildcard lib/device/can/canopen/*.c lib/device/can/cia402/*.c))
can_socketcan := $(patsubst %.c,$(O)/obj/%.o,$(wildcard lib/device/can/bus/socketcan*.c))
can_slcan := $(O)/obj/lib/device/tty.o \
	$(patsubst %.c,$(O)/obj/%.o,$(wildcard lib/device/can/bus/slcan*.c))
pc_stepper_can := libmnl
objects_stepper_can := $(can_core) $(can_socketcan) $(O)/obj/lib/device/can/stepper_can.o
pc_stepper_slcan :=
objects_stepper_slcan := $(can_core) $(can_slcan) $(O)/obj/lib/device/can/stepper_slcan.o

# Needs nothing but the kernel's headers.
device_modules += camera_v4l2
pc_camera_v4l2 :=
objects_camera_v4l2 := $(addprefix $(O)/obj/lib/device/,stable_path.o thread.o) \
	$(patsubst %.c,$(O)/obj/%.o,$(wildcard lib/device/v4l2/*.c))
# Force samples from two kinds of converters.
daq_core := $(addprefix $(O)/obj/lib/,base/ring.o device/thread.o device/daq/daq_feed.o)
daq_iio := $(addprefix $(O)/obj/lib/device/daq/,iio_source.o iio_force.o)
daq_comedi := $(O)/obj/lib/device/daq/comedi_force.o
pc_force_iio := libiio
objects_force_iio := $(daq_core) $(daq_iio)
pc_force_comedi := comedilib
objects_force_comedi := $(daq_core) $(O)/obj/lib/device/stable_path.o $(daq_comedi)
# Streams of the Lab Streaming Layer; liblsl is opened at run time, and needs no package here.
device_modules += force_lsl
pc_force_lsl :=
objects_force_lsl := $(daq_core) $(addprefix $(O)/obj/lib/device/,pace.o lsl/liblsl.o lsl/lsl_force.o)
device_modules += outlet_lsl
pc_outlet_lsl :=
objects_outlet_lsl := $(addprefix $(O)/obj/lib/device/lsl/,liblsl.o lsl_outlet.o)
# One tracker on two kinds of line.
polhemus_lines := lib/device/polhemus/polhemus_usb.c lib/device/polhemus/polhemus_tty.c
polhemus_core := $(addprefix $(O)/obj/lib/,base/ring.o device/thread.o device/tracker_feed.o) \
	$(patsubst %.c,$(O)/obj/%.o,$(filter-out $(polhemus_lines),$(wildcard lib/device/polhemus/*.c)))
has_libusb := $(shell $(PKG_CONFIG) --exists libusb-1.0 && echo yes)
device_modules += $(if $(has_libusb),tracker_usb) tracker_tty
pc_tracker_usb := libusb-1.0
objects_tracker_usb := $(polhemus_core) $(O)/obj/lib/device/polhemus/polhemus_usb.o
$(O)/obj/lib/device/polhemus/polhemus_usb.o: pc_cflags = $(shell $(PKG_CONFIG) --cflags libusb-1.0)
pc_tracker_tty :=
objects_tracker_tty := $(polhemus_core) $(O)/obj/lib/device/tty.o \
	$(O)/obj/lib/device/polhemus/polhemus_tty.o

# A tracker of an OpenIGTLink server.
device_modules += tracker_igtl
pc_tracker_igtl :=
objects_tracker_igtl := $(addprefix $(O)/obj/lib/,base/ring.o $(addprefix device/,\
	pace.o thread.o tracker_feed.o igtl/igtl_poses.o igtl/igtl_tracker.o))

# Detection of the scalpel in frames, in C++.
device_modules += $(if $(has_vision),vision_opencv)
pc_vision_opencv :=
objects_vision_opencv := $(addprefix $(O)/obj/,$(addsuffix .o,$(basename \
	$(wildcard lib/vision/*.c lib/vision/*.cc))))
libs_vision_opencv := -lopencv_imgproc -lopencv_core -ljpeg -lstdc++
$(objects_vision_opencv): pc_cflags = $(opencv_cflags)

# Detection of a board; it needs more of OpenCV, which a measurement of depth need not map.
device_modules += $(if $(has_board),board_opencv)
pc_board_opencv :=
objects_board_opencv := $(addprefix $(O)/obj/lib/,vision/image.o vision/jpeg.o \
	vision/board/board_opencv.o)
libs_board_opencv := -lopencv_calib3d $(libs_vision_opencv)
$(O)/obj/lib/vision/board/board_opencv.o: pc_cflags = $(opencv_cflags)

# Pictures in a file; lib/record loads it.
has_frames := $(shell $(PKG_CONFIG) --exists libavformat libavcodec libavutil && echo yes)
device_modules += $(if $(has_frames),frames_mkv)
pc_frames_mkv := libavformat libavcodec libavutil libcrypto
objects_frames_mkv := $(patsubst %.c,$(O)/obj/%.o,lib/base/crypto/sha256.c $(wildcard lib/record/mkv/*.c))
$(objects_frames_mkv): pc_cflags = $(shell $(PKG_CONFIG) --cflags $(pc_frames_mkv))

# Films of pictures; lib/view loads it.
device_modules += $(if $(has_view),$(if $(has_frames),film_mkv))
pc_film_mkv := libavformat libavcodec libavutil
objects_film_mkv := $(O)/obj/lib/view/film/film_mkv.o
$(objects_film_mkv): pc_cflags = $(shell $(PKG_CONFIG) --cflags $(pc_film_mkv))

# Writing HDF5; libincise-record loads it.
has_hdf5 := $(shell $(PKG_CONFIG) --exists hdf5 zlib && echo yes)
device_modules += $(if $(has_hdf5),export_hdf5)
pc_export_hdf5 := hdf5 zlib
objects_export_hdf5 := $(O)/obj/lib/record/export/hdf5/export_hdf5.o
$(objects_export_hdf5): pc_cflags = $(shell $(PKG_CONFIG) --cflags $(pc_export_hdf5))

# Training on many computers.
has_mpi := $(shell $(PKG_CONFIG) --exists ompi-c && echo yes)
device_modules += $(if $(has_mpi),ranks_mpi)
pc_ranks_mpi := ompi-c
objects_ranks_mpi := $(O)/obj/lib/device/mpi/ranks_mpi.o
$(objects_ranks_mpi): pc_cflags = $(patsubst -I%,-isystem %,$(shell $(PKG_CONFIG) --cflags $(pc_ranks_mpi)))

define device_module
$(O)/lib/incise/$1.so: $$(objects_$1) $(O)/lib/libincise.so
	@mkdir -p $$(@D)
	$$(call step,LD)
	$$(Q)$$(CC) -shared -Wl,-z,defs -Wl,--as-needed $$(call runpath,/..) -L$(O)/lib \
		$$(CFLAGS) $$(LDFLAGS) -o $$@ $$(objects_$1) -lincise \
		$$(if $$(pc_$1),$$(shell $$(PKG_CONFIG) --libs $$(pc_$1))) $$(libs_$1) -lm -pthread

libs: $(O)/lib/incise/$1.so
endef
$(foreach name,$(device_modules),$(eval $(call device_module,$(name))))

# For unit tests, which reach into what the shared objects hide.
test_objects := $(patsubst %.c,$(O)/obj/%.o,$(wildcard lib/device/v4l2/*.c)) \
	$(addprefix $(O)/obj/lib/device/gpio/,pulser.o stepper_gpio.o) \
	$(filter $(O)/obj/lib/device/can/%,$(can_core) $(can_slcan) $(if $(has_libmnl),$(can_socketcan))) \
	$(O)/obj/lib/device/daq/daq_feed.o $(if $(has_libiio),$(daq_iio)) \
	$(if $(has_comedilib),$(daq_comedi)) \
	$(filter $(O)/obj/lib/device/lsl/%,$(objects_force_lsl)) \
	$(filter $(O)/obj/lib/device/igtl/%,$(objects_tracker_igtl)) \
	$(filter $(O)/obj/lib/device/polhemus/%,$(objects_tracker_tty)) \
	$(if $(has_vision),$(filter-out %/vision_opencv.o,$(objects_vision_opencv))) \
	$(if $(has_frames),$(objects_frames_mkv) $(objects_film_mkv)) \
	$(O)/obj/tests/vision/scalpel_picture.o
# q, not r: device/vision.c and vision/vision.cc are both vision.o.
$(O)/lib/libincise-tests.a: $(foreach lib,$(libraries),$(call objects,$(lib))) $(test_objects)
	@mkdir -p $(@D)
	@rm -f $@
	$(call step,AR)
	$(Q)$(AR) qcs $@ $^

.PHONY: libs
