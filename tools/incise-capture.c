// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise capture: records the streams of a rig in sync: tracker, force, camera.
 */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/calibration.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include "capture_view.h"
#include "cli.h"
#include "json.h"
#include "keyboard.h"
#include "stream_report.h"

#define POLL_NS 10000000LL

enum { OPT_DURATION = CLI_LONG, OPT_CAMERA, OPT_TRIGGER, OPT_CUTS, OPT_FORCE, OPT_JSON };

static const struct cli_option options[] = {
	{'o', "output", "NAME.rec", "folder to record into; it must not exist"},
	{'r', "rig", "RIG",
	 "file rig.conf, or sim:KEY=VALUE,… for the virtual rig\n"
	 "(default: ./rig.conf, else /etc/incise/rig.conf)"},
	{'c', "calibration", "FILE",
	 "calibration.conf (default: the figures of the paper)"},
	{OPT_DURATION, "duration", "TIME",
	 "end after 10s, 500ms, 2min, 1h (default: at Ctrl-C;\n"
	 "on the virtual rig at the end of its cuts)"},
	{OPT_CAMERA, "camera", "WHAT",
	 "off; pictures: record them; depth: and find the scalpel in\n"
	 "them; auto: what rig.conf has (default; a rig of sim:… has\n"
	 "no camera then)"},
	{OPT_TRIGGER, "trigger", "WHAT",
	 "wait for the stylus's button, or for a force such as 0.2N;\n"
	 "the second before is recorded too"},
	{OPT_CUTS, "cuts", NULL,
	 "mark beginning and end of each cut in the table events"},
	{OPT_FORCE, "force", NULL,
	 "replace NAME.rec once the new one is complete; drop what\n"
	 "an interrupted recording left as NAME.rec.part"},
	{OPT_JSON, "json", NULL, "report as one JSON object"},
	{0},
};

static const struct cli_verb verb = {
	.name = "capture",
	.synopsis = "-o NAME.rec [--rig RIG] [OPTIONS]",
	.summary =
		"Record tracker, force channel and camera of a rig in sync. Hold the tool free\n"
		"for the first half second: the zero of the force is measured then. On a\n"
		"terminal the keys m and 1 to 9 set markers, t triggers, q ends.",
	.options = options,
	.notes =
		"Example: incise capture -o liver.rec --rig sim:clock=simulated\n"
		"Exit codes: 0 recorded without loss; 1 failed, samples lost, a device died or\n"
		"the disk was nearly full; 2 bad usage.",
};

/* --- NAME.rec that stands there already -------------------------------------------- */

/* Remove a recording; anything that is not part of one keeps its folder standing. */
static void remove_recording(const char *path)
{
	static const char *const files[] = {"recording.db", "recording.db-wal",
					    "recording.db-shm", "recording.db-journal",
					    "camera.mkv"};
	int folder = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);

	if (folder < 0 && errno == ENOENT)
		return;
	if (folder < 0)
		cli_fail("%s: cannot be replaced: %s", path, strerror(errno));
	if (flock(folder, LOCK_EX | LOCK_NB) && errno == EWOULDBLOCK)
		cli_fail(
			"%s: another incise capture is writing it; end that one, or take "
			"another name",
			path);
	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++)
		if (unlinkat(folder, files[i], 0) && errno != ENOENT)
			cli_fail("%s/%s: cannot be removed: %s", path, files[i],
				 strerror(errno));
	close(folder);
	if (rmdir(path))
		cli_fail("%s: cannot be removed: %s", path, strerror(errno));
}

/* Fail before anything is recorded if that could not be replaced in the end. */
static void check_replaceable(const char *path)
{
	char file[PATH_MAX];
	struct stat st;

	if (lstat(path, &st)) {
		if (errno == ENOENT)
			return;
		cli_fail("%s: %s", path, strerror(errno));
	}
	snprintf(file, sizeof(file), "%s/recording.db", path);
	if (!S_ISDIR(st.st_mode) || (access(file, F_OK) && rmdir(path)))
		cli_fail(
			"%s: is no recording, so --force does not replace it; take another "
			"name",
			path);
}

/* Put the new recording in the place of the old one in one step, then drop that. */
static void replace(const char *new, const char *path)
{
	if (access(path, F_OK)) {
		if (rename(new, path))
			cli_fail("%s: %s; the recording is in %s", path, strerror(errno),
				 new);
		return;
	}
	if (renameat2(AT_FDCWD, new, AT_FDCWD, path, RENAME_EXCHANGE)) {
		if (errno != EINVAL && errno != ENOSYS)
			cli_fail("%s: %s; the recording is in %s", path, strerror(errno),
				 new);
		remove_recording(path); /* a file system without that call */
		if (rename(new, path))
			cli_fail("%s: %s; the recording is in %s", path, strerror(errno),
				 new);
		return;
	}
	remove_recording(new);
}

/* --- recording ---------------------------------------------------------------------- */

enum camera { CAMERA_AUTO, CAMERA_OFF, CAMERA_PICTURES, CAMERA_DEPTH };

/* What is asked for. */
struct wish {
	const char *rig, *calibration;
	char *output;
	enum camera camera;
	double trigger_force_N;
	bool trigger_button;
	double duration_s; /* 0: not given */
	bool cuts, force, json;
};

struct run {
	const struct wish *wish;
	struct incise_rig *rig;
	struct incise_recorder *recorder;
	struct capture_view view;
	int64_t start_ns, end_ns; /* of the recording; end_ns INT64_MAX: not known */
	int64_t held_ns;	  /* recorded before the trigger */
	bool armed;
	int markers;
	double seconds;		   /* recorded */
	struct incise_error early; /* why it ended by itself; code 0: it did not */
};

static enum camera camera_of(const char *text)
{
	static const char *const names[] = {"auto", "off", "pictures", "depth"};

	for (int i = 0; i < 4; i++)
		if (!strcmp(text, names[i]))
			return (enum camera)i;
	cli_usage("--camera: '%s' is none of auto, off, pictures and depth", text);
}

static void take_trigger(struct wish *wish, const char *text)
{
	static const struct cli_unit units[] = {{"N", 1}, {"mN", 1e-3}, {0}};

	wish->trigger_button = !strcmp(text, "button");
	wish->trigger_force_N =
		wish->trigger_button ? 0
				     : cli_quantity("--trigger", text, units, 1e-3, 1e4);
}

/* What was committed stays. */
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

static void take_keys(struct run *run)
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

/* The recording begins, maybe at its trigger; its end is known from then on. */
static void begin(struct run *run, int64_t now_ns)
{
	struct incise_sim *sim = incise_rig_sim(run->rig);
	double duration_s = run->wish->duration_s;

	run->armed = false;
	run->start_ns = now_ns;
	if (duration_s > 0)
		run->end_ns = now_ns + (int64_t)(duration_s * INCISE_NS_PER_S);
	else if (!sim)
		run->end_ns = INT64_MAX;
	else if (!run->end_ns) /* a trigger does not begin the virtual cuts anew */
		run->end_ns = now_ns + incise_sim_duration(sim);
	if (run->end_ns < INT64_MAX)
		run->view.planned_s = (run->end_ns - now_ns) / (double)INCISE_NS_PER_S;
}

/* Record until the end, a signal or a failure. */
static void record(struct run *run)
{
	struct incise_clock *clock = incise_rig_clock(run->rig);
	struct incise_recorder_stats stats;
	struct incise_error err = {0};
	int64_t now = incise_clock_now(clock), next = now, armed_ns = now;
	int rc = 0;

	begin(run, now);
	if (run->wish->trigger_button || run->wish->trigger_force_N > 0) {
		/* A virtual surgeon who has put the scalpel down triggers nothing. */
		run->armed = true;
		run->end_ns =
			incise_rig_sim(run->rig)
				? now + incise_sim_duration(incise_rig_sim(run->rig))
				: INT64_MAX;
		run->view.planned_s = 0;
	}
	while (!cli_stop && now < run->end_ns && !rc) {
		next = now > next + POLL_NS ? now : next + POLL_NS;
		if (next > run->end_ns)
			next = run->end_ns;
		incise_clock_wait_until(clock, next);
		now = incise_clock_now(clock);
		rc = incise_recorder_poll(run->recorder, &err);
		if (rc < 0)
			give_up(run, &err);
		if (run->armed) {
			incise_recorder_stats(run->recorder, &stats);
			if (!stats.armed) {
				begin(run, now);
				run->held_ns = now - armed_ns < INCISE_NS_PER_S
						       ? now - armed_ns
						       : INCISE_NS_PER_S;
			}
		}
		take_keys(run);
		if (keyboard_resumed())
			cli_progress_forget();
		capture_view_show(&run->view, run->recorder,
				  (now - run->start_ns) / (double)INCISE_NS_PER_S);
	}
	if (rc)
		run->early = err;
	if (!run->armed)
		run->seconds =
			(now - run->start_ns + run->held_ns) / (double)INCISE_NS_PER_S;
}

/* --- report ------------------------------------------------------------------------- */

static void report(const struct run *run, const struct incise_recorder_stats *stats,
		   const struct incise_stream *streams, int n)
{
	uint64_t lost = stats->force_lost + stats->tracker_lost + stats->frames_lost;
	const char *path = run->wish->output;

	if (run->wish->json) {
		json_print(json_pack(
			"{so so sI sI sI sI sI sI sI sI sI so so}", "path",
			json_text(path), "seconds", json_number(run->seconds), "force",
			(json_int_t)stats->force, "tracker", (json_int_t)stats->tracker,
			"depth", (json_int_t)stats->depth, "frames",
			(json_int_t)stats->frames, "lost", (json_int_t)lost, "force_lost",
			(json_int_t)stats->force_lost, "tracker_lost",
			(json_int_t)stats->tracker_lost, "frames_lost",
			(json_int_t)stats->frames_lost, "clipped",
			(json_int_t)stats->force_clipped, "zero_mV",
			json_number(stats->zero_mV), "streams", stream_json(streams, n)));
		return;
	}
	printf("%s: %.1f s, %llu force samples (%llu clipped), %llu tracker records, ",
	       path, run->seconds, (unsigned long long)stats->force,
	       (unsigned long long)stats->force_clipped,
	       (unsigned long long)stats->tracker);
	if (n > 2)
		printf("%llu pictures, ", (unsigned long long)stats->frames);
	printf("%llu lost", (unsigned long long)lost);
	/* A short recording gets its zero when it is closed. */
	if (!isnan(stats->zero_mV))
		printf(", zero %.1f mV", stats->zero_mV);
	putchar('\n');
	stream_table(streams, n);
	cli_finish();
}

_Noreturn static void fail_of_losses(const char *path,
				     const struct incise_recorder_stats *stats)
{
	const struct {
		uint64_t n;
		const char *what;
	} lost[] = {
		{stats->force_lost, "force samples"},
		{stats->tracker_lost, "tracker records"},
		{stats->frames_lost, "pictures"},
	};
	char text[200] = "";
	size_t at = 0;

	for (int i = 0; i < 3; i++)
		if (lost[i].n)
			at += (size_t)snprintf(text + at, sizeof(text) - at, "%s%llu %s",
					       at ? ", " : "",
					       (unsigned long long)lost[i].n,
					       lost[i].what);
	cli_fail("%s: %s were lost; the table events says when", path, text);
}

/* Whatever is not as it should be is exit 1, with one line that says what. */
static void judge(const struct run *run, const struct incise_recorder_stats *stats,
		  const struct incise_stream *streams, int n)
{
	const char *path = run->wish->output;

	if (run->early.code)
		cli_fail_with(&run->early);
	for (int i = 0; i < n; i++)
		if (*streams[i].ended)
			cli_fail("%s: the %s ended before the recording did: %s", path,
				 streams[i].name, streams[i].ended);
	if (!stats->force || !stats->tracker)
		cli_fail("%s: the %s gave nothing in %.1f s; check its cable and power",
			 path, stats->force ? "tracker" : "force channel", run->seconds);
	if (stats->force_lost || stats->tracker_lost || stats->frames_lost)
		fail_of_losses(path, stats);
	if (n > 2 && !stats->frames)
		cli_fail("%s: the camera gave nothing in %.1f s; check its cable", path,
			 run->seconds);
}

/*
 * What was never triggered leaves nothing behind; and with --force, what has not a sample does
 * not replace a recording that may have some.
 */
static void keep_old(const struct run *run, const struct incise_recorder_stats *stats,
		     const char *new)
{
	if (stats->force || stats->tracker || stats->frames ||
	    (!stats->armed && !run->wish->force))
		return;
	remove_recording(new);
	if (run->early.code)
		cli_fail_with(&run->early);
	cli_fail("%s: %s; nothing was recorded%s", run->wish->output,
		 stats->armed ? "was never triggered" : "no device gave a sample",
		 run->wish->force ? ", and nothing is replaced" : "");
}

/* --- main --------------------------------------------------------------------------- */

static void take_options(struct wish *wish, int argc, char **argv)
{
	size_t length;
	int id;

	while ((id = cli_next(&verb, argc, argv)) != CLI_END) {
		switch (id) {
		case 'o':
			wish->output = optarg;
			break;
		case 'r':
			wish->rig = optarg;
			break;
		case 'c':
			wish->calibration = optarg;
			break;
		case OPT_DURATION:
			wish->duration_s = cli_duration("duration", optarg, 0.01, 1e6);
			break;
		case OPT_CAMERA:
			wish->camera = camera_of(optarg);
			break;
		case OPT_TRIGGER:
			take_trigger(wish, optarg);
			break;
		case OPT_CUTS:
			wish->cuts = true;
			break;
		case OPT_FORCE:
			wish->force = true;
			break;
		case OPT_JSON:
			wish->json = true;
			break;
		}
	}
	if (optind < argc)
		cli_usage("'%s' is too much: the recording's name goes with -o",
			  argv[optind]);
	if (!wish->output)
		cli_usage("where to? give -o NAME.rec");
	for (length = strlen(wish->output); length > 1 && wish->output[length - 1] == '/';
	     length--)
		wish->output[length - 1] = 0;
	if (length < 5 || strcmp(wish->output + length - 4, ".rec") ||
	    wish->output[length - 5] == '/')
		cli_usage("-o: '%s' is not a name that ends in .rec", wish->output);
	if (length > PATH_MAX - 16)
		cli_usage("-o: the path is too long");
}

static struct incise_rig *open_rig(const struct wish *wish)
{
	static const unsigned int camera[] = {
		[CAMERA_AUTO] = INCISE_RIG_CAMERA | INCISE_RIG_IF_NAMED,
		[CAMERA_PICTURES] = INCISE_RIG_CAMERA,
		[CAMERA_DEPTH] = INCISE_RIG_CAMERA,
	};
	struct incise_error err = {0};
	struct incise_rig *rig = incise_rig_open(
		cli_rig(wish->rig),
		INCISE_RIG_TRACKER | INCISE_RIG_FORCE | camera[wish->camera], &err);

	if (!rig)
		cli_fail_with(&err);
	return rig;
}

/* Whether pictures are looked at. */
static bool take_vision(const struct wish *wish, struct incise_rig *rig,
			struct incise_vision_setup *vision)
{
	bool has = incise_rig_camera(rig) && !incise_rig_vision(rig, vision);

	if (wish->camera == CAMERA_DEPTH && !has)
		cli_fail(
			"%s: --camera depth needs its group `vision`, which says what the "
			"handle looks like; see rig.conf(5)",
			incise_rig_spec(rig));
	return has && wish->camera != CAMERA_PICTURES;
}

/* With --force the new one grows beside the old one. */
static void clear(const struct wish *wish, const char *target)
{
	char part[PATH_MAX + 8];

	check_replaceable(wish->output);
	snprintf(part, sizeof(part), "%s.part", wish->output);
	remove_recording(part);
	snprintf(part, sizeof(part), "%s.part", target);
	remove_recording(part);
	remove_recording(target);
}

static double planned_s(const struct wish *wish, struct incise_rig *rig)
{
	struct incise_sim *sim = incise_rig_sim(rig);

	if (wish->duration_s > 0 || !sim)
		return wish->duration_s;
	return incise_sim_duration(sim) / (double)INCISE_NS_PER_S;
}

int main(int argc, char **argv)
{
	struct incise_stream streams[INCISE_STREAMS_MAX];
	struct incise_calibration calibration;
	struct incise_recorder_setup setup = {.calibration = &calibration};
	struct incise_vision_setup vision;
	struct incise_recorder_stats stats;
	struct incise_force_info force;
	struct incise_error err = {0};
	struct wish wish = {0};
	struct run run = {.wish = &wish};
	char target[PATH_MAX];
	int n;

	take_options(&wish, argc, argv);
	incise_calibration_nominal(&calibration);
	if (wish.calibration &&
	    incise_calibration_load(wish.calibration, &calibration, &err))
		cli_fail_with(&err);
	setup.calibration_path = wish.calibration;
	run.rig = open_rig(&wish);
	setup.planned_s = planned_s(&wish, run.rig);
	setup.vision = take_vision(&wish, run.rig, &vision) ? &vision : NULL;
	setup.cuts = wish.cuts;
	setup.trigger_force_N = wish.trigger_force_N;
	setup.trigger_button = wish.trigger_button;
	setup.armed = wish.trigger_button || wish.trigger_force_N > 0;
	incise_force_info(incise_rig_force(run.rig), &force);
	run.view.full_scale_N = force.full_scale_V * 1e3 / calibration.force_mV_N;
	run.view.depth = setup.vision;

	snprintf(target, sizeof(target), "%s%s", wish.output, wish.force ? ".new" : "");
	if (wish.force)
		clear(&wish, target);
	cli_catch_signals();
	run.recorder = incise_recorder_new(target, run.rig, &setup, &err);
	if (!run.recorder)
		cli_fail_with(&err);
	keyboard_begin();
	capture_view_begin();
	record(&run);
	keyboard_end();
	if (incise_recorder_end(run.recorder, &err))
		give_up(&run, &err);
	incise_recorder_stats(run.recorder, &stats);
	n = incise_recorder_streams(run.recorder, streams);
	if (incise_recorder_close(run.recorder, &err))
		cli_fail_with(&err);
	/* Whole by now, should the terminal be held. */
	capture_view_end();
	incise_rig_close(run.rig);
	keep_old(&run, &stats, target);
	if (wish.force)
		replace(target, wish.output);
	report(&run, &stats, streams, n);
	judge(&run, &stats, streams, n);
	return 0;
}
