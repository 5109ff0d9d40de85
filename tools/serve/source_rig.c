// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The devices of a rig as a source. No loop may use them meanwhile: a device has one reader.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include "../../lib/base/vector.h"
#include "../cli/cli.h"
#include "serve.h"

#define POLL_MIN_NS 500000LL
#define POLL_MAX_NS 5000000LL
#define POSES 64
#define SAMPLES 1024
#define CAPTURE 80 /* bytes of options->capture */

struct rig {
	struct serve_source base;
	struct incise_rig *rig;
	struct incise_tracker *tracker;
	struct incise_force *force;
	struct incise_camera *camera;
	struct incise_calibration calibration;
	double surface_mm[3], normal[3];
	struct incise_tracker_info tracker_info;
	struct incise_force_info force_info;
	int64_t poll_ns, tracker_delay_ns, force_delay_ns, camera_delay_ns;
	double zero_mV; /* of the force; NAN: the mean of the first half second */
	double zero_sum;
	int64_t zero_n, zero_until_ns;
	uint64_t lost;
	struct incise_recorder *recorder; /* it reads the devices; NULL: no capture */
	const char *calibration_path;
	char *capture, ended[300]; /* its name, for pages; why it ended by itself */
	const char *failed;	   /* the device that failed */
	char why[300];
};

/* A device that failed is not read any more; the others go on. */
static void give_up(struct rig *rig, const char *device,
		    int (*cause)(void *device, char *text, size_t size), void *of)
{
	rig->failed = device;
	if (!cause(of, rig->why, sizeof(rig->why)))
		snprintf(rig->why, sizeof(rig->why), "the device failed");
	cli_warn("%s: %s", device, rig->why);
}

static int tracker_cause(void *of, char *text, size_t size)
{
	return incise_tracker_cause(of, text, size);
}

static int force_cause(void *of, char *text, size_t size)
{
	return incise_force_cause(of, text, size);
}

static int camera_cause(void *of, char *text, size_t size)
{
	return incise_camera_cause(of, text, size);
}

static double depth_mm(const struct rig *rig, const struct incise_tracker_sample *pose)
{
	double tip_mm[3], below_mm[3];

	v3_rotate(tip_mm, pose->quaternion, rig->calibration.tip_mm);
	v3_add(tip_mm, pose->position_mm, 1, tip_mm);
	v3_add(below_mm, rig->surface_mm, -1, tip_mm);
	return v3_dot(below_mm, rig->normal);
}

static void read_poses(struct rig *rig, struct serve_stream *stream)
{
	struct incise_tracker_sample poses[POSES];
	int n;

	do {
		n = incise_tracker_read(rig->tracker, poses, POSES);
		for (int i = 0; i < n; i++) {
			uint8_t station = rig->tracker_info.scalpel_station;

			if (!incise_pose_usable(poses[i].status) ||
			    (station && poses[i].station != station) ||
			    (!station && rig->tracker_info.tube_station &&
			     poses[i].station == rig->tracker_info.tube_station))
				continue;
			serve_pose(stream, poses[i].t_ns - rig->tracker_delay_ns,
				   poses[i].position_mm, poses[i].quaternion,
				   rig->calibration.tip_mm, rig->lost);
			serve_depth(stream, poses[i].t_ns - rig->tracker_delay_ns,
				    depth_mm(rig, &poses[i]));
		}
	} while (n == POSES);
	if (n >= 0)
		return;
	give_up(rig, "tracker", tracker_cause, rig->tracker);
	rig->tracker = NULL;
}

/* The zero is the mean of the first half second, as in a recording. */
static bool zero_is_known(struct rig *rig, int64_t t_ns, double mV)
{
	if (!isnan(rig->zero_mV))
		return true;
	if (!rig->zero_n)
		rig->zero_until_ns = t_ns + 500000000LL;
	rig->zero_sum += mV;
	rig->zero_n++;
	if (t_ns >= rig->zero_until_ns)
		rig->zero_mV = rig->zero_sum / (double)rig->zero_n;
	return false;
}

static void read_forces(struct rig *rig, struct serve_stream *stream)
{
	struct incise_force_sample samples[SAMPLES];
	const struct incise_force_info *info = &rig->force_info;
	double codes = ldexp(1, info->bits), force_N[3] = {0};
	int n;

	do {
		n = incise_force_read(rig->force, samples, SAMPLES);
		for (int i = 0; i < n; i++) {
			double mV = 1e3 * (info->offset_V +
					   samples[i].code * info->full_scale_V / codes);

			/* Clipped codes are no forces. */
			if (samples[i].code <= 0 ||
			    samples[i].code >= (int32_t)codes - 1 ||
			    !zero_is_known(rig, samples[i].t_ns, mV))
				continue;
			force_N[2] = (mV - rig->zero_mV) / rig->calibration.force_mV_N;
			serve_force(stream, samples[i].t_ns - rig->force_delay_ns,
				    force_N, rig->lost);
		}
	} while (n == SAMPLES);
	if (n >= 0)
		return;
	give_up(rig, "force", force_cause, rig->force);
	rig->force = NULL;
}

static void read_frames(struct rig *rig, struct serve_stream *stream)
{
	struct incise_camera_frame frame;
	int n = incise_camera_newest(rig->camera, &frame);

	if (n > 0) {
		frame.t_ns -= rig->camera_delay_ns;
		serve_frame(stream, &frame, incise_camera_lost(rig->camera));
	}
	if (n >= 0)
		return;
	give_up(rig, "camera", camera_cause, rig->camera);
	rig->camera = NULL;
}

/* --- a capture --------------------------------------------------------------------------- */

/* Returns whether it failed, and in @reply why, or what was written. @why: it ended by itself. */
static bool end_capture(struct rig *rig, const char *why, char *reply, size_t size)
{
	struct incise_error err = {0};
	bool failed = incise_recorder_close(rig->recorder, &err);

	if (failed)
		snprintf(reply, size, "%s%s%s", why, *why ? "; " : "", err.text);
	else
		snprintf(reply, size, "wrote %s.rec", rig->capture);
	cli_note("%s", reply);
	rig->recorder = NULL;
	*rig->capture = '\0';
	snprintf(rig->ended, sizeof(rig->ended), "%s", why);
	return failed;
}

/* The recorder reads all samples; the page gets the last of each. */
static void read_recorder(struct rig *rig, struct serve_stream *stream, int64_t now_ns)
{
	struct incise_recorder_stats stats;
	struct incise_error err = {0};
	char reply[400];

	if (incise_recorder_poll(rig->recorder, &err)) {
		end_capture(rig, err.text, reply, sizeof(reply));
		return;
	}
	incise_recorder_stats(rig->recorder, &stats);
	serve_force(stream, now_ns, (double[]){0, 0, stats.force_N}, stats.force_lost);
	serve_depth(stream, now_ns, stats.depth_mm);
	serve_lost(stream, stats.force_lost + stats.tracker_lost);
}

static bool is_capture_name(const char *name)
{
	size_t n = strspn(name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
				"0123456789_-");

	return n > 0 && n < 70 && !name[n] && *name != '-';
}

static bool start_capture(struct rig *rig, const char *name, char *reply, size_t size)
{
	const struct incise_recorder_setup setup = {
		.calibration = &rig->calibration,
		.calibration_path = rig->calibration_path,
		.cuts = true,
	};
	struct incise_error err = {0};
	char *path;

	if (rig->recorder || !is_capture_name(name)) {
		snprintf(reply, size,
			 rig->recorder
				 ? "%s.rec is being recorded; stop it first"
				 : "'%.80s' is no name of a recording: give letters, "
				   "digits, - and _",
			 rig->recorder ? rig->capture : name);
		return true;
	}
	path = cli_text("%s.rec", name);
	rig->recorder = incise_recorder_new(path, rig->rig, &setup, &err);
	snprintf(reply, size, "%s", rig->recorder ? path : err.text);
	free(path);
	if (!rig->recorder)
		return true;
	snprintf(rig->capture, CAPTURE, "%s", name);
	*rig->ended = '\0';
	return false;
}

static bool rig_order(struct serve_source *source, const char *what, const char *text,
		      char *reply, size_t size)
{
	struct rig *rig = (struct rig *)source;
	struct incise_error err = {0};

	if (!strcmp(what, "capture"))
		return start_capture(rig, text, reply, size);
	if (strcmp(what, "stop") && strcmp(what, "mark")) {
		snprintf(reply, size,
			 "a rig has no order '%s': there are capture, stop and mark",
			 what);
		return true;
	}
	if (!rig->recorder) {
		snprintf(reply, size, "nothing is being recorded");
		return true;
	}
	if (*what == 'm') {
		snprintf(reply, size, "marked: %s", text);
		if (!incise_recorder_mark(rig->recorder, "marker", text, &err))
			return false;
		end_capture(rig, err.text, reply, size);
		return true;
	}
	return end_capture(rig, "", reply, size);
}

/* --- the source -------------------------------------------------------------------------- */

static int rig_read(struct serve_source *source, struct serve_stream *stream,
		    int64_t now_ns, int64_t *next_ns)
{
	struct rig *rig = (struct rig *)source;
	char text[400];

	*next_ns = now_ns + rig->poll_ns;
	rig->lost = (rig->tracker ? incise_tracker_lost(rig->tracker) : 0) +
		    (rig->force ? incise_force_lost(rig->force) : 0);
	if (rig->recorder) {
		read_recorder(rig, stream, now_ns);
	} else {
		if (rig->tracker)
			read_poses(rig, stream);
		if (rig->force)
			read_forces(rig, stream);
		if (rig->camera)
			read_frames(rig, stream);
	}
	if (*rig->ended) {
		snprintf(text, sizeof(text), "the capture ended: %s", rig->ended);
		serve_status(stream, SERVE_FAULT, "fault", text);
	} else if (rig->failed) {
		snprintf(text, sizeof(text), "%s: %s", rig->failed, rig->why);
		serve_status(stream, SERVE_FAULT, "fault", text);
	} else {
		snprintf(text, sizeof(text), "rig %.200s", incise_rig_spec(rig->rig));
		serve_status(stream, SERVE_RUNS, "running", text);
	}
	return !rig->tracker && !rig->force && !rig->camera;
}

static int64_t rig_utc(struct serve_source *source, int64_t t_ns)
{
	(void)source;
	return serve_utc_of(t_ns);
}

static void rig_free(struct serve_source *source)
{
	struct rig *rig = (struct rig *)source;

	if (rig->recorder)
		end_capture(rig, "", (char[400]){0}, 400);
	incise_rig_close(rig->rig);
	free(rig);
}

static const struct serve_source_ops rig_ops = {
	.read = rig_read, .order = rig_order, .utc = rig_utc, .free = rig_free};

static int64_t delay_ns(double ms, int64_t own_ns)
{
	return isnan(ms) ? own_ns : (int64_t)(ms * 1e6);
}

struct serve_source *serve_rig_open(const struct serve_source_options *options,
				    struct serve_info *info)
{
	struct rig *rig = cli_alloc(1, sizeof(*rig));
	unsigned int camera = !options->camera ? 0
			      : options->camera_needed
				      ? INCISE_RIG_CAMERA
				      : INCISE_RIG_CAMERA | INCISE_RIG_IF_NAMED;

	rig->base.ops = &rig_ops;
	rig->rig = cli_open_rig(options->rig, INCISE_RIG_TRACKER | INCISE_RIG_FORCE |
						      INCISE_RIG_FORCE_IF_NAMED | camera);
	incise_rig_haptic_place(rig->rig, &options->calibration);
	if (!incise_clock_is_real(incise_rig_clock(rig->rig)))
		cli_fail("%s: its clock is simulated, and clients live in real time; use "
			 "clock=real",
			 incise_rig_spec(rig->rig));
	rig->calibration = options->calibration;
	incise_rig_surface(rig->rig, rig->surface_mm, rig->normal);
	rig->tracker = incise_rig_tracker(rig->rig);
	rig->force = incise_rig_force(rig->rig);
	rig->camera = incise_rig_camera(rig->rig);
	incise_tracker_info(rig->tracker, &rig->tracker_info);
	if (rig->force)
		incise_force_info(rig->force, &rig->force_info);
	incise_force_calibration(&rig->force_info, &rig->calibration);
	rig->zero_mV = rig->calibration.force_zero_mV;
	rig->tracker_delay_ns =
		delay_ns(rig->calibration.tracker_delay_ms, rig->tracker_info.latency_ns);
	rig->force_delay_ns = delay_ns(rig->calibration.force_delay_ms, 0);
	rig->camera_delay_ns = delay_ns(rig->calibration.camera_delay_ms, 0);
	/* Four looks in the period of sending: a quarter of it late at most. */
	rig->poll_ns = (int64_t)(1e9 / options->rate_hz / 4);
	rig->poll_ns = rig->poll_ns < POLL_MIN_NS   ? POLL_MIN_NS
		       : rig->poll_ns > POLL_MAX_NS ? POLL_MAX_NS
						    : rig->poll_ns;
	info->name = cli_text("rig %s", incise_rig_spec(rig->rig));
	rig->capture = options->capture;
	rig->calibration_path = options->calibration_path;
	info->kinds[SERVE_POSE] = info->kinds[SERVE_DEPTH] = true;
	info->kinds[SERVE_FORCE] = rig->force;
	info->kinds[SERVE_FRAME] = rig->camera;
	return &rig->base;
}
