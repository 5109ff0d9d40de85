// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise capture: records the tracker and the force channel of a rig in sync.
 */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <incise/calibration.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include "cli.h"
#include "json.h"

#define POLL_NS 10000000LL
#define PROGRESS_NS 200000000LL

enum { OPT_DURATION = CLI_LONG, OPT_FORCE, OPT_JSON };

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
		"Record the tracker and the force channel of a rig in sync. Hold the tool\n"
		"free for the first half second: the zero of the force is measured then.",
	.options = options,
	.notes =
		"Example: incise capture -o liver.rec --rig sim:clock=simulated\n"
		"Exit codes: 0 recorded without loss, 1 failed or samples lost, 2 bad usage.",
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

static int64_t now_real(void)
{
	struct timespec ts;

	clock_gettime(CLOCK_MONOTONIC, &ts);
	return ts.tv_sec * INCISE_NS_PER_S + ts.tv_nsec;
}

static void show_progress(const struct incise_recorder *recorder, double seconds)
{
	static int64_t last_ns; /* of the one status line of this program */
	struct incise_recorder_stats stats;
	int64_t now = now_real();

	if (now - last_ns < PROGRESS_NS)
		return;
	last_ns = now;
	incise_recorder_stats(recorder, &stats);
	cli_progress(
		"%.1f s  force %.0f/s  tracker %.0f/s  depth %.1f mm  %s%.3f N  lost %llu",
		seconds, seconds > 0 ? stats.force / seconds : 0,
		seconds > 0 ? stats.tracker / seconds : 0, stats.depth_mm,
		isnan(stats.zero_mV) ? "zeroing, hold free " : "", stats.force_N,
		(unsigned long long)(stats.force_lost + stats.tracker_lost));
}

/* Record until the end, a signal or a failure. Returns the seconds recorded. */
static double record(struct incise_recorder *recorder, struct incise_rig *rig,
		     double duration_s)
{
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_sim *sim = incise_rig_sim(rig);
	int64_t start = incise_clock_now(clock);
	int64_t end = INT64_MAX;
	int64_t next = start;
	int64_t now = start;
	struct incise_error err = {0}, second = {0};

	if (duration_s > 0)
		end = start + (int64_t)(duration_s * INCISE_NS_PER_S);
	else if (sim)
		end = start + incise_sim_duration(sim);
	while (!cli_stop && now < end) {
		next = now > next + POLL_NS ? now : next + POLL_NS;
		if (next > end)
			next = end;
		incise_clock_wait_until(clock, next);
		now = incise_clock_now(clock);
		if (incise_recorder_poll(recorder, &err)) {
			incise_recorder_close(recorder, &second);
			cli_fail_with(&err);
		}
		show_progress(recorder, (now - start) / (double)INCISE_NS_PER_S);
	}
	cli_progress_end();
	return (now - start) / (double)INCISE_NS_PER_S;
}

static void report(const char *path, const struct incise_recorder_stats *stats,
		   double seconds, bool json)
{
	uint64_t lost = stats->force_lost + stats->tracker_lost;

	if (json) {
		json_print(json_pack("{so so sI sI sI sI sI sI sI so}", "path",
				     json_text(path), "seconds", json_number(seconds),
				     "force", (json_int_t)stats->force, "tracker",
				     (json_int_t)stats->tracker, "depth",
				     (json_int_t)stats->depth, "lost", (json_int_t)lost,
				     "force_lost", (json_int_t)stats->force_lost,
				     "tracker_lost", (json_int_t)stats->tracker_lost,
				     "clipped", (json_int_t)stats->force_clipped,
				     "zero_mV", json_number(stats->zero_mV)));
		return;
	}
	printf("%s: %.1f s, %llu force samples (%llu clipped), %llu tracker records, %llu lost",
	       path, seconds, (unsigned long long)stats->force,
	       (unsigned long long)stats->force_clipped,
	       (unsigned long long)stats->tracker, (unsigned long long)lost);
	/* A short recording gets its zero when it is closed. */
	if (!isnan(stats->zero_mV))
		printf(", zero %.1f mV", stats->zero_mV);
	putchar('\n');
	cli_finish();
}

int main(int argc, char **argv)
{
	struct incise_calibration calibration;
	struct incise_recorder_stats stats;
	struct incise_error err = {0};
	struct incise_recorder *recorder;
	struct incise_rig *rig;
	const char *rig_spec = NULL, *calibration_path = NULL;
	char *output = NULL;
	char target[PATH_MAX], part[PATH_MAX + 8];
	double duration_s = 0, seconds;
	bool force = false, json = false;
	size_t length;
	int id;

	while ((id = cli_next(&verb, argc, argv)) != CLI_END) {
		switch (id) {
		case 'o':
			output = optarg;
			break;
		case 'r':
			rig_spec = optarg;
			break;
		case 'c':
			calibration_path = optarg;
			break;
		case OPT_DURATION:
			duration_s = cli_duration("duration", optarg, 0.01, 1e6);
			break;
		case OPT_FORCE:
			force = true;
			break;
		case OPT_JSON:
			json = true;
			break;
		}
	}
	if (optind < argc)
		cli_usage("'%s' is too much: the recording's name goes with -o",
			  argv[optind]);
	if (!output)
		cli_usage("where to? give -o NAME.rec");
	for (length = strlen(output); length > 1 && output[length - 1] == '/'; length--)
		output[length - 1] = 0;
	if (length < 5 || strcmp(output + length - 4, ".rec") ||
	    output[length - 5] == '/')
		cli_usage("-o: '%s' is not a name that ends in .rec", output);
	if (length > PATH_MAX - 16)
		cli_usage("-o: the path is too long");

	incise_calibration_nominal(&calibration);
	if (calibration_path &&
	    incise_calibration_load(calibration_path, &calibration, &err))
		cli_fail_with(&err);
	rig = incise_rig_open(cli_rig(rig_spec), INCISE_RIG_TRACKER | INCISE_RIG_FORCE,
			      &err);
	if (!rig)
		cli_fail_with(&err);

	/* With --force the new one grows beside the old one. */
	snprintf(target, sizeof(target), "%s%s", output, force ? ".new" : "");
	if (force) {
		check_replaceable(output);
		snprintf(part, sizeof(part), "%s.part", output);
		remove_recording(part);
		snprintf(part, sizeof(part), "%s.part", target);
		remove_recording(part);
		remove_recording(target);
	}
	cli_catch_signals();
	recorder = incise_recorder_new(
		target, rig, &(struct incise_recorder_setup){.calibration = &calibration},
		&err);
	if (!recorder)
		cli_fail_with(&err);
	seconds = record(recorder, rig, duration_s);
	incise_recorder_stats(recorder, &stats);
	if (incise_recorder_close(recorder, &err))
		cli_fail_with(&err);
	incise_rig_close(rig);
	if (force)
		replace(target, output);

	report(output, &stats, seconds, json);
	if (!stats.force || !stats.tracker)
		cli_fail("%s: the %s gave nothing in %.1f s; check its cable and power",
			 output, stats.force ? "tracker" : "force channel", seconds);
	if (stats.force_lost || stats.tracker_lost)
		cli_fail(
			"%s: %llu force samples and %llu tracker records were lost; the table "
			"events says when",
			output, (unsigned long long)stats.force_lost,
			(unsigned long long)stats.tracker_lost);
	return 0;
}
