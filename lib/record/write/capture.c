// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A whole capture; see incise/capture.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <incise/capture.h>
#include <incise/sim.h>
#include "../../../driver/uapi/incise_stepper.h"
#include "recorder.h"

#define POLL_NS 10000000LL
/* The first point of wall time comes at once, unless its source hangs. */
#define WALL_PATIENCE_NS (3 * INCISE_NS_PER_S)
#define SYNC_EVERY_NS INCISE_NS_PER_S
#define POSES_EVERY_NS INCISE_NS_PER_S
#define POSES_LEAST 100 /* of fewer, one is too many */

struct capture {
	const struct incise_capture_options *options;
	struct incise_capture_result *result;
	struct incise_rig *rig;
	struct incise_capture_state state;
	int64_t start_ns, end_ns; /* of the recording; end_ns INT64_MAX: not known */
	int64_t armed_ns;	  /* start of the waiting */
	int64_t due_ns;	  /* the start at a time, by the rig's clock; 0: not known */
	int sync;	  /* events of the stepper module; -1: none */
	int64_t sync_ns;  /* of the last pulse that was noted */
	int64_t poses_ns; /* last check of the poses */
	bool clocked;	  /* the source of the wall time was checked */
	bool warned;	  /* of flagged poses */
};

INCISE_PRINTF(2, 3)
static void put_warning(const struct incise_capture_options *options, const char *fmt,
			...)
{
	va_list args;
	char *text;

	va_start(args, fmt);
	if (options->warn && vasprintf(&text, fmt, args) >= 0) {
		options->warn(options->context, text);
		free(text);
	}
	va_end(args);
}

/* --- start at a time --------------------------------------------------------------------- */

/* The fraction behind the seconds, in ns; *text goes behind it. False: no digits. */
static bool parse_fraction(const char **text, int64_t *ns)
{
	int64_t unit = INCISE_NS_PER_S;

	*ns = 0;
	if (**text != '.')
		return true;
	while (*++*text >= '0' && **text <= '9') {
		unit /= 10;
		*ns += (**text - '0') * unit;
	}
	return unit < INCISE_NS_PER_S;
}

int incise_capture_start_at(struct incise_capture_options *options, const char *text,
			    struct incise_error *err)
{
	struct tm date = {0}, day;
	const char *end = strptime(text, "%Y-%m-%dT%H:%M:%S", &date);
	int64_t fraction_ns = 0;
	time_t s;

	/* timegm() makes another day of one that there is not, as 2026-02-30. */
	day = date;
	s = end ? timegm(&date) : -1;
	if (end && !parse_fraction(&end, &fraction_ns))
		end = NULL;
	options->start_tai = end && !strcmp(end, "TAI");
	if (!end || s < 0 || s > INT32_MAX * 2LL || date.tm_mday != day.tm_mday ||
	    (!options->start_tai && strcmp(end, "Z") != 0))
		return incise_error_set(
			err, EINVAL,
			"--start-at: expected a time such as 2026-11-27T12:00:00Z, or "
			"one with TAI in place of Z, found '%s'",
			text);
	options->at_time = true;
	options->start_ns = s * INCISE_NS_PER_S + fraction_ns;
	return 0;
}

/* Time until the start, ns; INT64_MAX while there is no wall time. */
static int64_t find_time_left(const struct capture *capture, int64_t now_ns)
{
	const struct incise_capture_options *options = capture->options;
	const struct incise_recorder_wall *wall = &capture->state.recorder->wall;
	int64_t start_ns = options->start_ns;

	if (!wall->known)
		return INT64_MAX;
	if (!options->start_tai)
		start_ns += wall->newest.utc_offset_s * INCISE_NS_PER_S;
	/* The rate within a second changes less than a poll takes. */
	return start_ns - (wall->newest.tai_ns + (now_ns - wall->newest.t_ns));
}

/* The time triggers, before the poll that starts to write. Returns 0 or -EINVAL. */
static int follow_time(struct capture *capture, int64_t now_ns, struct incise_error *err)
{
	int64_t left_ns;

	capture->state.left_s = NAN;
	if (!capture->options->at_time || !capture->state.armed)
		return 0;
	left_ns = find_time_left(capture, now_ns);
	if (left_ns == INT64_MAX && now_ns - capture->armed_ns < WALL_PATIENCE_NS)
		return 0;
	if (left_ns == INT64_MAX)
		return incise_error_set(err, EINVAL,
					"--start-at: the clock of this rig has no wall "
					"time; see --clock-source; nothing was recorded");
	if (!capture->due_ns && left_ns < 0)
		return incise_error_set(err, EINVAL,
					"--start-at: this time is in the past; give one "
					"to come, after the devices are open; nothing "
					"was recorded");
	capture->due_ns = now_ns + left_ns;
	if (left_ns <= 0)
		incise_recorder_trigger(capture->state.recorder);
	capture->state.left_s = (double)left_ns / (double)INCISE_NS_PER_S;
	return 0;
}

/* --- the SYNC line ------------------------------------------------------------------------- */

/* Open the events of a controller. Returns a file descriptor or -errno. */
static int open_sync(const char *path, struct incise_error *err)
{
	struct incise_stepper_controller controller = {0};
	int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
	struct stat st;
	bool known;

	if (fd < 0)
		return incise_error_set(
			err, errno, "--trigger sync: %s: %s; %s", path, strerror(errno),
			errno == EACCES ? "join the group incise, or run as root"
					: "incise info stepper lists the controllers");
	if (!fstat(fd, &st) && S_ISFIFO(st.st_mode))
		return fd;
	known = !ioctl(fd, INCISE_STEPPER_GET_INFO, &controller);
	if (known && (controller.capabilities & INCISE_STEPPER_CAP_SYNC))
		return fd;
	close(fd);
	return incise_error_set(
		err, ENOTTY, "--trigger sync: %s: %s", path,
		known ? "has no SYNC line; see its configuration in incise help stepper"
		      : "not a controller of the stepper module; incise info stepper "
			"lists them");
}

/* Read the next pulse; does not wait. Returns 1, 0 (none) or -errno of a device that is gone. */
static int next_pulse(int fd, struct incise_stepper_event *event)
{
	ssize_t n;

	while ((n = read(fd, event, sizeof(*event))) == sizeof(*event))
		if (event->type == INCISE_STEPPER_EVENT_SYNC)
			return 1;
	return n < 0 && errno != EAGAIN && errno != EINTR ? -errno : 0;
}

/* A pulse triggers; of the others one a second is an event. Returns 0 or -errno. */
static int follow_sync(struct capture *capture, struct incise_error *err)
{
	struct incise_recorder *recorder = capture->state.recorder;
	struct incise_stepper_event event;
	int rc = 0;

	while (capture->sync >= 0 && (rc = next_pulse(capture->sync, &event)) > 0) {
		if (!capture->state.armed &&
		    event.t_ns - capture->sync_ns < SYNC_EVERY_NS)
			continue;
		rc = incise_recorder_note_at(recorder, event.t_ns, "sync", "pulse %lld",
					     (long long)event.position);
		recorder->failed = incise_recorder_check(recorder, rc, err);
		if (recorder->failed)
			return recorder->failed;
		capture->sync_ns = event.t_ns;
		if (!capture->state.armed)
			continue;
		incise_recorder_trigger(recorder);
		return 0;
	}
	if (rc && capture->state.armed)
		return incise_error_set(err, ENODEV,
					"--trigger sync: %s: is gone; reconnect it",
					capture->options->sync);
	return 0;
}

/* --- doubts ------------------------------------------------------------------------------ */

/* Whether a point is not of the source that was named; "ptp-master" is of ptp. */
static bool is_of_another(const char *named, const struct incise_wall_point *point)
{
	size_t length = named ? strcspn(named, ":") : 0;

	return length && strncmp(named, "auto", length) != 0 &&
	       strncmp(named, "sim", length) != 0 &&
	       (point->held || strncmp(point->source, named, length) != 0);
}

/* Warn at the start of a source that was named and gives no time, as it may come later. */
static void check_clock(struct capture *capture)
{
	const char *named = capture->options->recorder.clock_source;
	const struct incise_recorder_wall *wall = &capture->state.recorder->wall;

	if (capture->clocked || !wall->known)
		return;
	capture->clocked = true;
	if (is_of_another(named, &wall->newest))
		put_warning(
			capture->options,
			"--clock-source %s: not synchronised: the error of the wall time is "
			"unknown until it is; see %s",
			named,
			!strncmp(named, "chrony", 6) ? "'chronyc tracking'"
			: !strncmp(named, "ptp", 3)
				? "'pmc -u -b 0 \"GET TIME_STATUS_NP\"'"
				: "'timedatectl timesync-status'");
}

/* Warn of settings of the devices, when they can still be mended. */
static void warn_of_devices(struct capture *capture)
{
	struct incise_stream streams[INCISE_STREAMS_MAX];
	int n = incise_recorder_describe_streams(capture->state.recorder, streams);

	for (int i = 0; i < n; i++)
		if (*streams[i].note)
			put_warning(capture->options, "%s: %s", streams[i].device,
				    streams[i].note);
}

/* Whether more than 1 % of the poses are flagged, usable or not. */
static bool poses_are_doubtful(const struct incise_pose_counts *poses)
{
	uint64_t flagged = 0;

	for (int i = 0; i < 128; i++)
		flagged += poses->flagged[i];
	return flagged * 100 > poses->poses;
}

/* Warn once, when it can still be mended. */
static void check_poses(struct capture *capture, int64_t now_ns)
{
	const struct incise_pose_counts *poses = &capture->state.recorder->stats.poses;
	char text[1000];

	if (capture->warned || now_ns - capture->poses_ns < POSES_EVERY_NS)
		return;
	capture->poses_ns = now_ns;
	if (poses->poses < POSES_LEAST || !poses_are_doubtful(poses))
		return;
	incise_pose_counts_text(poses, text, sizeof(text));
	put_warning(capture->options, "%s", text);
	capture->warned = true;
}

/* Losses that nothing shows. */
static void warn_unsure(struct capture *capture)
{
	const struct incise_recorder *recorder = capture->state.recorder;

	for (int i = INCISE_LEDGER_FORCE; i <= INCISE_LEDGER_TRACKER; i++)
		if (incise_recorder_unsure(recorder, i))
			put_warning(
				capture->options,
				"%s: samples come in blocks, so that a lost one may be "
				"missing in the count; connect it without a hub or a "
				"network, or send in smaller blocks",
				recorder->streams[i].device);
}

/* --- recording ----------------------------------------------------------------------------- */

/* Whether it waits for something before it records. */
static bool has_trigger(const struct incise_capture_options *options)
{
	return options->recorder.trigger_button ||
	       options->recorder.trigger_force_N > 0 || options->sync || options->at_time;
}

/* The recording starts, maybe at its trigger; this sets its end. */
static void start_recording(struct capture *capture, int64_t now_ns)
{
	struct incise_sim *sim = incise_rig_sim(capture->rig);
	double duration_s = capture->options->duration_s;
	int64_t held_ns = now_ns - capture->armed_ns;

	capture->state.armed = false;
	capture->start_ns = now_ns;
	capture->result->start_ns =
		now_ns - (held_ns < INCISE_NS_PER_S ? held_ns : INCISE_NS_PER_S);
	if (duration_s > 0)
		capture->end_ns = now_ns + (int64_t)(duration_s * INCISE_NS_PER_S);
	else if (!sim)
		capture->end_ns = INT64_MAX;
	else if (!capture->end_ns) /* a trigger does not restart the virtual cuts */
		capture->end_ns = now_ns + incise_sim_duration(sim);
	if (capture->end_ns < INT64_MAX)
		capture->state.planned_s =
			(double)(capture->end_ns - now_ns) / (double)INCISE_NS_PER_S;
}

/* Start, or wait for the trigger. */
static void begin_capture(struct capture *capture, int64_t now_ns)
{
	const struct incise_capture_options *options = capture->options;
	struct incise_sim *sim = incise_rig_sim(capture->rig);

	warn_of_devices(capture);
	capture->start_ns = capture->armed_ns = now_ns;
	capture->state.armed = has_trigger(options);
	if (!capture->state.armed)
		start_recording(capture, now_ns);
	else if (sim && !options->at_time && !options->sync)
		/* After its cuts the virtual rig triggers nothing. */
		capture->end_ns = now_ns + incise_sim_duration(sim);
	else
		capture->end_ns = INT64_MAX;
}

/* Poll, and follow triggers and doubts. Returns 0 or -errno. */
static int poll_once(struct capture *capture, int64_t now_ns, struct incise_error *err)
{
	const struct incise_capture_options *options = capture->options;
	int rc = follow_time(capture, now_ns, err);

	if (!rc)
		rc = incise_recorder_poll(capture->state.recorder, err);
	if (rc > 0)
		capture->result->early = *err;
	if (rc >= 0)
		rc = follow_sync(capture, err);
	if (rc)
		return rc;
	if (capture->state.armed && !capture->state.recorder->stats.armed)
		start_recording(capture, now_ns);
	check_clock(capture);
	check_poses(capture, now_ns);
	capture->state.seconds =
		(double)(now_ns - capture->start_ns) / (double)INCISE_NS_PER_S;
	return options->step ? options->step(options->context, &capture->state, err) : 0;
}

/* Record until the end, a stop or a failure. Returns 0 or -errno. */
static int record_samples(struct capture *capture, struct incise_error *err)
{
	const volatile sig_atomic_t *stop = capture->options->stop;
	struct incise_capture_result *result = capture->result;
	struct incise_clock *clock = incise_rig_clock(capture->rig);
	int64_t now = incise_clock_now(clock), next = now;
	int rc = 0;

	begin_capture(capture, now);
	while (!rc && !result->early.code && !(stop && *stop) && now < capture->end_ns) {
		next = now > next + POLL_NS ? now : next + POLL_NS;
		if (next > capture->end_ns)
			next = capture->end_ns;
		if (capture->state.armed && capture->due_ns > now &&
		    next > capture->due_ns)
			next = capture->due_ns;
		incise_clock_wait_until(clock, next);
		now = incise_clock_now(clock);
		rc = poll_once(capture, now, err);
	}
	if (!capture->state.armed)
		result->seconds =
			(double)(now - result->start_ns) / (double)INCISE_NS_PER_S;
	return rc;
}

/* End the recording; one that was never triggered leaves nothing. Returns @rc, 0 or -errno. */
static int end_capture(struct capture *capture, const char *path, int rc,
		       struct incise_error *err)
{
	struct incise_capture_result *result = capture->result;
	struct incise_recorder *recorder = capture->state.recorder;
	struct incise_recording *recording;
	int closed;

	if (!rc)
		rc = incise_recorder_end(recorder, err);
	incise_recorder_stats(recorder, &result->stats);
	if (result->stats.armed) {
		incise_recorder_discard(recorder);
		if (!rc && result->early.code)
			rc = incise_error_set(err, result->early.code, "%s",
					      result->early.text);
		else if (!rc)
			rc = incise_error_set(err, ECANCELED,
					      "%s: it was never triggered; nothing was "
					      "recorded",
					      path);
		return rc;
	}
	warn_unsure(capture);
	closed = incise_recorder_close(recorder, rc ? NULL : err);
	if (rc || closed)
		return rc ? rc : closed;
	recording = incise_recording_open(path, NULL);
	if (recording)
		result->wall = incise_recording_wall(recording, NULL);
	incise_recording_close(recording);
	return 0;
}

int incise_capture_run(const char *path, struct incise_rig *rig,
		       const struct incise_capture_options *options,
		       struct incise_capture_result *result, struct incise_error *err)
{
	struct incise_recorder_setup setup = options->recorder;
	struct capture capture = {
		.options = options, .result = result, .rig = rig, .sync = -1};
	struct incise_sim *sim = incise_rig_sim(rig);
	struct incise_error unused;
	int rc;

	*result = (struct incise_capture_result){0};
	if (!err)
		err = &unused;
	if (options->at_time && !setup.clock_source &&
	    !incise_clock_is_real(incise_rig_clock(rig)))
		return incise_error_set(err, EINVAL,
					"--start-at: the clock of this rig is simulated "
					"and has no wall time; give it one by "
					"--clock-source sim");
	setup.armed = has_trigger(options);
	setup.planned_s = options->duration_s;
	if (sim && !(setup.planned_s > 0))
		setup.planned_s =
			(double)incise_sim_duration(sim) / (double)INCISE_NS_PER_S;
	if (options->sync && (capture.sync = open_sync(options->sync, err)) < 0)
		return capture.sync;
	capture.state.recorder = incise_recorder_new(path, rig, &setup, err);
	rc = capture.state.recorder
		     ? end_capture(&capture, path, record_samples(&capture, err), err)
		     : -errno;
	if (capture.sync >= 0)
		close(capture.sync);
	return rc;
}

/* --- verdict ------------------------------------------------------------------------------- */

static int reject_losses(const char *path, const struct incise_recorder_stats *stats,
			 struct incise_error *err)
{
	const struct {
		uint64_t n;
		const char *noun;
	} lost[] = {
		{stats->force_lost, "force sample"},
		{stats->tracker_lost, "tracker sample"},
		{stats->frames_lost, "frame"},
	};
	uint64_t sum = 0;
	char text[200] = "";
	size_t at = 0;

	for (int i = 0; i < 3; i++) {
		sum += lost[i].n;
		if (lost[i].n)
			at += (size_t)snprintf(text + at, sizeof(text) - at,
					       "%s%llu %s%s", at ? ", " : "",
					       (unsigned long long)lost[i].n,
					       lost[i].noun, lost[i].n == 1 ? "" : "s");
	}
	if (!sum)
		return 0;
	return incise_error_set(err, ENODATA,
				"%s: %s %s lost; 'incise verify %s' lists when", path,
				text, sum == 1 ? "was" : "were", path);
}

/* Warn of points that are not of the source that was named. */
static void judge_wall(const char *path, const struct incise_capture_options *options,
		       const struct incise_wall *wall)
{
	const char *named = options->recorder.clock_source;
	const struct incise_wall_point *points;
	size_t n = wall ? incise_wall_points(wall, &points) : 0, others = 0;

	for (size_t i = 0; i < n; i++)
		others += is_of_another(named, &points[i]);
	if (others)
		put_warning(
			options,
			"%s: the wall time is not by %s in %zu of %zu points, with an unknown "
			"or a growing error",
			path, named, others, n);
}

/* Reject a stream whose device failed, or sent nothing. Returns 0 or -errno. */
static int judge_streams(const char *path, const struct incise_capture_result *result,
			 struct incise_error *err)
{
	const struct incise_stream *streams = result->stats.streams;
	const int n = result->stats.n_streams;

	for (int i = 0; i < n; i++)
		if (*streams[i].ended)
			return incise_error_set(
				err, ENODEV,
				"%s: the %s failed before the end of the recording: %s",
				path, streams[i].name, streams[i].ended);
	for (int i = 0; i < n; i++)
		if (!streams[i].rows && strcmp(streams[i].name, "camera"))
			return incise_error_set(
				err, ENODATA,
				"%s: no samples arrived from the %s in %.1f s; check its "
				"cable and power",
				path,
				strcmp(streams[i].name, "force") ? "tracker"
								 : "force channel",
				result->seconds);
	return 0;
}

/* Warn of poses that give no depth or are flagged. */
static void judge_poses(const char *path, const struct incise_capture_options *options,
			const struct incise_recorder_stats *stats)
{
	char text[1000];

	incise_pose_counts_text(&stats->poses, text, sizeof(text));
	if (poses_are_doubtful(&stats->poses))
		put_warning(options, "%s: %s", path, text);
	else if (!stats->depth)
		put_warning(
			options,
			"%s: no depth came of %llu poses; check the surface in rig.conf",
			path, (unsigned long long)stats->tracker);
}

int incise_capture_judge(const char *path, const struct incise_capture_options *options,
			 const struct incise_capture_result *result,
			 struct incise_error *err)
{
	const struct incise_recorder_stats *stats = &result->stats;
	int rc;

	judge_wall(path, options, result->wall);
	if (result->early.code)
		return incise_error_set(err, result->early.code, "%s",
					result->early.text);
	rc = judge_streams(path, result, err);
	if (rc)
		return rc;
	if (stats->tracker)
		judge_poses(path, options, stats);
	rc = reject_losses(path, stats, err);
	if (rc || !stats->tracker)
		return rc;
	if (stats->poses.unusable && stats->poses.unusable == stats->poses.poses)
		return incise_error_set(
			err, ENODATA,
			"%s: no depth: the tracker flagged every pose; see Tracker flags "
			"in 'incise help rig.conf'",
			path);
	if (stats->n_streams > 2 && !stats->frames)
		return incise_error_set(
			err, ENODATA,
			"%s: no frames arrived from the camera in %.1f s; check its cable",
			path, result->seconds);
	return 0;
}
