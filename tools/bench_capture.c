// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A capture of all streams of the virtual rig, in real time, and the same with parts left
 * out; what a part takes is the difference. The rig is simulated by the process that is
 * measured, and is no part of a real capture: a run that reads all and keeps nothing tells
 * what it takes.
 *
 *   every 10 ms:  force, tracker ─ recorder ─ folder      camera ─ vision
 */
#include <errno.h>
#include <ftw.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/calibration.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include <incise/vision.h>
#include "bench_capture.h"
#include "cli.h"
#include "json.h"
#include "machine.h"
#include "stopwatch.h"

/* The issue's: 10 kHz, 120 Hz, VGA at 60 fps. The first two are what it is by default. */
#define RIG "sim:camera_hz=60"
#define SECONDS 10
#define QUICK_SECONDS 2
#define POLL_NS 10000000LL /* as incise capture */
#define BATCH 256
#define HELD_UP 0.05	  /* of the time: then the figures say more of the machine */
#define PICTURES_MAX 1200 /* twice as many as there are */

static const struct part {
	const char *name;
	bool camera, recorder, vision;
} parts[] = {
	{"full", true, true, true},
	{"without_vision", true, true, false},
	{"without_camera", false, true, false},
	{"virtual_rig", true, false, false},
};
#define RUNS (int)(sizeof(parts) / sizeof(*parts))

/* What a run is made of, and what it counts. */
struct run {
	struct incise_rig *rig;
	struct incise_recorder *recorder; /* NULL: what is read is dropped */
	struct incise_vision *vision;
	double cpu_percent;
	double late_ms; /* the latest wake */
	double held_up; /* share of the time that wakes were late, by a period or more */
	uint64_t force, tracker, frames, force_lost, tracker_lost, frames_lost;
	uint64_t lost_before; /* pictures, before it began */
	struct incise_tracker_info tracker_info;
	struct incise_force_info force_info;
	struct incise_camera_info camera_info;
	double us[PICTURES_MAX]; /* of vision */
	int pictures, found;
};

/* CPU time, ns: CLOCK_PROCESS_CPUTIME_ID or CLOCK_THREAD_CPUTIME_ID. */
static double cpu_ns(clockid_t clock)
{
	struct timespec t;

	clock_gettime(clock, &t);
	return t.tv_sec * 1e9 + t.tv_nsec;
}

/* Read what there is and keep nothing. */
static int drop_samples(struct run *run)
{
	struct incise_force *force = incise_rig_force(run->rig);
	struct incise_tracker *tracker = incise_rig_tracker(run->rig);
	struct incise_force_sample samples[BATCH];
	struct incise_tracker_sample records[BATCH];
	int n;

	do {
		n = incise_force_read(force, samples, BATCH);
		if (n < 0)
			return n;
		run->force += n;
	} while (n == BATCH);
	do {
		n = incise_tracker_read(tracker, records, BATCH);
		if (n < 0)
			return n;
		run->tracker += n;
	} while (n == BATCH);
	run->force_lost = incise_force_lost(force);
	run->tracker_lost = incise_tracker_lost(tracker);
	return 0;
}

static int look(struct run *run, const struct incise_camera_frame *frame)
{
	struct incise_vision_result result;
	double ns = cpu_ns(CLOCK_THREAD_CPUTIME_ID);
	int rc = incise_vision_measure(run->vision, frame, &result);

	if (run->pictures < PICTURES_MAX)
		run->us[run->pictures++] = (cpu_ns(CLOCK_THREAD_CPUTIME_ID) - ns) * 1e-3;
	run->found += result.found;
	return rc;
}

static int take_frame(struct run *run)
{
	struct incise_camera *camera = incise_rig_camera(run->rig);
	struct incise_camera_frame frame;
	int rc = camera ? incise_camera_read(camera, &frame) : 0;

	if (rc <= 0)
		return rc;
	run->frames++;
	run->frames_lost = incise_camera_lost(camera) - run->lost_before;
	return run->vision ? look(run, &frame) : 0;
}

/* What came while it was opened is nobody's loss. */
static int skip_pictures(struct run *run)
{
	struct incise_camera *camera = incise_rig_camera(run->rig);
	struct incise_camera_frame frame;
	int rc = camera ? incise_camera_read(camera, &frame) : 0;

	run->lost_before = camera ? incise_camera_lost(camera) : 0;
	return rc < 0 ? rc : 0;
}

/* Opening and closing are not measured: they happen once. */
static int capture(struct run *run, int seconds, struct incise_error *err)
{
	struct incise_clock *clock = incise_rig_clock(run->rig);
	double cpu, held_up_ns = 0;
	int64_t start, now, next;
	int rc = skip_pictures(run);

	if (rc)
		incise_error_set(err, -rc, "a picture: %s", strerror(-rc));
	start = now = next = incise_clock_now(clock);
	cpu = cpu_ns(CLOCK_PROCESS_CPUTIME_ID);
	while (!rc && !cli_stop && now - start < seconds * INCISE_NS_PER_S) {
		next = now > next + POLL_NS ? now : next + POLL_NS;
		incise_clock_wait_until(clock, next);
		now = incise_clock_now(clock);
		run->late_ms = fmax(run->late_ms, (now - next) * 1e-6);
		if (now - next >= POLL_NS)
			held_up_ns += now - next;
		if (run->recorder)
			rc = incise_recorder_poll(run->recorder, err);
		else if ((rc = drop_samples(run)))
			incise_error_set(err, -rc, "the virtual rig: %s", strerror(-rc));
		if (!rc && (rc = take_frame(run)))
			incise_error_set(err, -rc, "a picture: %s", strerror(-rc));
	}
	run->cpu_percent =
		100 * (cpu_ns(CLOCK_PROCESS_CPUTIME_ID) - cpu) / (double)(now - start);
	run->held_up = held_up_ns / (double)(now - start);
	return rc;
}

/* Make what this run is of. Returns 0 or a negative errno. */
static int open_run(struct run *run, const struct part *part, const char *folder,
		    struct incise_error *err)
{
	struct incise_calibration calibration;
	struct incise_vision_setup setup;
	char path[PATH_MAX];

	run->rig = incise_rig_open(RIG,
				   INCISE_RIG_TRACKER | INCISE_RIG_FORCE |
					   (part->camera ? INCISE_RIG_CAMERA : 0),
				   err);
	if (!run->rig)
		return -errno;
	incise_force_info(incise_rig_force(run->rig), &run->force_info);
	incise_tracker_info(incise_rig_tracker(run->rig), &run->tracker_info);
	if (part->camera)
		incise_camera_info(incise_rig_camera(run->rig), &run->camera_info);
	if (part->vision) {
		incise_rig_vision(run->rig, &setup);
		run->vision = incise_vision_new(&setup, err);
		if (!run->vision)
			return -errno;
	}
	if (part->recorder) {
		incise_calibration_nominal(&calibration);
		snprintf(path, sizeof(path), "%s/%s.rec", folder, part->name);
		run->recorder = incise_recorder_new(
			path, run->rig,
			&(struct incise_recorder_setup){.calibration = &calibration},
			err);
		if (!run->recorder)
			return -errno;
	}
	return 0;
}

static int do_run(struct run *run, const struct part *part, const char *folder,
		  int seconds, struct incise_error *err)
{
	struct incise_recorder_stats stats;
	struct incise_error ignored = {0};
	int rc = open_run(run, part, folder, err);

	if (!rc)
		rc = capture(run, seconds, err);
	if (run->recorder) {
		int closed;

		incise_recorder_stats(run->recorder, &stats);
		run->force = stats.force;
		run->tracker = stats.tracker;
		run->force_lost = stats.force_lost;
		run->tracker_lost = stats.tracker_lost;
		closed = incise_recorder_close(run->recorder, rc ? &ignored : err);
		rc = rc ? rc : closed;
	}
	incise_vision_free(run->vision);
	incise_rig_close(run->rig);
	stopwatch_sort(run->us, run->pictures);
	return rc;
}

static int remove_one(const char *path, const struct stat *status, int type,
		      struct FTW *place)
{
	(void)status;
	(void)type;
	(void)place;
	return remove(path);
}

/* All runs; the recordings go into a folder that is gone afterwards, come what may. */
static void run_all(struct run *runs, int seconds)
{
	const char *where = getenv("TMPDIR");
	struct incise_error err = {0};
	char folder[PATH_MAX - 80];
	int rc = 0, length;

	length = snprintf(folder, sizeof(folder), "%s/incise-bench-XXXXXX",
			  where && *where ? where : "/tmp");
	if (length >= (int)sizeof(folder))
		cli_fail("TMPDIR: is too long for a name; set another");
	cli_catch_signals();
	if (!mkdtemp(folder))
		cli_fail("%s: no folder for the recording: %s; set TMPDIR", folder,
			 strerror(errno));
	for (int i = 0; i < RUNS && !rc && !cli_stop; i++) {
		cli_progress("%s, %d s", parts[i].name, seconds);
		rc = do_run(&runs[i], &parts[i], folder, seconds, &err);
	}
	cli_progress_end();
	nftw(folder, remove_one, 8, FTW_DEPTH | FTW_PHYS);
	if (cli_stop)
		cli_fail("interrupted");
	if (rc)
		cli_fail_with(&err);
}

/* A quantile of what vision took. */
static double vision_us(const struct run *run, double q)
{
	return run->pictures ? stopwatch_quantile(run->us, run->pictures, q) : NAN;
}

static void print_text(const struct run *runs, const struct machine *machine, int seconds)
{
	const struct run *full = &runs[0];

	printf("%s\nforce %.0f Hz, tracker %.0f Hz, camera %d x %d at %.0f Hz; %d s each, in "
	       "real time\n%-15s %6s %8s %5s %8s %5s %7s %5s %8s\n",
	       machine->cpu, full->force_info.rate_hz, full->tracker_info.rate_hz,
	       full->camera_info.width, full->camera_info.height,
	       full->camera_info.rate_hz, seconds, "run", "CPU %", "force", "lost",
	       "tracker", "lost", "frames", "lost", "late ms");
	for (int i = 0; i < RUNS; i++)
		printf("%-15s %6.2f %8llu %5llu %8llu %5llu %7llu %5llu %8.1f\n",
		       parts[i].name, runs[i].cpu_percent,
		       (unsigned long long)runs[i].force,
		       (unsigned long long)runs[i].force_lost,
		       (unsigned long long)runs[i].tracker,
		       (unsigned long long)runs[i].tracker_lost,
		       (unsigned long long)runs[i].frames,
		       (unsigned long long)runs[i].frames_lost, runs[i].late_ms);
	printf("vision: found %d/%d, us %.0f, p99 %.0f\n"
	       "%.2f %% of a core; of that the virtual rig itself takes %.2f, the capture %.2f\n",
	       full->found, full->pictures, vision_us(full, 0.5), vision_us(full, 0.99),
	       full->cpu_percent, runs[RUNS - 1].cpu_percent,
	       full->cpu_percent - runs[RUNS - 1].cpu_percent);
}

static void print_json(const struct run *runs, const struct machine *machine, int seconds)
{
	const struct run *full = &runs[0];
	json_t *list = json_array();

	for (int i = 0; i < RUNS; i++)
		json_array_append_new(
			list,
			json_pack("{ss so sI sI sI sI sI sI so}", "name", parts[i].name,
				  "cpu_percent", json_number(runs[i].cpu_percent),
				  "force", (json_int_t)runs[i].force, "force_lost",
				  (json_int_t)runs[i].force_lost, "tracker",
				  (json_int_t)runs[i].tracker, "tracker_lost",
				  (json_int_t)runs[i].tracker_lost, "frames",
				  (json_int_t)runs[i].frames, "frames_lost",
				  (json_int_t)runs[i].frames_lost, "late_ms",
				  json_number(runs[i].late_ms)));
	json_print(json_pack("{so si so so so si si so so s{si si so so} so}", "machine",
			     machine_json(machine), "seconds", seconds, "force_hz",
			     json_number(full->force_info.rate_hz), "tracker_hz",
			     json_number(full->tracker_info.rate_hz), "camera_hz",
			     json_number(full->camera_info.rate_hz), "width",
			     full->camera_info.width, "height", full->camera_info.height,
			     "cpu_percent", json_number(full->cpu_percent),
			     "virtual_rig_cpu_percent",
			     json_number(runs[RUNS - 1].cpu_percent), "vision",
			     "pictures", full->pictures, "found", full->found, "us",
			     json_number(vision_us(full, 0.5)), "us_p99",
			     json_number(vision_us(full, 0.99)), "rows", list));
}

void bench_capture(bool json, bool quick)
{
	int seconds = quick ? QUICK_SECONDS : SECONDS;
	static struct run runs[RUNS]; /* large */
	struct machine machine;

	machine_init(&machine);
	run_all(runs, seconds);
	if (json)
		print_json(runs, &machine, seconds);
	else
		print_text(runs, &machine, seconds);
	for (int i = 0; i < RUNS; i++)
		if (runs[i].held_up > HELD_UP)
			cli_warn(
				"%s: the machine held it up for %.0f %% of the time; close other "
				"programs and measure again",
				parts[i].name, 100 * runs[i].held_up);
}
