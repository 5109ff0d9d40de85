// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * how much of a core a capture of all streams takes in real time, and the
 * same with parts left out; the cost of a part is the difference. Force and tracker are
 * simulated by the process that is measured, which is no part of a real capture: a run that
 * reads all and keeps nothing has that cost alone.
 *
 *   every 10 ms:  force, tracker ─ recorder ─ folder
 *   by the pump:  JPEG frames, coded before ─ camera.mkv, vision
 */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/backend.h>
#include <incise/calibration.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include <incise/verify.h>
#include <incise/vision.h>
#include "program.h"
#include "../../tools/cli/folder.h"
#include "../../tools/cli/stopwatch.h"
#include "../../lib/base/crypto/sha256.h"
#include "../../lib/record/seal_chain.h"
#ifdef HAVE_JPEG
#include <jpeglib.h>
#endif

#define SECONDS 7
#define QUICK_SECONDS 0.8
#define CAMERA_HZ 60
#define POLL_NS 10000000LL /* as incise capture */
#define BATCH 256
#define HELD_UP 0.05 /* of the time: then the figures say more of the machine */

#define RIG "sim:tracker_hz=240"

/* --- a camera that gives JPEG frames, as USB cameras do: those of a virtual camera, coded
 * before and given over and over, so that drawing and coding them is not measured --- */

#define FRAMES 64 /* 1.3 s: in the air and in the tissue */
#define QUALITY 85
#define WAIT_MOST 24	     /* frames, for a reader that is held up */
#define FIRST_NS 800000000LL /* the plunge of the first cut begins at 1 s */

/* The one of this program: ops have no context. */
static struct {
	const struct incise_camera_ops *before;
	struct incise_clock *clock;
	int width, height;
	struct {
		unsigned char *bytes;
		unsigned long size;
	} frame[FRAMES];
	int64_t start_ns;
	uint64_t next, lost;
} camera;

#ifdef HAVE_JPEG
static void code(const struct incise_camera_frame *frame, int k)
{
	struct jpeg_compress_struct jpeg;
	struct jpeg_error_mgr error;

	jpeg.err = jpeg_std_error(&error);
	jpeg_create_compress(&jpeg);
	jpeg_mem_dest(&jpeg, &camera.frame[k].bytes, &camera.frame[k].size);
	jpeg.image_width = (JDIMENSION)frame->width;
	jpeg.image_height = (JDIMENSION)frame->height;
	jpeg.input_components = 3;
	jpeg.in_color_space = JCS_RGB;
	jpeg_set_defaults(&jpeg);
	jpeg_set_quality(&jpeg, QUALITY, TRUE);
	jpeg_start_compress(&jpeg, TRUE);
	while (jpeg.next_scanline < jpeg.image_height) {
		JSAMPROW row = (JSAMPROW)(frame->data +
					  (size_t)jpeg.next_scanline * frame->stride);

		jpeg_write_scanlines(&jpeg, &row, 1);
	}
	jpeg_finish_compress(&jpeg);
	jpeg_destroy_compress(&jpeg);
}
#else
static void code(const struct incise_camera_frame *frame, int k)
{
	(void)frame, (void)k;
	cli_fail("this incise was built without libjpeg, which encodes the frames; "
		 "build it where libjpeg-dev is");
}
#endif

/* Frames of the virtual rig's script. */
static void code_all(void)
{
	struct incise_error err = {0};
	struct incise_rig *rig = cli_require(
		incise_rig_open("sim:clock=simulated", INCISE_RIG_CAMERA, &err), &err);
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_camera_frame frame;

	incise_clock_wait_until(clock, incise_clock_now(clock) + FIRST_NS);
	incise_camera_newest(incise_rig_camera(rig), &frame);
	for (int n = 0; n < FRAMES;) {
		incise_clock_wait_until(clock, incise_clock_now(clock) + 10000000);
		if (incise_camera_read(incise_rig_camera(rig), &frame) != 1)
			continue;
		camera.width = frame.width;
		camera.height = frame.height;
		code(&frame, n++);
	}
	incise_rig_close(rig);
}

static int64_t due_ns(uint64_t n)
{
	return camera.start_ns + (int64_t)((double)n * 1e9 / CAMERA_HZ);
}

static int camera_read(struct incise_camera *of_rig, struct incise_camera_frame *frame)
{
	int64_t now_ns = incise_clock_now(camera.clock);

	(void)of_rig;
	if (now_ns < due_ns(camera.next))
		return 0;
	/* As of a driver with so many buffers: a frame without one is lost. */
	for (; now_ns >= due_ns(camera.next + WAIT_MOST); camera.next++)
		camera.lost++;
	*frame = (struct incise_camera_frame){
		.t_ns = due_ns(camera.next),
		.seq = camera.next,
		.width = camera.width,
		.height = camera.height,
		.pixels = INCISE_PIXELS_MJPEG,
		.data = camera.frame[camera.next % FRAMES].bytes,
		.size = camera.frame[camera.next % FRAMES].size,
	};
	camera.next++;
	return 1;
}

static void camera_info(const struct incise_camera *of_rig,
			struct incise_camera_info *info)
{
	(void)of_rig;
	*info = (struct incise_camera_info){
		.rate_hz = CAMERA_HZ,
		.width = camera.width,
		.height = camera.height,
		.pixels = INCISE_PIXELS_MJPEG,
	};
	snprintf(info->name, sizeof(info->name), "JPEG frames, encoded before");
}

static uint64_t camera_lost(const struct incise_camera *of_rig)
{
	(void)of_rig;
	return camera.lost;
}

static void camera_close(struct incise_camera *of_rig)
{
	of_rig->ops = camera.before;
	of_rig->ops->close(of_rig);
}

static const struct incise_camera_ops camera_ops = {camera_read, camera_info, camera_lost,
						    camera_close};

/* Have a rig's camera give the coded frames from now on, until it is closed. */
static void camera_take_over(struct incise_camera *of_rig, struct incise_clock *clock)
{
	camera.before = of_rig->ops;
	camera.clock = clock;
	camera.start_ns = incise_clock_now(clock);
	camera.next = camera.lost = 0;
	of_rig->ops = &camera_ops;
}

/* --- runs --- */

static const struct part {
	const char *name, *rig;
	bool camera, recorder, vision;
	int base; /* the run with the cost of the rig itself */
} parts[] = {
	{"full", RIG, true, true, true, 4},
	{"without_vision", RIG, true, true, false, 4},
	{"without_camera", RIG, false, true, false, 4},
	{"force_100_kHz", RIG ",force_hz=100000", true, true, false, 5},
	{"virtual_rig", RIG, true, false, false, 4},
	{"virtual_100_kHz", RIG ",force_hz=100000", true, false, false, 5},
};

struct row {
	const char *name, *failed;
	struct incise_rig *rig;
	struct incise_recorder *recorder; /* NULL: samples are read and dropped */
	double cpu_percent, net_percent;
	double late_ms; /* the latest wake */
	double held_up; /* share of the time that wakes were late, by a period or more */
	double rss_MB[2];   /* memory at a quarter of the time, and at its end */
	double verify_MB_s; /* of its recording; NAN: it made none */
	struct incise_recorder_stats stats; /* without a recorder only counts */
	struct incise_tracker_info tracker_info;
	struct incise_force_info force_info;
	struct incise_camera_info camera_info;
};

/* Read all samples and keep none. */
static int drop_samples(struct row *row)
{
	struct incise_force *force = incise_rig_force(row->rig);
	struct incise_tracker *tracker = incise_rig_tracker(row->rig);
	struct incise_force_sample samples[BATCH];
	struct incise_tracker_sample records[BATCH];
	int n;

	do {
		n = incise_force_read(force, samples, BATCH);
		if (n < 0)
			return n;
		row->stats.force += n;
	} while (n == BATCH);
	do {
		n = incise_tracker_read(tracker, records, BATCH);
		if (n < 0)
			return n;
		row->stats.tracker += n;
	} while (n == BATCH);
	row->stats.force_lost = incise_force_lost(force);
	row->stats.tracker_lost = incise_tracker_lost(tracker);
	return 0;
}

static int drop_frame(struct row *row)
{
	struct incise_camera *of_rig = incise_rig_camera(row->rig);
	struct incise_camera_frame frame;
	int rc = of_rig ? incise_camera_read(of_rig, &frame) : 0;

	if (rc <= 0)
		return rc;
	row->stats.frames++;
	row->stats.frames_lost = incise_camera_lost(of_rig);
	return 0;
}

/* Read what there is, by the recorder or in its place. */
static int poll_streams(struct row *row, struct incise_error *err)
{
	int rc;

	if (row->recorder)
		return incise_recorder_poll(row->recorder, err);
	rc = drop_samples(row);
	if (rc)
		return incise_error_set(err, -rc, "simulated rig: %s", strerror(-rc));
	rc = drop_frame(row);
	return rc ? incise_error_set(err, -rc, "frame: %s", strerror(-rc)) : 0;
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

/* Opening and closing are not measured: they happen once. */
static int capture(struct row *row, double seconds, struct incise_error *err)
{
	struct incise_clock *clock = incise_rig_clock(row->rig);
	int64_t length_ns = (int64_t)(seconds * INCISE_NS_PER_S), start, now, next;
	double cpu, held_up_ns = 0;
	int rc = 0;

	start = now = next = incise_clock_now(clock);
	cpu = stopwatch_of(CLOCK_PROCESS_CPUTIME_ID);
	while (!rc && !cli_stop && now - start < length_ns) {
		next = now > next + POLL_NS ? now : next + POLL_NS;
		incise_clock_wait_until(clock, next);
		now = incise_clock_now(clock);
		row->late_ms = fmax(row->late_ms, (now - next) * 1e-6);
		if (now - next >= POLL_NS)
			held_up_ns += now - next;
		rc = poll_streams(row, err);
		if (!row->rss_MB[0] && now - start >= length_ns / 4)
			row->rss_MB[0] = memory_MB();
	}
	row->rss_MB[1] = memory_MB();
	row->cpu_percent = 100 * (stopwatch_of(CLOCK_PROCESS_CPUTIME_ID) - cpu) /
			   (double)(now - start);
	row->held_up = held_up_ns / (double)(now - start);
	return rc;
}

/* Returns 0 or a negative errno. */
static int open_run(struct row *row, const struct part *part, const char *folder,
		    struct incise_error *err)
{
	struct incise_calibration calibration;
	struct incise_recorder_setup setup = {.calibration = &calibration};
	struct incise_vision_setup vision;
	char path[PATH_MAX];

	row->rig = incise_rig_open(part->rig,
				   INCISE_RIG_TRACKER | INCISE_RIG_FORCE |
					   (part->camera ? INCISE_RIG_CAMERA : 0),
				   err);
	if (!row->rig)
		return -errno;
	incise_force_info(incise_rig_force(row->rig), &row->force_info);
	incise_tracker_info(incise_rig_tracker(row->rig), &row->tracker_info);
	incise_calibration_nominal(&calibration);
	if (part->vision && !incise_rig_vision(row->rig, &vision))
		setup.vision = &vision;
	if (part->camera) {
		camera_take_over(incise_rig_camera(row->rig), incise_rig_clock(row->rig));
		incise_camera_info(incise_rig_camera(row->rig), &row->camera_info);
	}
	if (part->recorder) {
		snprintf(path, sizeof(path), "%s/%s.rec", folder, part->name);
		row->recorder = incise_recorder_new(path, row->rig, &setup, err);
		if (!row->recorder)
			return -errno;
	}
	return 0;
}

static double file_MB(const char *folder, const char *name)
{
	char *path = cli_text("%s/%s", folder, name);
	struct stat st;
	double MB = stat(path, &st) ? 0 : (double)st.st_size / 1e6;

	free(path);
	return MB;
}

/* Its files are in the page cache, as they have just been written. */
static int verify(struct row *row, const char *path, struct incise_error *err)
{
	const double MB = file_MB(path, "recording.db") + file_MB(path, "camera.mkv");
	const double start = stopwatch_of(CLOCK_PROCESS_CPUTIME_ID);
	struct incise_verify_report report;
	int rc = incise_verify(path, NULL, &report, err);

	if (!rc && !report.sealed)
		rc = incise_error_set(err, EBADMSG, "%s: not as it was recorded", path);
	row->verify_MB_s = MB / (stopwatch_of(CLOCK_PROCESS_CPUTIME_ID) - start) * 1e9;
	return rc;
}

static int end_recorder(struct row *row, struct incise_error *err)
{
	struct incise_error ignored = {0};
	int rc = incise_recorder_end(row->recorder, err), closed;

	incise_recorder_stats(row->recorder, &row->stats);
	closed = incise_recorder_close(row->recorder, rc ? &ignored : err);
	return rc ? rc : closed;
}

static int run_part(struct row *row, const struct part *part, const char *folder,
		    double seconds, struct incise_error *err)
{
	struct incise_error ignored = {0};
	int rc = open_run(row, part, folder, err), ended;
	char path[PATH_MAX];

	if (!rc)
		rc = capture(row, seconds, err);
	if (rc > 0) /* the disk is nearly full */
		rc = -err->code;
	ended = row->recorder ? end_recorder(row, rc ? &ignored : err) : 0;
	incise_rig_close(row->rig);
	row->verify_MB_s = NAN;
	if (!rc && !ended && part->recorder) {
		snprintf(path, sizeof(path), "%s/%s.rec", folder, part->name);
		rc = verify(row, path, err);
	}
	row->name = part->name;
	return rc ? rc : ended;
}

/* All runs; the recordings go into a folder that is gone afterwards, come what may. */
static void run_all(struct row *rows, double seconds)
{
	struct incise_error err = {0};
	char folder[PATH_MAX - 80];
	int rc = 0;

	folder_make(folder, sizeof(folder), "for the recording");
	for (int i = 0; i < N(parts) && !rc && !cli_stop; i++) {
		cli_progress("%s, %.2g s", parts[i].name, seconds);
		rc = run_part(&rows[i], &parts[i], folder, seconds, &err);
	}
	cli_progress_end();
	folder_remove(folder);
	if (cli_stop)
		cli_fail("interrupted");
	if (rc)
		cli_fail_with(&err);
}

/* --- the seal --- */

#define SEAL_SECONDS 20 /* of a capture; they take a fraction of one */

/*
 * Share of a core that the digests of rows, frames and commits take, which a recording without a
 * seal would not need: the same calls as the recorder's, without the rest of its work.
 */
static double seal_percent(void)
{
	const int rows[] = {1000, 24, CAMERA_HZ / 10, 0}; /* of a commit, each 100 ms */
	const size_t sizes[] = {24, 97, 112, 160};
	const struct incise_ledger_block block = {.count = 1};
	const uint8_t row[20 * 8] = {0};
	uint8_t digest[INCISE_SEAL_BYTES] = {0};
	struct incise_seal seal;
	double start;

	if (incise_seal_init(&seal))
		cli_fail("libcrypto gives no SHA-256");
	incise_seal_resume(&seal, digest);
	start = stopwatch_of(CLOCK_PROCESS_CPUTIME_ID);
	for (int commit = 0; commit < SEAL_SECONDS * 10; commit++) {
		for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
			for (int k = 0;
			     k < rows[i] + (i == INCISE_LEDGER_WALL && commit % 10 == 0);
			     k++)
				incise_seal_row(&seal, i, row, sizes[i]);
			incise_seal_block(&seal, i, &block, digest);
		}
		for (int k = 0; k < rows[INCISE_LEDGER_CAMERA]; k++) {
			const int n = (commit * rows[INCISE_LEDGER_CAMERA] + k) % FRAMES;

			incise_sha256_of(camera.frame[n].bytes, camera.frame[n].size,
					 digest);
		}
		incise_seal_commit(&seal, commit);
	}
	start = stopwatch_of(CLOCK_PROCESS_CPUTIME_ID) - start;
	incise_seal_free(&seal);
	return 100 * start / (SEAL_SECONDS * 1e9);
}

/* --- report --- */

static const struct bench_table rows_table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "name", name), COLUMN(row, "cpu_percent", cpu_percent),
		    COLUMN(row, "net_percent", net_percent),
		    COLUMN(row, "force", stats.force),
		    COLUMN(row, "force_lost", stats.force_lost),
		    COLUMN(row, "tracker", stats.tracker),
		    COLUMN(row, "tracker_lost", stats.tracker_lost),
		    COLUMN(row, "frames", stats.frames),
		    COLUMN(row, "frames_lost", stats.frames_lost),
		    COLUMN(row, "late_ms", late_ms), COLUMN(row, "quarter_MB", rss_MB[0]),
		    COLUMN(row, "end_MB", rss_MB[1]),
		    COLUMN(row, "verify_MB_s", verify_MB_s),
		    COLUMN(row, "failed", failed)},
};

/* Of the capture alone: without the cost of the virtual rig. */
static void set_net(struct row *rows)
{
	for (int i = 0; i < N(parts); i++)
		rows[i].net_percent =
			rows[i].cpu_percent - rows[parts[i].base].cpu_percent;
}

static void report(struct bench_run *run, const struct row *rows, double seconds)
{
	const struct incise_camera_info *info = &rows->camera_info;
	const double percent = seal_percent();

	bench_values(run, "{sf sf sf sf si si sI sf}", "seconds", seconds, "force_hz",
		     rows->force_info.rate_hz, "tracker_hz", rows->tracker_info.rate_hz,
		     "camera_hz", info->rate_hz, "width", info->width, "height",
		     info->height, "unlooked", (json_int_t)rows->stats.frames_unlooked,
		     "seal_percent", percent);
	bench_rows(run, &rows_table, rows, N(parts));
}

static void run(struct bench_run *run)
{
	static struct row rows[N(parts)]; /* large */
	double seconds = run->quick ? QUICK_SECONDS : SECONDS;

	if (run->seconds > 0)
		seconds = run->seconds;
	/* Coding frames takes a second where others are busy. */
	cli_catch_signals();
	code_all();
	run_all(rows, seconds);
	set_net(rows);
	report(run, rows, seconds);
	for (int i = 0; i < FRAMES; i++)
		free(camera.frame[i].bytes);
	for (int i = 0; i < N(parts); i++)
		if (rows[i].held_up > HELD_UP)
			cli_warn("%s: the machine held it up for %.0f %% of the time; "
				 "close other programs and measure again",
				 rows[i].name, 100 * rows[i].held_up);
}

const struct bench bench_program = {
	.name = "capture",
	.summary = "processor load of a capture of all streams",
	.takes_duration = true,
	.run = run,
};
