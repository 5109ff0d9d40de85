// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise capture: records the streams of a rig in sync: tracker, force, camera.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/prove.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include "capture/start.h"
#include "capture/terminal.h"
#include "cli/calibration.h"
#include "cli/cli.h"
#include "cli/json.h"
#include "cli/recording.h"
#include "cli/stream_report.h"
#include "cli/wall_report.h"

#define POLL_NS 10000000LL
/* The first point of wall time comes at once, unless its source hangs. */
#define WALL_PATIENCE_NS (3 * INCISE_NS_PER_S)

enum camera { CAMERA_AUTO, CAMERA_OFF, CAMERA_PICTURES, CAMERA_DEPTH };

struct options {
	enum { BOTH, ONLY_FORCE, ONLY_TRACKER } only;
	const char *rig, *calibration, *output;
	enum camera camera;
	double trigger_force_N;
	bool trigger_button;
	const char *trigger_sync; /* device of the module; NULL: none */
	struct start_time start_at;
	double duration_s; /* 0: not given */
	bool cuts, json;
	const char *clock_source;
};

static const char *const cameras[] = {"auto", "off", "frames", "depth", NULL};

static const char *const triggers[] = {"button", "sync", NULL}; /* or a force */
#define SYNC_DEVICE "/dev/incise-stepper0"

static void parse_trigger(void *whole, char *text)
{
	static const struct cli_unit units[] = {{"N", 1}, {"mN", 1e-3}, {0}};
	struct options *options = whole;

	options->trigger_button = !strcmp(text, triggers[0]);
	options->trigger_force_N = 0;
	options->trigger_sync = NULL;
	if (!strcmp(text, triggers[1]))
		options->trigger_sync = SYNC_DEVICE;
	else if (!strncmp(text, "sync:", 5) && text[5])
		options->trigger_sync = text + 5;
	else if (!options->trigger_button)
		options->trigger_force_N =
			cli_quantity("--trigger", text, units, 1e-3, 1e4);
}

static void parse_start_at(void *whole, char *text)
{
	start_time_parse(&((struct options *)whole)->start_at, text);
}

static void parse_clock_source(void *whole, char *text)
{
	struct incise_error err = {0};

	if (incise_recorder_check_clock_source(text, &err))
		cli_usage("%s", err.text);
	((struct options *)whole)->clock_source = text;
}

/* Whether the recorder waits for something before it records. */
static bool waits(const struct options *options)
{
	return options->trigger_button || options->trigger_force_N > 0 ||
	       options->trigger_sync || options->start_at.given;
}

static const char *const onlys[] = {"force,tracker", "force", "tracker", NULL};

static const struct cli_option option_table[] = {
	{'o', "output", "NAME.rec",
	 "folder to record into; --overwrite replaces an existing one once the new "
	 "one is complete, and removes the rest of an interrupted one, "
	 "NAME.rec.part",
	 CLI_OUTPUTS(struct options, output)},
	{CLI_RIG_OPTION(struct options, rig)},
	CALIBRATION_OPTION(struct options, calibration),
	{0, "duration", "TIME",
	 "end after this time, for example 10s, 500ms, 2min or 1h (default: at "
	 "Ctrl-C; on the simulated rig at the end of its cuts)",
	 CLI_DURATION(struct options, duration_s, 0.01, 1e6)},
	{0, "camera", "WHAT",
	 "off; frames: record frames; depth: also find the scalpel in them; auto: "
	 "as rig.conf has it (default; a rig sim:… then has no camera)",
	 CLI_CHOICE(struct options, camera, cameras)},
	{0, "only", "LIST",
	 "force or tracker: record this stream alone (and the camera); "
	 "force,tracker: both (default)",
	 CLI_CHOICE(struct options, only, onlys)},
	{0, "trigger", "WHAT",
	 "wait for the button of the stylus, for a force such as 0.2N, or for "
	 "sync[:DEVICE], a pulse of the SYNC line of the stepper module; the "
	 "second before it is recorded too",
	 CLI_PARSED_BY(parse_trigger), .names = triggers},
	{0, "start-at", "TIME",
	 "wait for a time, for example 2026-11-27T12:00:00Z (UTC), or with TAI in "
	 "place of Z; the second before it is recorded too",
	 CLI_PARSED_BY(parse_start_at)},
	{0, "clock-source", "SOURCE",
	 "where the wall time comes from: auto (default), ptp[:SOCKET[,DOMAIN]], "
	 "chrony[:PORT], kernel or none; of a simulated clock none (default) or "
	 "sim:TAI_S,PPM,BOUND_US",
	 CLI_PARSED_BY(parse_clock_source)},
	{0, "cuts", NULL, "mark the start and the end of each cut in the table events",
	 CLI_FLAG(struct options, cuts)},
	{0, "json", NULL, "report as one JSON object", CLI_FLAG(struct options, json)},
	{0},
};

static const struct cli_command command = {
	.name = "capture",
	.synopsis = "-o NAME.rec [--rig RIG] [OPTIONS]",
	.summary =
		"Record tracker, force channel and camera of a rig in sync. Hold the tool "
		"clear of everything for the first half second: the zero of the force is "
		"measured then. On a terminal the keys m and 1 to 9 set markers, t "
		"triggers, q ends.",
	.options = option_table,
	.examples = "incise capture -o liver.rec --rig sim:clock=simulated",
	.success = "recorded without loss",
	.failure =
		"failure, lost samples, a failed device, a disk that was nearly full, or "
		"no signature by the key of the rig",
};

static void parse(struct options *options, int argc, char **argv)
{
	char *output;
	size_t length;

	cli_parse(&command, argc, argv, options);
	cli_no_operands(argc, argv, "-o");
	if (!options->output)
		cli_usage("missing -o NAME.rec (output recording)");
	if (options->only == ONLY_FORCE && options->trigger_button)
		cli_usage("--trigger button: needs the tracker, which --only force "
			  "leaves out; leave out one of them");
	if (options->only == ONLY_TRACKER && options->trigger_force_N > 0)
		cli_usage("--trigger: a force needs the force channel, which --only "
			  "tracker leaves out; leave out one of them");
	if (options->only == ONLY_FORCE && options->cuts)
		cli_usage("--cuts: needs the tracker, which --only force leaves out; "
			  "leave out one of them");
	if (options->start_at.given && options->clock_source &&
	    !strcmp(options->clock_source, "none"))
		cli_usage("--start-at: needs the wall time, which --clock-source none "
			  "leaves out; leave out one of them");
	output = cli_text("%s", options->output);
	for (length = strlen(output); length > 1 && output[length - 1] == '/'; length--)
		output[length - 1] = 0;
	if (length < 5 || !cli_ends_with(output, ".rec") || output[length - 5] == '/')
		cli_usage("-o: expected a name that ends in .rec, found '%s'", output);
	if (length > PATH_MAX - 16)
		cli_usage("-o: the path is too long; give a shorter one");
	cli_output(output);
	options->output = output;
	if (options->start_at.given &&
	    (options->trigger_button || options->trigger_force_N > 0 ||
	     options->trigger_sync))
		cli_usage("--start-at and --trigger exclude each other; give one of "
			  "them");
}

/* --- recording ----------------------------------------------------------------------- */

struct result {
	double seconds;		   /* recorded */
	int64_t start_ns;	   /* of the first sample, about */
	struct incise_error early; /* why it ended by itself; code 0: it did not */
	struct incise_recorder_stats stats;
};

struct run {
	const struct options *options;
	struct incise_rig *rig;
	struct incise_recorder *recorder;
	struct capture_view view;
	int64_t start_ns, end_ns; /* of the recording; end_ns INT64_MAX: not known */
	int64_t held_ns;	  /* recorded before the trigger */
	bool armed;
	int sync;	 /* events of the stepper module; -1: none */
	int64_t sync_ns; /* of the last pulse that was noted */
	int markers;
	int64_t due_ns;	     /* of --start-at, by the rig's clock; 0: not known */
	bool timed;	     /* the time of --start-at was compared once */
	bool clocked;	     /* the source of the wall time was looked at */
	const char *refused; /* why nothing is to be recorded */
	int64_t judged_ns;   /* when the poses were last looked at */
	bool warned;	     /* of flagged poses */
	struct result result;
};

/* Fail; what was committed stays. */
_Noreturn static void give_up(struct run *run, const struct incise_error *why)
{
	struct incise_error second = {0};

	incise_recorder_close(run->recorder, &second);
	capture_view_end();
	cli_fail_with(why);
}

static void mark(struct run *run, const char *text)
{
	struct incise_error err = {0};

	if (incise_recorder_mark(run->recorder, "marker", text, &err))
		give_up(run, &err);
	snprintf(run->view.last, sizeof(run->view.last), "marked: %s", text);
	run->view.shown_ns = 0;
}

static void handle_keys(struct run *run)
{
	char text[40];
	int key;

	while ((key = keyboard_next())) {
		if (key == 'm' || key == ' ') {
			snprintf(text, sizeof(text), "marker %d", ++run->markers);
			mark(run, text);
		} else if (key >= '1' && key <= '9') {
			snprintf(text, sizeof(text), "%c", key);
			mark(run, text);
		} else if (key == 't' && run->armed) {
			incise_recorder_trigger(run->recorder);
		} else if (key == 'q') {
			cli_stop = SIGINT;
		}
	}
}

#define SYNC_EVERY_NS INCISE_NS_PER_S

/* A pulse of the SYNC line triggers; of the others one a second is an event. */
static void follow_sync(struct run *run)
{
	struct incise_error err = {0};
	struct start_pulse pulse;
	bool lost = false;
	char text[40];

	while (run->sync >= 0 && start_sync_next(run->sync, &pulse, &lost)) {
		if (!run->armed && pulse.t_ns - run->sync_ns < SYNC_EVERY_NS)
			continue;
		snprintf(text, sizeof(text), "pulse %lld", (long long)pulse.number);
		if (incise_recorder_mark_at(run->recorder, pulse.t_ns, "sync", text,
					    &err))
			give_up(run, &err);
		run->sync_ns = pulse.t_ns;
		if (!run->armed)
			continue;
		incise_recorder_trigger(run->recorder);
		break;
	}
	if (lost && run->armed) {
		incise_error_set(&err, ENODEV,
				 "--trigger sync: %s: is gone; reconnect it",
				 run->options->trigger_sync);
		give_up(run, &err);
	}
}

/* The time of --start-at triggers, before the poll that starts to write. */
static void follow_time(struct run *run, int64_t now_ns)
{
	const struct start_time *start_at = &run->options->start_at;
	int64_t left_ns;

	if (!start_at->given || !run->armed)
		return;
	left_ns = start_time_left(start_at, run->recorder, now_ns);
	if (left_ns == INT64_MAX && now_ns - run->start_ns < WALL_PATIENCE_NS)
		return;
	if (left_ns == INT64_MAX)
		run->refused = "--start-at: the clock of this rig has no wall time; see "
			       "--clock-source";
	else if (!run->timed && left_ns < 0)
		run->refused = "--start-at: this time is in the past; give one to come, "
			       "after the devices are open";
	run->timed = true;
	if (run->refused)
		return;
	run->due_ns = now_ns + left_ns;
	if (left_ns <= 0)
		incise_recorder_trigger(run->recorder);
	snprintf(run->view.last, sizeof(run->view.last),
		 left_ns > 0 ? "starts in %.0f s" : "",
		 ceil((double)left_ns / (double)INCISE_NS_PER_S));
}

/* Whether a point is not of the source that was named; "ptp-master" is of ptp. */
static bool is_of_another(const char *named, const struct incise_wall_point *point)
{
	size_t length = named ? strcspn(named, ":") : 0;

	return length && strncmp(named, "auto", length) != 0 &&
	       strncmp(named, "sim", length) != 0 &&
	       (point->held || strncmp(point->source, named, length) != 0);
}

/* Warn at the start of a source that was named and gives no time, as it may come later. */
static void judge_clock(struct run *run)
{
	const char *named = run->options->clock_source;
	struct incise_wall_point point;

	if (run->clocked || incise_recorder_wall(run->recorder, &point))
		return;
	run->clocked = true;
	if (is_of_another(named, &point))
		cli_warn("--clock-source %s: not synchronised: the error of the wall "
			 "time is unknown until it is; see %s",
			 named,
			 !strncmp(named, "chrony", 6) ? "'chronyc tracking'"
			 : !strncmp(named, "ptp", 3)
				 ? "'pmc -u -b 0 \"GET TIME_STATUS_NP\"'"
				 : "'timedatectl timesync-status'");
}

/* The recording starts, maybe at its trigger; this sets its end. */
static void start(struct run *run, int64_t now_ns)
{
	struct incise_sim *sim = incise_rig_sim(run->rig);
	double duration_s = run->options->duration_s;

	run->armed = false;
	run->start_ns = now_ns;
	if (duration_s > 0)
		run->end_ns = now_ns + (int64_t)(duration_s * INCISE_NS_PER_S);
	else if (!sim)
		run->end_ns = INT64_MAX;
	else if (!run->end_ns) /* a trigger does not restart the virtual cuts */
		run->end_ns = now_ns + incise_sim_duration(sim);
	if (run->end_ns < INT64_MAX)
		run->view.planned_s = (run->end_ns - now_ns) / (double)INCISE_NS_PER_S;
}

#define JUDGE_NS INCISE_NS_PER_S
#define POSES_LEAST 100 /* of fewer, one is too many */

/* Whether more than 1 % of the poses are flagged, usable or not. */
static bool poses_are_doubtful(const struct incise_pose_counts *poses)
{
	uint64_t flagged = 0;

	for (int i = 0; i < 128; i++)
		flagged += poses->flagged[i];
	return flagged * 100 > poses->poses;
}

/* Warn once, when it can still be mended. */
static void judge_poses(struct run *run, int64_t now_ns)
{
	struct incise_recorder_stats stats;
	char text[1000];

	if (run->warned || now_ns - run->judged_ns < JUDGE_NS)
		return;
	run->judged_ns = now_ns;
	incise_recorder_stats(run->recorder, &stats);
	if (stats.poses.poses < POSES_LEAST || !poses_are_doubtful(&stats.poses))
		return;
	incise_pose_counts_text(&stats.poses, text, sizeof(text));
	cli_warn("%s", text);
	run->warned = true;
}

/* Record until the end, a signal or a failure. */
static void record(struct run *run)
{
	struct incise_clock *clock = incise_rig_clock(run->rig);
	struct incise_recorder_stats stats;
	struct incise_error err = {0};
	int64_t now = incise_clock_now(clock), next = now, armed_ns = now;
	int rc = 0;

	start(run, now);
	if (waits(run->options)) {
		/* After its cuts the virtual rig triggers nothing. */
		run->armed = true;
		run->end_ns =
			incise_rig_sim(run->rig) && !run->options->start_at.given &&
					!run->options->trigger_sync
				? now + incise_sim_duration(incise_rig_sim(run->rig))
				: INT64_MAX;
		run->view.planned_s = 0;
	}
	while (!cli_stop && now < run->end_ns && !rc && !run->refused) {
		next = now > next + POLL_NS ? now : next + POLL_NS;
		if (next > run->end_ns)
			next = run->end_ns;
		if (run->armed && run->due_ns > now && next > run->due_ns)
			next = run->due_ns;
		incise_clock_wait_until(clock, next);
		now = incise_clock_now(clock);
		follow_time(run, now);
		rc = incise_recorder_poll(run->recorder, &err);
		if (rc < 0)
			give_up(run, &err);
		follow_sync(run);
		if (run->armed) {
			incise_recorder_stats(run->recorder, &stats);
			if (!stats.armed) {
				start(run, now);
				run->held_ns = now - armed_ns < INCISE_NS_PER_S
						       ? now - armed_ns
						       : INCISE_NS_PER_S;
			}
		}
		judge_clock(run);
		judge_poses(run, now);
		handle_keys(run);
		if (keyboard_resumed())
			cli_progress_forget();
		capture_view_show(&run->view, run->recorder,
				  (now - run->start_ns) / (double)INCISE_NS_PER_S);
	}
	if (rc)
		run->result.early = err;
	if (run->armed)
		return;
	run->result.start_ns = run->start_ns - run->held_ns;
	run->result.seconds =
		(double)(now - run->result.start_ns) / (double)INCISE_NS_PER_S;
}

/*
 * Remove a recording that was never triggered; and with --overwrite one without a sample, so that
 * it does not replace a recording with samples.
 */
static void keep_old(const struct run *run, const char *new)
{
	const struct incise_recorder_stats *stats = &run->result.stats;

	if (stats->force || stats->tracker || stats->frames ||
	    (!stats->armed && !cli_overwrite()))
		return;
	recording_remove(new);
	if (run->refused)
		cli_fail("%s; nothing was recorded", run->refused);
	if (run->result.early.code)
		cli_fail_with(&run->result.early);
	cli_fail("%s: %s; nothing was recorded%s", run->options->output,
		 stats->armed ? "it was never triggered"
			      : "no samples arrived; see "
				"incise doctor",
		 cli_overwrite() ? ", and nothing was replaced" : "");
}

static struct incise_rig *open_rig(const struct options *options)
{
	static const unsigned int devices[] = {
		[BOTH] = INCISE_RIG_TRACKER | INCISE_RIG_FORCE,
		[ONLY_FORCE] = INCISE_RIG_FORCE,
		[ONLY_TRACKER] = INCISE_RIG_TRACKER,
	};
	static const unsigned int camera[] = {
		[CAMERA_AUTO] = INCISE_RIG_CAMERA | INCISE_RIG_IF_NAMED,
		[CAMERA_PICTURES] = INCISE_RIG_CAMERA,
		[CAMERA_DEPTH] = INCISE_RIG_CAMERA,
	};

	return cli_open_rig(options->rig,
			    devices[options->only] | camera[options->camera]);
}

/* Whether the depth is measured in pictures. */
static bool use_vision(const struct options *options, struct incise_rig *rig,
		       struct incise_vision_setup *vision)
{
	bool has = incise_rig_camera(rig) && !incise_rig_vision(rig, vision);

	if (options->camera == CAMERA_DEPTH && !has)
		cli_fail("%s: --camera depth needs a group vision, with the colour of "
			 "the handle; see 'incise help rig.conf'",
			 incise_rig_spec(rig));
	return has && options->camera != CAMERA_PICTURES;
}

static double planned_s(const struct options *options, struct incise_rig *rig)
{
	struct incise_sim *sim = incise_rig_sim(rig);

	if (options->duration_s > 0 || !sim)
		return options->duration_s;
	return incise_sim_duration(sim) / (double)INCISE_NS_PER_S;
}

/* --- signature of the rig ---------------------------------------------------------------- */

/* Of a recording that is complete; "" where there is none. */
struct signing {
	char *key;		 /* path in rig.conf; NULL: none */
	char by[160];		 /* kind and fingerprint of the key */
	struct incise_error err; /* why it is not signed */
};

/* The recording stays as it is if it cannot be signed. */
static void sign_recording(const char *path, struct signing *signing)
{
	const struct incise_prove_options options = {.key = signing->key,
						     .recorded = true};
	struct incise_proof proof;

	if (!signing->key)
		return;
	if (!incise_prove(path, &options, &proof, &signing->err))
		strcpy(signing->by, proof.seals->vouchers->key);
	incise_proof_free(&proof);
}

/* --- report ---------------------------------------------------------------------------- */

/* The wall time of a recording that is complete; NULL: none. */
static struct incise_wall *read_wall(const char *path)
{
	struct incise_recording *recording = incise_recording_open(path, NULL);
	struct incise_wall *wall =
		recording ? incise_recording_wall(recording, NULL) : NULL;

	incise_recording_close(recording);
	return wall;
}

static void report(const struct options *options, const struct result *result,
		   const struct calibration_used *calibration,
		   const struct incise_wall *wall, const struct signing *signing)
{
	const struct incise_recorder_stats *stats = &result->stats;
	const struct incise_stream *streams = stats->streams;
	const int n = stats->n_streams;
	uint64_t lost = stats->force_lost + stats->tracker_lost + stats->frames_lost;
	const char *path = options->output;
	const int64_t end_ns =
		result->start_ns + (int64_t)(result->seconds * INCISE_NS_PER_S);
	char text[1000];

	if (options->json) {
		json_print(json_pack(
			"{so so so so sI sI sI sI sI sI sI sI sI so so so so}", "path",
			json_text(path), "calibration", calibration_json(calibration),
			"wall",
			wall ? wall_json(wall, result->start_ns, end_ns) : json_null(),
			"seconds", json_number(result->seconds), "force",
			(json_int_t)stats->force, "tracker", (json_int_t)stats->tracker,
			"depth", (json_int_t)stats->depth, "frames",
			(json_int_t)stats->frames, "lost", (json_int_t)lost, "force_lost",
			(json_int_t)stats->force_lost, "tracker_lost",
			(json_int_t)stats->tracker_lost, "frames_lost",
			(json_int_t)stats->frames_lost, "clipped",
			(json_int_t)stats->force_clipped, "zero_mV",
			json_number(stats->zero_mV), "poses", pose_json(&stats->poses),
			"streams", stream_json(streams, n), "signed_by",
			json_text_or_null(signing->by)));
		return;
	}
	printf("%s: %.1f s, %s (%llu clipped), %s, ", path, result->seconds,
	       cli_count(stats->force, "force sample"),
	       (unsigned long long)stats->force_clipped,
	       cli_count(stats->tracker, "tracker sample"));
	if (n > 2)
		printf("%s, ", cli_count(stats->frames, "frame"));
	printf("%llu lost", (unsigned long long)lost);
	/* A short recording has no zero before it is closed. */
	if (!isnan(stats->zero_mV))
		printf(", zero %.1f mV", stats->zero_mV);
	putchar('\n');
	if (incise_pose_counts_text(&stats->poses, text, sizeof(text)))
		puts(text);
	printf("calibration %s\n", calibration_text(calibration));
	if (wall)
		wall_text(wall, result->start_ns, end_ns);
	stream_table(streams, n);
	if (*signing->by)
		printf("signed by %s\n", signing->by);
	cli_written();
	cli_finish();
}

_Noreturn static void fail_of_losses(const char *path,
				     const struct incise_recorder_stats *stats)
{
	const struct {
		uint64_t n;
		const char *what;
	} lost[] = {
		{stats->force_lost, "force sample"},
		{stats->tracker_lost, "tracker sample"},
		{stats->frames_lost, "frame"},
	};
	uint64_t sum = stats->force_lost + stats->tracker_lost + stats->frames_lost;
	char text[200] = "";
	size_t at = 0;

	for (int i = 0; i < 3; i++)
		if (lost[i].n)
			at += (size_t)snprintf(text + at, sizeof(text) - at, "%s%s",
					       at ? ", " : "",
					       cli_count(lost[i].n, lost[i].what));
	cli_fail("%s: %s %s lost; the table events lists when", path, text,
		 sum == 1 ? "was" : "were");
}

/* Warn of points that are not of the source that was named. */
static void judge_wall(const struct options *options, const struct incise_wall *wall)
{
	const struct incise_wall_point *points;
	size_t n = wall ? incise_wall_points(wall, &points) : 0, others = 0;

	for (size_t i = 0; i < n; i++)
		others += is_of_another(options->clock_source, &points[i]);
	if (others)
		cli_warn("%s: the wall time is not by %s in %zu of %zu points, with an "
			 "unknown or a growing error",
			 options->output, options->clock_source, others, n);
}

/* A recording that is not complete is a failure. */
static void judge(const char *path, const struct result *result)
{
	const struct incise_recorder_stats *stats = &result->stats;
	const struct incise_stream *streams = stats->streams;
	const int n = stats->n_streams;
	char text[1000];

	if (result->early.code)
		cli_fail_with(&result->early);
	for (int i = 0; i < n; i++)
		if (*streams[i].ended)
			cli_fail("%s: the %s failed before the end of the recording: %s",
				 path, streams[i].name, streams[i].ended);
	for (int i = 0; i < n; i++)
		if (!streams[i].rows && strcmp(streams[i].name, "camera"))
			cli_fail("%s: no samples arrived from the %s in %.1f s; check "
				 "its cable and power",
				 path,
				 strcmp(streams[i].name, "force") ? "tracker"
								  : "force channel",
				 result->seconds);
	if (!stats->tracker) {
		if (stats->force_lost || stats->frames_lost)
			fail_of_losses(path, stats);
		return;
	}
	incise_pose_counts_text(&stats->poses, text, sizeof(text));
	if (poses_are_doubtful(&stats->poses))
		cli_warn("%s: %s", path, text);
	else if (!stats->depth)
		cli_warn("%s: no depth came of %llu poses; check the surface in "
			 "rig.conf",
			 path, (unsigned long long)stats->tracker);
	if (stats->force_lost || stats->tracker_lost || stats->frames_lost)
		fail_of_losses(path, stats);
	if (stats->poses.unusable && stats->poses.unusable == stats->poses.poses)
		cli_fail("%s: no depth: the tracker flagged every pose; see Tracker "
			 "flags in 'incise help rig.conf'",
			 path);
	if (n > 2 && !stats->frames)
		cli_fail("%s: no frames arrived from the camera in %.1f s; check its "
			 "cable",
			 path, result->seconds);
}

int main(int argc, char **argv)
{
	struct calibration_used calibration;
	struct incise_recorder_setup setup = {.calibration = &calibration.values};
	struct incise_vision_setup vision;
	struct incise_force_info force = {0};
	struct incise_error err = {0};
	struct options options = {0};
	struct run run = {.options = &options};
	struct signing signing = {0};
	struct incise_wall *wall;
	char *target;

	parse(&options, argc, argv);
	run.rig = open_rig(&options);
	calibration_use(&calibration, options.calibration, cli_rig(options.rig));
	setup.calibration_path = calibration.path;
	if (options.start_at.given && !options.clock_source &&
	    !incise_clock_is_real(incise_rig_clock(run.rig)))
		cli_fail("--start-at: the clock of this rig is simulated and has no wall "
			 "time; give it one by --clock-source sim");
	setup.planned_s = planned_s(&options, run.rig);
	setup.vision = use_vision(&options, run.rig, &vision) ? &vision : NULL;
	setup.cuts = options.cuts;
	setup.trigger_force_N = options.trigger_force_N;
	setup.trigger_button = options.trigger_button;
	setup.clock_source = options.clock_source;
	setup.armed = waits(&options);
	run.sync = options.trigger_sync ? start_sync_open(options.trigger_sync) : -1;
	if (incise_rig_force(run.rig))
		incise_force_info(incise_rig_force(run.rig), &force);
	incise_force_calibration(&force, &calibration.values);
	run.view.full_scale_N = force.full_scale_V * 1e3 / calibration.values.force_mV_N;
	run.view.depth = setup.vision;

	target = recording_target(options.output);
	cli_catch_signals();
	run.recorder =
		cli_require(incise_recorder_new(target, run.rig, &setup, &err), &err);
	keyboard_begin();
	run.view.live = incise_clock_is_real(incise_rig_clock(run.rig));
	capture_view_begin(&run.view);
	record(&run);
	keyboard_end();
	if (incise_recorder_end(run.recorder, &err))
		give_up(&run, &err);
	incise_recorder_stats(run.recorder, &run.result.stats);
	if (incise_recorder_close(run.recorder, &err))
		cli_fail_with(&err);
	/* The recording is closed: now the terminal may block. */
	capture_view_end();
	if (incise_rig_sign_key(run.rig))
		signing.key = cli_text("%s", incise_rig_sign_key(run.rig));
	incise_rig_close(run.rig);
	keep_old(&run, target);
	recording_replace(target, options.output);
	free(target);
	wall = read_wall(options.output);
	sign_recording(options.output, &signing);
	report(&options, &run.result, &calibration, wall, &signing);
	judge_wall(&options, wall);
	incise_wall_free(wall);
	if (signing.err.code)
		cli_error("%s: recorded, but not signed: %s; 'incise sign' signs it",
			  options.output, signing.err.text);
	judge(options.output, &run.result);
	return !!signing.err.code;
}
