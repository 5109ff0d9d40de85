// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A capture of all streams in real time, and the same with parts left out; what a part takes
 * is the difference. Force and tracker are simulated by the process that is measured, which
 * is no part of a real capture: a run that reads all and keeps nothing tells what it takes.
 *
 *   every 10 ms:  force, tracker ─ recorder ─ folder
 *   by the pump:  JPEG pictures, made before ─ camera.mkv, vision
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/calibration.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include <incise/vision.h>
#include "bench_capture.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/folder.h"
#include "jpeg_camera.h"
#include "../cli/json.h"
#include "machine.h"

#define SECONDS 7
#define QUICK_SECONDS 0.8
#define PARTS 12 /* of a run, for how sure its processor time is */
#define CAMERA_HZ 60
#define POLL_NS 10000000LL /* as incise capture */
#define BATCH 256
#define HELD_UP 0.05 /* of the time: then the figures say more of the machine */

#define RIG "sim:tracker_hz=240"

static const struct part {
	const char *name, *rig;
	bool camera, recorder, vision;
	int base; /* the run that tells what the rig itself takes */
} parts[] = {
	{"full", RIG, true, true, true, 4},
	{"without_vision", RIG, true, true, false, 4},
	{"without_camera", RIG, false, true, false, 4},
	{"force_100_kHz", RIG ",force_hz=100000", true, true, false, 5},
	{"virtual_rig", RIG, true, false, false, 4},
	{"virtual_100_kHz", RIG ",force_hz=100000", true, false, false, 5},
};
#define RUNS (int)(sizeof(parts) / sizeof(*parts))

/* What a run is made of, and what it counts. */
struct run {
	struct incise_rig *rig;
	struct incise_recorder *recorder; /* NULL: what is read is dropped */
	double cpu_percent;
	double part_percent[PARTS];
	int parts;
	double late_ms; /* the latest wake */
	double held_up; /* share of the time that wakes were late, by a period or more */
	double rss_MB[2]; /* memory at a quarter of the time, and at its end */
	bool done;
	uint64_t force, tracker, frames, force_lost, tracker_lost, frames_lost, unlooked;
	struct incise_tracker_info tracker_info;
	struct incise_force_info force_info;
	struct incise_camera_info camera_info;
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

static int take_frame(struct run *run)
{
	struct incise_camera *camera = incise_rig_camera(run->rig);
	struct incise_camera_frame frame;
	int rc = camera && !run->recorder ? incise_camera_read(camera, &frame) : 0;

	if (rc <= 0)
		return rc;
	run->frames++;
	run->frames_lost = incise_camera_lost(camera);
	return 0;
}

/* Memory of this process that is in use, MB. */
static double memory_MB(void)
{
	FILE *file = fopen("/proc/self/statm", "re");
	long pages = 0;

	if (!file)
		return NAN;
	if (fscanf(file, "%*d %ld", &pages) != 1)
		pages = 0;
	fclose(file);
	return (double)pages * (double)sysconf(_SC_PAGESIZE) / 1e6;
}

/* Processor time of each part of the run. */
static void end_part(struct run *run, int64_t now, int64_t *part_begin, double *part_cpu)
{
	double cpu = cpu_ns(CLOCK_PROCESS_CPUTIME_ID);

	if (run->parts < PARTS && now > *part_begin)
		run->part_percent[run->parts++] =
			100 * (cpu - *part_cpu) / (double)(now - *part_begin);
	*part_begin = now;
	*part_cpu = cpu;
}

/* Opening and closing are not measured: they happen once. */
static int capture(struct run *run, double seconds, struct incise_error *err)
{
	struct incise_clock *clock = incise_rig_clock(run->rig);
	int64_t length_ns = (int64_t)(seconds * INCISE_NS_PER_S), start, now, next, part;
	double cpu, part_cpu, held_up_ns = 0;
	int rc = 0;

	start = now = next = part = incise_clock_now(clock);
	cpu = part_cpu = cpu_ns(CLOCK_PROCESS_CPUTIME_ID);
	while (!rc && !cli_stop && now - start < length_ns) {
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
		if (now - part >= length_ns / PARTS)
			end_part(run, now, &part, &part_cpu);
		if (!run->rss_MB[0] && now - start >= length_ns / 4)
			run->rss_MB[0] = memory_MB();
	}
	run->rss_MB[1] = memory_MB();
	run->cpu_percent =
		100 * (cpu_ns(CLOCK_PROCESS_CPUTIME_ID) - cpu) / (double)(now - start);
	run->held_up = held_up_ns / (double)(now - start);
	return rc;
}

/* Make what this run is of. Returns 0 or a negative errno. */
static int open_run(struct run *run, const struct part *part, struct jpeg_camera *camera,
		    const char *folder, struct incise_error *err)
{
	struct incise_calibration calibration;
	struct incise_recorder_setup setup = {.calibration = &calibration};
	struct incise_vision_setup vision;
	char path[PATH_MAX];

	run->rig = incise_rig_open(part->rig,
				   INCISE_RIG_TRACKER | INCISE_RIG_FORCE |
					   (part->camera ? INCISE_RIG_CAMERA : 0),
				   err);
	if (!run->rig)
		return -errno;
	incise_force_info(incise_rig_force(run->rig), &run->force_info);
	incise_tracker_info(incise_rig_tracker(run->rig), &run->tracker_info);
	incise_calibration_nominal(&calibration);
	if (part->vision && !incise_rig_vision(run->rig, &vision))
		setup.vision = &vision;
	if (part->camera) {
		jpeg_camera_take_over(camera, incise_rig_camera(run->rig),
				      incise_rig_clock(run->rig));
		incise_camera_info(incise_rig_camera(run->rig), &run->camera_info);
	}
	if (part->recorder) {
		snprintf(path, sizeof(path), "%s/%s.rec", folder, part->name);
		run->recorder = incise_recorder_new(path, run->rig, &setup, err);
		if (!run->recorder)
			return -errno;
	}
	return 0;
}

static int end_recorder(struct run *run, struct incise_error *err)
{
	struct incise_recorder_stats stats;
	struct incise_error ignored = {0};
	int rc = incise_recorder_end(run->recorder, err), closed;

	incise_recorder_stats(run->recorder, &stats);
	run->force = stats.force;
	run->tracker = stats.tracker;
	run->frames = stats.frames;
	run->force_lost = stats.force_lost;
	run->tracker_lost = stats.tracker_lost;
	run->frames_lost = stats.frames_lost;
	run->unlooked = stats.frames_unlooked;
	closed = incise_recorder_close(run->recorder, rc ? &ignored : err);
	return rc ? rc : closed;
}

static int do_run(struct run *run, const struct part *part, struct jpeg_camera *camera,
		  const char *folder, double seconds, struct incise_error *err)
{
	struct incise_error ignored = {0};
	int rc = open_run(run, part, camera, folder, err), ended;

	if (!rc)
		rc = capture(run, seconds, err);
	if (rc > 0) /* the disk is nearly full */
		rc = -err->code;
	ended = run->recorder ? end_recorder(run, rc ? &ignored : err) : 0;
	incise_rig_close(run->rig);
	return rc ? rc : ended;
}

/* All runs; the recordings go into a folder that is gone afterwards, come what may. */
static void run_all(struct run *runs, struct jpeg_camera *camera, const char *only,
		    double seconds)
{
	struct incise_error err = {0};
	char folder[PATH_MAX - 80];
	int rc = 0;

	folder_make(folder, sizeof(folder), "for the recording");
	for (int i = 0; i < RUNS && !rc && !cli_stop; i++) {
		if (only && strcmp(only, parts[i].name))
			continue;
		cli_progress("%s, %.2g s", parts[i].name, seconds);
		rc = do_run(&runs[i], &parts[i], camera, folder, seconds, &err);
		runs[i].done = true;
	}
	cli_progress_end();
	folder_remove(folder);
	if (cli_stop)
		cli_fail("interrupted");
	if (rc)
		cli_fail_with(&err);
}

/* Of the capture alone: without what the virtual rig takes in the same run's time. */
static double net(const struct run *runs, int i)
{
	const struct run *base = &runs[parts[i].base];

	return base->done ? runs[i].cpu_percent - base->cpu_percent : NAN;
}

static const struct run *first(const struct run *runs)
{
	while (!runs->done)
		runs++;
	return runs;
}

static void print_text(const struct run *runs, const struct machine *machine,
		       double seconds, const struct jpeg_camera *camera)
{
	const struct run *full = first(runs);
	int n;
	size_t bytes = jpeg_camera_bytes(camera, &n);

	printf("%s\nforce %.0f Hz, tracker %.0f Hz, camera %d x %d at %.0f Hz, JPEG of %.0f "
	       "kB; %.2g s each, in real time\n%-15s %6s %6s %9s %5s %8s %5s %7s %5s %8s %7s "
	       "%7s\n",
	       machine->cpu, full->force_info.rate_hz, full->tracker_info.rate_hz,
	       full->camera_info.width, full->camera_info.height,
	       full->camera_info.rate_hz, (double)bytes / n / 1e3, seconds, "run",
	       "CPU %", "net %", "force", "lost", "tracker", "lost", "frames", "lost",
	       "late ms", "MB 1/4", "MB end");
	for (int i = 0; i < RUNS; i++)
		if (runs[i].done)
			printf("%-15s %6.2f %6.2f %9llu %5llu %8llu %5llu %7llu %5llu %8.1f %7.1f "
			       "%7.1f\n",
			       parts[i].name, runs[i].cpu_percent, net(runs, i),
			       (unsigned long long)runs[i].force,
			       (unsigned long long)runs[i].force_lost,
			       (unsigned long long)runs[i].tracker,
			       (unsigned long long)runs[i].tracker_lost,
			       (unsigned long long)runs[i].frames,
			       (unsigned long long)runs[i].frames_lost, runs[i].late_ms,
			       runs[i].rss_MB[0], runs[i].rss_MB[1]);
	printf("net: without what the virtual rig itself takes in the runs virtual_*\n"
	       "pictures that vision had no time for: %llu\n",
	       (unsigned long long)full->unlooked);
}

static json_t *figures_of(const struct run *runs)
{
	json_t *figures = json_array();
	struct harness_spread cpu, memory;

	for (int i = 0; i < RUNS; i++) {
		const double *rss = runs[i].rss_MB;

		if (!runs[i].done)
			continue;
		harness_spread(runs[i].part_percent, runs[i].parts, &cpu);
		metrics_measured(figures, &cpu, "%", "%s processor", parts[i].name);
		memory = (struct harness_spread){.median = rss[1],
						 .low = fmin(rss[0], rss[1]),
						 .high = fmax(rss[0], rss[1])};
		metrics_measured(figures, &memory, "MB", "%s memory", parts[i].name);
	}
	return figures;
}

static void print_json(const struct run *runs, const struct machine *machine,
		       double seconds, bool quick)
{
	const struct run *full = first(runs);
	json_t *list = json_array();

	for (int i = 0; i < RUNS; i++)
		if (runs[i].done)
			json_array_append_new(
				list,
				json_pack("{ss so so sI sI sI sI sI sI so so so sn}",
					  "name", parts[i].name, "cpu_percent",
					  json_number(runs[i].cpu_percent), "net_percent",
					  json_number(net(runs, i)), "force",
					  (json_int_t)runs[i].force, "force_lost",
					  (json_int_t)runs[i].force_lost, "tracker",
					  (json_int_t)runs[i].tracker, "tracker_lost",
					  (json_int_t)runs[i].tracker_lost, "frames",
					  (json_int_t)runs[i].frames, "frames_lost",
					  (json_int_t)runs[i].frames_lost, "late_ms",
					  json_number(runs[i].late_ms), "quarter_MB",
					  json_number(runs[i].rss_MB[0]), "end_MB",
					  json_number(runs[i].rss_MB[1]), "failed"));
	json_print(json_pack(
		"{so sb so so so so si si sI so so}", "machine", machine_json(machine),
		"quick", quick, "seconds", json_number(seconds), "force_hz",
		json_number(full->force_info.rate_hz), "tracker_hz",
		json_number(full->tracker_info.rate_hz), "camera_hz",
		json_number(full->camera_info.rate_hz), "width", full->camera_info.width,
		"height", full->camera_info.height, "unlooked",
		(json_int_t)full->unlooked, "rows", list, "figures", figures_of(runs)));
}

void bench_capture(const char *only, double seconds, bool json, bool quick)
{
	static struct run runs[RUNS]; /* large */
	struct incise_error err = {0};
	struct jpeg_camera *camera;
	struct machine machine;

	for (int i = 0; only && strcmp(only, parts[i].name);)
		if (++i == RUNS)
			cli_usage("'%s' is no run of capture; see incise-bench(1)", only);
	if (!(seconds > 0))
		seconds = quick ? QUICK_SECONDS : SECONDS;
	machine_init(&machine);
	/* Coding pictures takes a second where others are busy. */
	cli_catch_signals();
	camera = jpeg_camera_new(CAMERA_HZ, &err);
	if (!camera)
		cli_fail_with(&err);
	run_all(runs, camera, only, seconds);
	if (json)
		print_json(runs, &machine, seconds, quick);
	else
		print_text(runs, &machine, seconds, camera);
	jpeg_camera_free(camera);
	for (int i = 0; i < RUNS; i++)
		if (runs[i].held_up > HELD_UP)
			cli_warn(
				"%s: the machine held it up for %.0f %% of the time; close other "
				"programs and measure again",
				parts[i].name, 100 * runs[i].held_up);
}
