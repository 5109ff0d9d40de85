// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Files from outside with broken bytes: each is refused with one line, or works.
 */
#include <limits.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/calibration.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include <incise/plan.h>
#include <incise/recorder.h>
#include <incise/recording.h>
#include <incise/rig.h>
#include "../../lib/surface/surface.h"
#include "any_pose.h"
#include "../cli/cli.h"
#include "extremes.h"
#include "extremes_ground.h"
#include "../cli/folder.h"
#include "../cli/file.h"

#define SIZE_MAX_BYTES (1 << 20)

/* A file, whole, and the one that is broken each time. */
struct bytes {
	char *whole, *broken;
	size_t n, n_broken;
};

/* Loads what is at @path and tries it: 0 it works; 1 refused, with @err; -1 wrong. */
typedef int (*load)(const char *path, struct incise_error *err);

static int load_scene(const char *path, struct incise_error *err)
{
	struct incise_scene *scene = incise_scene_load(path, NULL, err);
	struct incise_plan *plan = scene ? incise_plan_new(scene, NULL, err) : NULL;
	int rc = plan ? 0 : 1;

	for (int i = 1; plan && i < 40; i++) {
		struct incise_tracker_sample s = {.t_ns = i * INT64_C(1000000),
						  .position_mm = {0, 0, 20 - i},
						  .quaternion = {1}};
		struct incise_tick t;

		incise_plan_feed(plan, &s, 1);
		if (incise_plan_tick(plan, s.t_ns, &t) || !isfinite(t.command_N[0]) ||
		    !isfinite(t.command_N[1]) || !isfinite(t.command_N[2]))
			rc = -1;
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
	return rc;
}

static int load_fis(const char *path, struct incise_error *err)
{
	struct incise_model *model = incise_model_load(path, err);
	int rc = model ? 0 : 1;

	for (int i = 0; model && i < 20; i++) {
		double x[INCISE_MODEL_INPUTS_MAX];

		for (int k = 0; k < INCISE_MODEL_INPUTS_MAX; k++)
			x[k] = special();
		if (!isfinite(incise_model_eval(model, x, NULL)))
			rc = -1;
	}
	incise_model_free(model);
	return rc;
}

static int load_fx(const char *path, struct incise_error *err)
{
	struct incise_fixed *fx = incise_fixed_load(path, err);
	int rc = fx ? 0 : 1;

	for (int i = 0; fx && i < 20; i++) {
		double x[INCISE_FIXED_INPUTS_MAX] = {special(), special()};

		if (!isfinite(incise_fixed_eval_double(fx, x)))
			rc = -1;
	}
	incise_fixed_free(fx);
	return rc;
}

static int try_surface(struct incise_surface *surface)
{
	int rc = surface ? 0 : 1;

	for (int i = 0; surface && i < 10; i++) {
		double p[3] = {between(-90, 90), between(-90, 90), between(-90, 90)};
		struct incise_touch touch;

		incise_surface_nearest(surface, p, &touch);
		if (!isfinite(touch.depth_mm) || !isfinite(touch.normal[0]))
			rc = -1;
	}
	incise_surface_free(surface);
	return rc;
}

static int load_mesh(const char *path, struct incise_error *err)
{
	return try_surface(incise_surface_load_mesh(path, (double[3]){0}, err));
}

static int load_heights(const char *path, struct incise_error *err)
{
	return try_surface(incise_surface_load_heights(path, (double[3]){0}, err));
}

static int load_rig(const char *path, struct incise_error *err)
{
	struct incise_rig *rig = incise_rig_open(path, INCISE_RIG_TRACKER, err);

	incise_rig_close(rig);
	return rig ? 0 : 1;
}

static int load_calibration(const char *path, struct incise_error *err)
{
	struct incise_calibration calibration;

	return incise_calibration_load(path, &calibration, err) ? 1 : 0;
}

static void write_scene(FILE *out)
{
	fputs("rate_hz = 1000.0;\narithmetic = \"double\";\n"
	      "surface = { kind = \"capsule\"; from_mm = [-60.0, 0.0, -55.0];\n"
	      "  to_mm = [160.0, 0.0, -55.0]; radius_mm = 55.0; };\n"
	      "tissue = { reaction_N_mm = 0.14; plane_N_mm = 0.17; damping_N_s_mm = 0.0005;\n"
	      "  insertion_N_mm = 0.28; aligned = 0.2; spread_N_mm = 0.22; leave_mm = 0.3; "
	      "};\n"
	      "effects = { average_ticks = 8; guard = true; };\ntool = { handle_mm = 120.0; };\n"
	      "device = { mass_kg = 0.05; coulomb_N = 0.1; delay_ticks = 3; };\n"
	      "limits = { force_N = 4.0; slew_N_s = 400.0; pose_age_ms = 50.0; };\n",
	      out);
}

static void write_fx(FILE *out)
{
	struct memory_file force = memory_file_begin("model");
	struct incise_error err = {0};
	struct incise_fixed *fx;
	struct incise_model *model;

	ground_write_model(force.file);
	memory_file_written(&force);
	model = incise_model_load(force.path, &err);
	fx = model ? incise_fixed_compile(model, NULL, &err) : NULL;
	if (!fx)
		cli_fail_with(&err);
	fwrite(fx->blob, 1, fx->size, out);
	incise_fixed_free(fx);
	incise_model_free(model);
	fclose(force.file);
}

static void write_mesh(FILE *out)
{
	fputs("# a box without a lid\nv -50 -50 0\nv 50 -50 0\nv 50 50 1\nv -50 50 0\n"
	      "v -50 -50 -9\nv 50 -50 -9\nv 50 50 -9\nv -50 50 -9\nvt 0 0\nvt 1 0\nvt 1 1\n"
	      "f 1/1 2/2 3/3\nf 1/1 3/3 4/1\nf 5 6 2 1\nf 6 7 3 2\nf 7 8 4 3\nf 8 5 1 4\n",
	      out);
}

static void write_heights(FILE *out)
{
	fputs("ncols 3\nnrows 3\nxllcenter -9\nyllcenter -9\ncellsize 18\nNODATA_value -9999\n"
	      "0 1 0\n0.5 1e-3 2\n0 0 -0.25\n",
	      out);
}

static void write_rig(FILE *out)
{
	fputs("clock = \"simulated\";\ntracker = \"sim:\";\n"
	      "surface = { point_mm = [0.0, 0.0, 0.0]; normal = [0.0, 0.0, 1.0]; };\n"
	      "tracker_setup = { hemisphere = [1.0, 0.0, 0.0]; };\n"
	      "sim = { seed = 1; cut_s = 8.0; depth_mm = [5.0, 10.0]; times = [3, 4];\n"
	      "  tracker_hz = 120.0; tooth = 0.2; };\n",
	      out);
}

static void write_calibration(FILE *out)
{
	fputs("force_mV_N = 1240.0;\nforce_zero_mV = 180.0;\ndepth_mm_px = 0.11875;\n"
	      "tracker_delay_ms = 4.2;\ntracker_delay_sd_ms = 0.1;\ntip_mm = [0.1, 0.0, -2.0];\n"
	      "stepper_N_step = 0.00125;\nstepper_backlash_mm = 0.01;\n",
	      out);
}

static struct bytes take(void (*write)(FILE *out))
{
	struct bytes bytes = {0};
	FILE *out = open_memstream(&bytes.whole, &bytes.n);

	if (!out)
		cli_fail("no memory");
	write(out);
	if (fclose(out) || bytes.n > SIZE_MAX_BYTES)
		cli_fail("a file of %zu bytes is too large to be broken", bytes.n);
	bytes.broken = malloc(2 * bytes.n + 64);
	if (!bytes.broken)
		cli_fail("no memory");
	return bytes;
}

/* Flipped bits, other bytes, a stretch that is gone, twice there, or cut off; numbers. */
static void break_bytes(struct bytes *bytes)
{
	static const char *const bits[] = {"1e999", "-1e308", "nan",	    "-1",
					   "0",	    "1e-320", "2147483648", "\"\"",
					   "[",	    "}",      "/*",	    "\n"};
	size_t n = bytes->n, from, many;

	memcpy(bytes->broken, bytes->whole, n);
	for (uint32_t k = 1 + (below(2) ? 0 : below(4)); k && n > 40; k--) {
		const char *bit = bits[below(12)];

		from = below((uint32_t)n - 20);
		many = below(20);
		switch (below(6)) {
		case 0:
			bytes->broken[from] = (char)any();
			break;
		case 1:
			memmove(bytes->broken + from, bytes->broken + from + many,
				n - from - many);
			n -= many;
			break;
		case 2:
			if (n + many > 2 * bytes->n)
				break;
			memmove(bytes->broken + from + many, bytes->broken + from,
				n - from);
			n += many;
			break;
		case 3:
			memcpy(bytes->broken + from, bit, strlen(bit));
			break;
		default:
			bytes->broken[from] ^= (char)(1 << below(8));
		}
	}
	bytes->n_broken = below(20) ? n : below((uint32_t)n);
}

static void judge(struct extremes_row *row, int rc, const struct incise_error *err)
{
	if (rc == 1)
		extremes_refused(row, err);
	else if (extremes_first_wrong(row, !rc))
		extremes_tell(row, "loaded, and does not work, case %ld", row->tried);
}

static void try_file(struct extremes *all, const char *name, const char *what,
		     void (*write)(FILE *out), load load, long cases)
{
	struct extremes_row *row = extremes_begin(all, name, what);
	struct bytes bytes = take(write);

	rng = extremes_seed(all, row);
	for (long k = extremes_cases(all, cases); k >= 0; k--) {
		struct memory_file file = memory_file_begin("broken");
		struct incise_error err = {0};
		int rc;

		break_bytes(&bytes);
		/* What is broken was whole before. */
		fwrite(row->tried ? bytes.broken : bytes.whole, 1,
		       row->tried ? bytes.n_broken : bytes.n, file.file);
		memory_file_written(&file);
		rc = load(file.path, &err);
		if (!row->tried && rc == 1)
			cli_fail("%s is refused although it is whole: %s", name,
				 err.text);
		judge(row, rc, &err);
		fclose(file.file);
	}
	free(bytes.whole);
	free(bytes.broken);
}

/* ---- recordings ---- */

static int record(const char *path, struct incise_error *err)
{
	struct incise_recorder_setup setup = {.planned_s = 1};
	struct incise_calibration calibration;
	struct incise_rig *rig =
		incise_rig_open("sim:clock=simulated,times=1,cut_s=0.5,pause_s=0.6,"
				"force_hz=1000",
				INCISE_RIG_TRACKER | INCISE_RIG_FORCE, err);
	struct incise_recorder *recorder;
	struct incise_clock *clock;
	int rc = 0;

	if (!rig)
		return -1;
	incise_calibration_nominal(&calibration);
	setup.calibration = &calibration;
	recorder = incise_recorder_new(path, rig, &setup, err);
	clock = incise_rig_clock(rig);
	for (int i = 0; recorder && rc >= 0 && i < 20; i++) {
		incise_clock_wait_until(clock, incise_clock_now(clock) + 50000000);
		rc = incise_recorder_poll(recorder, err);
	}
	if (!recorder || rc < 0 || incise_recorder_close(recorder, err))
		rc = -1;
	incise_rig_close(rig);
	return rc < 0 ? -1 : 0;
}

static int read_whole(struct bytes *bytes, const char *path, struct incise_error *err)
{
	FILE *file = fopen(path, "r");

	if (!file)
		return incise_error_set(err, errno, "%s: %s", path, strerror(errno));
	bytes->n = fread(bytes->whole, 1, SIZE_MAX_BYTES, file);
	fclose(file);
	return 0;
}

static int write_broken(const struct bytes *bytes, const char *path,
			struct incise_error *err)
{
	FILE *file = fopen(path, "w");
	bool written = file &&
		       fwrite(bytes->broken, 1, bytes->n_broken, file) == bytes->n_broken;

	if (file && fclose(file))
		written = false;
	return written ? 0
		       : incise_error_set(err, errno, "%s: %s", path, strerror(errno));
}

static int open_recording(const char *path, struct incise_error *err)
{
	struct incise_recording *recording = incise_recording_open(path, err);
	struct incise_recording_value *values = NULL;
	struct incise_tracker_sample *poses = NULL;
	struct incise_recording_info info;
	int rc = recording ? incise_recording_info(recording, &info, err) : -1;

	if (!rc && incise_recording_values(recording, "force", &values, err) < 0)
		rc = -1;
	if (!rc && incise_recording_poses(recording, &poses, err) < 0)
		rc = -1;
	free(values);
	free(poses);
	incise_recording_close(recording);
	return rc ? 1 : 0;
}

static void try_recording(struct extremes *all)
{
	struct extremes_row *row = extremes_begin(
		all, "recording_bytes",
		"a recording whose database has broken bytes: refused with one line, or read");
	char folder[PATH_MAX - 80], path[PATH_MAX - 60], database[PATH_MAX];
	struct incise_error failed = {0};
	struct bytes bytes = {0};
	int rc;

	bytes.whole = malloc(SIZE_MAX_BYTES);
	bytes.broken = malloc(2 * SIZE_MAX_BYTES + 64);
	if (!bytes.whole || !bytes.broken)
		cli_fail("no memory");
	/* The folder is gone afterwards, come what may. */
	cli_catch_signals();
	folder_make(folder, sizeof(folder), "for a recording");
	snprintf(path, sizeof(path), "%s/a.rec", folder);
	snprintf(database, sizeof(database), "%s/recording.db", path);
	rc = record(path, &failed);
	if (!rc)
		rc = read_whole(&bytes, database, &failed);
	rng = extremes_seed(all, row);
	for (long k = extremes_cases(all, 2000); k && !rc && !cli_stop; k--) {
		struct incise_error err = {0};

		break_bytes(&bytes);
		rc = write_broken(&bytes, database, &failed);
		if (!rc)
			judge(row, open_recording(path, &err), &err);
	}
	folder_remove(folder);
	if (rc)
		cli_fail_with(&failed);
	free(bytes.whole);
	free(bytes.broken);
}

void extremes_files(struct extremes *all)
{
	try_file(
		all, "scene_bytes",
		"a scene with broken bytes: refused with one line, or its plan's ticks are "
		"finite",
		write_scene, load_scene, 6000);
	try_file(
		all, "fis_bytes",
		"a .fis with broken bytes: refused with one line, or finite at any inputs",
		ground_write_model, load_fis, 40000);
	try_file(all, "fx_bytes", "a .fx with broken bytes: refused with one line",
		 write_fx, load_fx, 20000);
	try_file(
		all, "mesh_bytes",
		"an OBJ with broken bytes: refused with one line, or its nearest points are "
		"finite",
		write_mesh, load_mesh, 20000);
	try_file(all, "heights_bytes", "the same of an ESRI ASCII grid", write_heights,
		 load_heights, 20000);
	try_file(
		all, "rig_bytes",
		"a rig.conf of a virtual rig with broken bytes: refused with one line, or "
		"opened",
		write_rig, load_rig, 10000);
	try_file(all, "calibration_bytes",
		 "a calibration.conf with broken bytes: refused with one line, or read",
		 write_calibration, load_calibration, 10000);
	try_recording(all);
}
