# SPDX-License-Identifier: GPL-2.0-or-later
# The programs. They use public headers only, and find their libraries beside them, in
# the build tree as after installation.

programs := $(O)/bin/incise $(addprefix $(O)/bin/incise-,$(verbs))
tool_shared := $(addprefix $(O)/obj/tools/,cli.o json.o whole_file.o)

$(O)/obj/tools/%.o: pc_cflags = $(shell $(PKG_CONFIG) --cflags jansson)

# The kernel module's own interface, for those who look at it past the library.
$(addprefix $(O)/obj/tools/,stepper_module.o stepper_module_report.o): cppflags += -Idriver

demo_pictures := $(addprefix $(O)/obj/tools/,picture.o model_picture.o)
extra_demo := $(demo_pictures) $(addprefix $(O)/obj/tools/,demo.o demo_walk.o demo_figures.o \
	demo_summary.o demo_scene.o verb.o)
extra_info := $(demo_pictures) $(addprefix $(O)/obj/tools/,stepper_module.o stepper_module_report.o \
	bus_report.o stream_report.o)
calibrate_all := $(addprefix $(O)/obj/tools/,calibrate_wish.o calibrate_report.o \
	calibrate_result.o picture.o)
extra_calibrate-tip := $(calibrate_all) $(O)/obj/tools/tip_poses.o
extra_calibrate-delay := $(calibrate_all) $(addprefix $(O)/obj/tools/,delay_streams.o \
	recording_folder.o)
extra_train := $(addprefix $(O)/obj/tools/,train_wish.o train_side.o train_report.o)
extra_capture := $(addprefix $(O)/obj/tools/,capture_wish.o capture_view.o capture_report.o \
	recording_folder.o keyboard.o stopwatch.o stream_report.o)
extra_stepper := $(addprefix $(O)/obj/tools/,stepper_motion.o stepper_drive.o \
	stepper_status.o stepper_counters.o)
extra_calibrate-stepper := $(calibrate_all) $(addprefix $(O)/obj/tools/,\
	calibrate_stepper_series.o calibrate_stepper_live.o calibrate_stepper_rate.o \
	calibrate_stepper_report.o stepper_drive.o stepper_status.o stepper_counters.o)
extra_haptic := $(addprefix $(O)/obj/tools/,scene_argument.o stepper_counters.o loop_report.o \
	stroke.o notify.o haptic_actuator.o haptic_report.o haptic_self_test.o \
	haptic_supervisor.o)
extra_status := $(addprefix $(O)/obj/tools/,state_pages.o state_report.o state_follow.o \
	state_prometheus.o loop_report.o)
extra_replay := $(addprefix $(O)/obj/tools/,scene_argument.o loop_report.o picture.o \
	replay_picture.o)
extra_plan := $(addprefix $(O)/obj/tools/,scene_argument.o tick_cost.o stroke.o stopwatch.o \
	mapped_libraries.o)
extra_calibrate-force := $(calibrate_all) $(addprefix $(O)/obj/tools/,calibrate_pairs.o \
	calibrate_weights.o calibrate_force_report.o)
extra_calibrate-depth := $(calibrate_all) $(addprefix $(O)/obj/tools/,depth_wish.o \
	depth_picture.o depth_frames.o depth_lengths.o depth_corners.o depth_report.o)

# What all benches share, a line per word, and what of these bench view uses too.
bench_all := picture machine stopwatch harness yardstick figures reported_figures compare \
	compare_against memory_file folder
bench_wakeups := bench_wakeup wakeup_run bench_load cyclictest child bench_tick tick_cost stroke
extra_bench := $(patsubst %,$(O)/obj/tools/%.o,$(bench_all) $(bench_wakeups) \
	bench_precision arithmetics \
	bench_training training_data training_peer \
	bench_loop bench_rate loop_picture \
	bench_stability bench_limits bench_energy bench_guard bench_integrators sampled_wall \
	integrators ratios stability_picture \
	bench_vision scalpel_picture \
	bench_capture jpeg_camera \
	bench_pose motions pose_methods pose_error pose_picture \
	bench_timeline drifting_stream time_methods timeline_picture \
	bench_scenes scenes_picture scene_saving scene_argument made_scenes course instructions \
	loop_process mapped_libraries \
	bench_extremes extremes extremes_model extremes_fixed extremes_surface extremes_guard \
	extremes_motion extremes_plan extremes_ground extremes_wall extremes_device \
	extremes_files stiff_sweep stiff_report)

extra_view := $(addprefix $(O)/obj/tools/,scene_argument.o procedure.o state_pages.o view_job.o \
	view_real_time.o view_simulated.o view_hand.o view_live.o view_output.o png_file.o)

extra_bench-view := $(patsubst %,$(O)/obj/tools/%.o,$(bench_all) $(bench_wakeups) \
	scene_argument procedure view_script view_live similarity bench_view_frames \
	bench_view_error bench_view_live)

# What it was built with, for who reads a bench's figures; without the build's own folder.
$(O)/obj/tools/machine.o: cppflags += -DBUILD_FLAGS='"$(subst ',,$(subst ",,$(filter-out \
	-ffile-prefix-map=% -fdebug-prefix-map=% -fmacro-prefix-map=%,$(CFLAGS))))"'

extra_bench-all := $(patsubst %,$(O)/obj/tools/%.o,$(bench_all) child report_measure \
	report_folder report_document report_sections report_table document document_html \
	document_markdown)

# Pictures that incise bench has coded before it measures.
has_jpeg := $(shell $(CC) -E -x c -include stdio.h -include jpeglib.h /dev/null >/dev/null 2>&1 && echo yes)
$(O)/obj/tools/jpeg_camera.o: cppflags += $(if $(has_jpeg),-DHAVE_JPEG)
libs_bench := $(if $(has_jpeg),-ljpeg)

# Picture files that depth is calibrated from.
has_png := $(shell $(CC) -E -x c -include png.h /dev/null >/dev/null 2>&1 && echo yes)
$(O)/obj/tools/depth_picture.o $(O)/obj/tools/png_file.o: cppflags += $(if $(has_png),-DHAVE_PNG)
libs_view := $(if $(has_png),-lpng)
libs_calibrate-depth := $(if $(has_png),-lpng)

# Another project's evaluator beside ours in incise bench: a shared object of its own,
# built where its headers are. It is for measuring, and is not installed.
peer := $(if $(shell $(CXX) -E -x c++ -include fl/Headers.h /dev/null >/dev/null 2>&1 && \
	echo yes),\
	$(O)/lib/incise/peer_fuzzylite.so)

$(O)/lib/incise/peer_%.so: tools/peers/%.cc $(O)/lib/libincise.so
	@mkdir -p $(@D) $(O)/obj/tools/peers
	$(CXX) -std=c++14 -fPIC -fvisibility=hidden -Wall -Wextra $(cppflags) $(CPPFLAGS) $(CFLAGS) \
		-MMD -MP -MF $(O)/obj/tools/peers/$*.d -shared $(LDFLAGS) -o $@ $< \
		-L$(O)/lib -lincise -l$*

# And one that is a script, which runs where Python has it.
peer += $(O)/lib/incise/peer_scikit_learn.py

$(O)/lib/incise/peer_%.py: tools/peers/%.py
	@mkdir -p $(@D)
	cp $< $@

link_tool = $(CC) $(CFLAGS) $(LDFLAGS) -Wl,--as-needed $(call runpath,/../lib) \
	-Wl,-rpath-link,$(O)/lib -L$(O)/lib -o $@ $(filter %.o,$^) $1 \
	$(shell $(PKG_CONFIG) --libs jansson) -lm

define verb_program
$(O)/bin/incise-$1: $(O)/obj/tools/incise-$1.o $$(extra_$1) $(tool_shared) \
		$$(foreach lib,$$(uses_$1),$(O)/lib/lib$$(lib).so)
	@mkdir -p $$(@D)
	$$(call link_tool,$$(addprefix -l,$$(uses_$1)) $$(libs_$1))
endef
$(foreach verb,$(verbs),$(eval $(call verb_program,$(verb))))

$(O)/bin/incise: $(O)/obj/tools/incise.o $(tool_shared) $(O)/lib/libincise.so
	@mkdir -p $(@D)
	$(call link_tool,-lincise)

# Scenes by name, as after installation.
$(O)/share/incise/scenes:
	@mkdir -p $(@D)
	ln -s $(abspath scenes) $@

tools: $(programs) $(peer) | $(O)/share/incise/scenes

DEMO ?= demo.out

deps: ## install the packages that building, testing and the demo need
	@mk/deps build check demo

# The second make sees the packages that the first step brought.
demo: ## walk paper 1 on the virtual rig; pictures and summary in demo.out/
	@mk/deps build demo
	+@$(MAKE) --no-print-directory all
	$(O)/bin/incise demo -o $(DEMO) --force

bench: ## measure everything on this machine; one report in build/bench/
	@mk/deps build bench
	+@$(MAKE) --no-print-directory all
	$(O)/bin/incise bench all --report $(O)/bench

readme-figures: ## put the summary of that report, and two of its pictures, into the README
	mk/readme-figures $(O)/bench

.PHONY: tools deps demo bench readme-figures
