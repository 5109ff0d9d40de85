// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise serve: poses, forces and frames live to other programs, over OpenIGTLink, LSL and
 * ROS 2. A process of its own: no loop waits for it, nor notices its clients.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>
#include "cli/calibration.h"
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "serve/serve.h"
#include "serve/stream.h"

#define NS 1000000000LL
#define TICK_NS 100000000LL
/* At the end clients get what waits for them, for so long. */
#define LINGER_NS NS

enum camera { CAMERA_AUTO, CAMERA_OFF, CAMERA_FRAMES };
static const char *const cameras[] = {"auto", "off", "frames", NULL};

struct serve_job {
	const char *rig, *calibration;
	struct serve_outlets_options lsl, ros2;
	struct serve_igtl_options igtl;
	struct serve_http_options http;
	struct serve_source_options source;
	enum camera camera;
	double duration_s;
	bool json, verbose;
};

static void parse_igtl(void *member, char *text)
{
	struct serve_igtl_options *igtl = member;
	char *slash = strchr(text, '/');

	if (slash) {
		*slash = '\0';
		igtl->version = (int)cli_integer("igtl", slash + 1, 1, 2);
	}
	igtl->address = text;
}

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "serve the devices of this rig: file rig.conf, or sim:KEY=VALUE,… for the "
	 "simulated rig",
	 CLI_INPUT(struct serve_job, rig)},
	CALIBRATION_OPTION(struct serve_job, calibration),
	{0, "igtl", "[ADDR:]PORT[/VERSION]",
	 "serve OpenIGTLink there (default: 127.0.0.1:18944, with --http none); without ADDR to "
	 "this machine only; there is no authentication; headers of version 1 or 2 "
	 "(default: 1 until a client sends 2)",
	 CLI_PARSED(struct serve_job, igtl, parse_igtl)},
	{0, "http", "[ADDR:]PORT",
	 "serve a page for browsers there: live, or of a recording, a session or a .fis the viewer; "
	 "without ADDR to this machine only; its address with a token is printed on the terminal",
	 CLI_TEXT(struct serve_job, http.address)},
	{0, "url", "FILE",
	 "of --http: write the page's address, a secret, into this file; over one that is there, with "
	 "--overwrite, its tokens stay, so that open pages come back",
	 CLI_OUTPUT(struct serve_job, http.url)},
	{0, "control", NULL,
	 "of --http: a second token lets a page start and stop a capture, mark an event and set the "
	 "tool; a page never enables a force",
	 CLI_FLAG(struct serve_job, http.control)},
	{0, "lsl", "PREFIX",
	 "offer streams of the Lab Streaming Layer, too: PREFIX-pose, "
	 "PREFIX-force, PREFIX-events; to the whole network",
	 CLI_TEXT(struct serve_job, lsl.prefix)},
	{0, "ros2", "NAME[,KEY=VALUE…]",
	 "publish topics of ROS 2, too: /NAME/measured_cp, measured_cf (of a loop: setpoint_cf) and events; to "
	 "the whole network; keys domain=N (default: ROS_DOMAIN_ID, or 0), interface=IF (lo: this machine only)",
	 CLI_PARSED(struct serve_job, ros2, serve_ros2_parse)},
	{0, "rate", "HZ",
	 "values per second of each kind at most, forces as means (default: 100)",
	 CLI_NUMBER(struct serve_job, source.rate_hz, 0.1, 20000)},
	{0, "camera", "WHAT", "frames: fail without frames; off; auto (default)",
	 CLI_CHOICE(struct serve_job, camera, cameras)},
	{0, "speed", "FACTOR", "play a recording faster or slower (default: 1)",
	 CLI_NUMBER(struct serve_job, source.speed, 0.01, 100)},
	{0, "endless", NULL, "play a recording again and again",
	 CLI_FLAG(struct serve_job, source.endless)},
	{0, "idle", "TIME", "close a client that stands still for so long (default: 30s)",
	 CLI_DURATION(struct serve_job, igtl.idle_s, 0.2, 86400)},
	{0, "duration", "TIME", "end after this time (default: at Ctrl-C)",
	 CLI_DURATION(struct serve_job, duration_s, 0.01, 1e9)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct serve_job, json)},
	{'v', "verbose", NULL, "print events on stderr",
	 CLI_FLAG(struct serve_job, verbose)},
	{0},
};

static const struct cli_command command = {
	.name = "serve",
	.synopsis = "[NAME|FILE|NAME.rec] [OPTIONS]",
	.summary =
		"Send poses, forces and frames live to other programs, for example 3D "
		"Slicer, or to a page in a browser: of the haptic loop NAME, of a rig with --rig, or of "
		"a recording. The default is the loop that runs.",
	.options = options,
	.examples = "incise serve neck --igtl 18944\n"
		    "incise serve liver.rec --http 8080",
	.success = "ended as requested, or at the end of the recording",
};

struct serve_run {
	struct serve_source *source; /* NULL: a file is shown in the viewer alone */
	struct serve_info info;
	struct serve_stream *stream;
	struct serve_sink *sink[SERVE_SINKS];
	int sinks, epoll, timer;
	double seconds;
};

/* Whether a file is shown in the viewer and nothing is played. */
static bool is_viewed(const struct serve_job *job)
{
	const char *operand = job->source.operand;

	return job->http.address && operand && !job->rig &&
	       file_kind_of(operand) & (FILE_RECORDING | FILE_SESSION | FILE_MODEL) &&
	       !job->igtl.address && !job->lsl.prefix && !job->ros2.prefix;
}

static bool is_recording(const char *operand)
{
	return cli_ends_with(operand, ".rec") || cli_ends_with(operand, ".rec/") ||
	       file_kind_of(operand) == FILE_RECORDING;
}

static void open_source(struct serve_run *run, struct serve_job *job)
{
	struct calibration_used calibration;
	const char *operand = job->source.operand;
	bool recording = !job->rig && operand && is_recording(operand);
	enum file_kind kind = operand ? file_kind_of(operand) : FILE_UNKNOWN;
	bool viewed = is_viewed(job);

	job->source.rig = job->rig;
	job->source.capture = job->http.capture;
	job->http.view = job->http.address && (viewed || recording) ? operand : NULL;
	if (!job->http.address && (job->http.url || job->http.control))
		cli_usage("--%s is of --http: give it, too",
			  job->http.url ? "url" : "control");
	job->source.camera = job->camera != CAMERA_OFF;
	job->source.camera_needed = job->camera == CAMERA_FRAMES;
	if (job->rig && operand)
		cli_usage("--rig: '%s' is a source, too; give one of them", operand);
	/* A loop is named by itself, its scene, or its status file. */
	if (kind != FILE_UNKNOWN && !viewed)
		file_expect(operand, FILE_RECORDING | FILE_STATE | FILE_SCENE);
	if (!job->rig && job->calibration)
		cli_usage(
			"--calibration: only with --rig; loops and recordings are calibrated");
	if (!recording && (job->source.endless || job->source.speed != 1))
		cli_usage("--%s: only for a recording; name one, or leave the option out",
			  job->source.endless ? "endless" : "speed");
	if (job->lsl.prefix && !*job->lsl.prefix)
		cli_usage("--lsl: '' is no PREFIX; give one, for example rig");
	if (job->rig) {
		calibration_use(&calibration, job->calibration, NULL);
		job->source.calibration = calibration.values;
		job->source.calibration_path = calibration.path;
		cli_note("calibration: %s", calibration_text(&calibration));
	}
	run->info.rate_hz = job->source.rate_hz;
	run->info.kinds[SERVE_STATUS] = true;
	if (viewed)
		run->info.name = cli_text("viewer of %s", operand);
	else
		run->source = job->rig	  ? serve_rig_open(&job->source, &run->info)
			      : recording ? serve_recording_open(&job->source, &run->info)
					  : serve_loop_open(&job->source, &run->info);
	/* Faults of the rig are said first. */
	if (job->rig && !calibration.path)
		calibration_use(&calibration, job->calibration, job->rig);
	run->stream = serve_stream_new(run->source, job->source.rate_hz);
}

static void add_sink(struct serve_run *run, struct serve_sink *sink)
{
	struct epoll_event event = {.events = EPOLLIN, .data.ptr = sink};

	run->sink[run->sinks++] = sink;
	serve_stream_add(run->stream, sink);
	if (sink->ops->fd &&
	    epoll_ctl(run->epoll, EPOLL_CTL_ADD, sink->ops->fd(sink), &event))
		cli_fail("epoll: %s", strerror(errno));
}

#ifndef HAVE_WEBSOCKETS
struct serve_sink *serve_http_new(const struct serve_http_options *options,
				  const struct serve_info *info,
				  struct serve_source *source)
{
	(void)options;
	(void)info;
	(void)source;
	cli_fail(
		"--http: this build has no pages (apt-get install libwebsockets-dev, and build "
		"again)");
}
#endif

static void open_sinks(struct serve_run *run, const struct serve_job *job)
{
	struct epoll_event event = {.events = EPOLLIN};

	run->epoll = epoll_create1(EPOLL_CLOEXEC);
	run->timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
	if (run->epoll < 0 || run->timer < 0 ||
	    epoll_ctl(run->epoll, EPOLL_CTL_ADD, run->timer, &event))
		cli_fail("epoll: %s", strerror(errno));
	if (job->igtl.address)
		add_sink(run, serve_igtl_new(&job->igtl, &run->info));
	if (job->http.address)
		add_sink(run, serve_http_new(&job->http, &run->info, run->source));
	if (job->lsl.prefix)
		add_sink(run, serve_outlets_new(&job->lsl, &run->info));
	if (job->ros2.prefix)
		add_sink(run, serve_outlets_new(&job->ros2, &run->info));
}

/* Work of the sinks until a time, or a signal. */
static void wait_until(struct serve_run *run, int64_t t_ns)
{
	const struct itimerspec at = {.it_value = {t_ns / NS, t_ns % NS}};
	struct epoll_event events[SERVE_SINKS + 1];
	uint64_t expired;
	int n;

	for (int i = 0; i < run->sinks; i++)
		if (run->sink[i]->ops->flush)
			run->sink[i]->ops->flush(run->sink[i]);
	timerfd_settime(run->timer, TFD_TIMER_ABSTIME, &at, NULL);
	n = epoll_wait(run->epoll, events, SERVE_SINKS + 1, -1);
	for (int i = 0; i < n; i++) {
		struct serve_sink *sink = events[i].data.ptr;

		if (sink)
			sink->ops->work(sink);
		else if (read(run->timer, &expired, sizeof(expired)) < 0)
			continue;
	}
}

static void show_serve(const struct serve_run *run, double seconds)
{
	char text[400];
	int n = snprintf(text, sizeof(text), "%s, %.0f s", run->info.name, seconds);

	for (int i = 0; i < run->sinks && n < (int)sizeof(text) - 2; i++) {
		n += snprintf(text + n, sizeof(text) - (size_t)n, "; ");
		n += run->sink[i]->ops->summary(run->sink[i], text + n,
						sizeof(text) - (size_t)n);
	}
	cli_progress("%s", text);
}

static void tick_sinks(struct serve_run *run, int64_t now)
{
	for (int i = 0; i < run->sinks; i++)
		if (run->sink[i]->ops->tick)
			run->sink[i]->ops->tick(run->sink[i], now);
}

static void serve(struct serve_run *run, const struct serve_job *job)
{
	int64_t start = cli_now_ns(), now = start, next = start, tick = start;
	int64_t end = job->duration_s > 0 ? start + (int64_t)(job->duration_s * 1e9)
					  : INT64_MAX;
	bool ended = false;

	while (!cli_stop && now < end && !ended) {
		if (run->source && now >= next)
			ended = run->source->ops->read(run->source, run->stream, now,
						       &next);
		if (now >= tick) {
			tick_sinks(run, now);
			show_serve(run, (now - start) / 1e9);
			tick = now + TICK_NS;
		}
		wait_until(run, run->source && next < tick ? next : tick);
		now = cli_now_ns();
	}
	run->seconds = (now - start) / 1e9;
	for (end = now + LINGER_NS; now < end && !cli_stop; now = cli_now_ns()) {
		bool empty = true;

		for (int i = 0; i < run->sinks; i++)
			empty &= !run->sink[i]->ops->is_empty ||
				 run->sink[i]->ops->is_empty(run->sink[i]);
		if (empty)
			break;
		wait_until(run, now + 10000000);
	}
	cli_progress_end();
}

static void report_serve(const struct serve_run *run, const struct serve_job *job)
{
	const struct serve_stream *stream = run->stream;
	json_t *object;

	if (!job->json) {
		printf("%s: %.1f s, %llu poses, %llu forces, %llu frames; the source lost %llu\n",
		       run->info.name, run->seconds,
		       (unsigned long long)serve_stream_sent(stream, SERVE_POSE),
		       (unsigned long long)serve_stream_sent(stream, SERVE_FORCE),
		       (unsigned long long)serve_stream_sent(stream, SERVE_FRAME),
		       (unsigned long long)serve_stream_lost(stream));
		for (int i = 0; i < run->sinks; i++)
			run->sink[i]->ops->print(run->sink[i]);
		return;
	}
	object = json_pack("{so so sI sI sI sI}", "source", json_text(run->info.name),
			   "seconds", json_number(run->seconds), "poses",
			   (json_int_t)serve_stream_sent(stream, SERVE_POSE), "forces",
			   (json_int_t)serve_stream_sent(stream, SERVE_FORCE), "frames",
			   (json_int_t)serve_stream_sent(stream, SERVE_FRAME), "lost",
			   (json_int_t)serve_stream_lost(stream));
	for (int i = 0; i < run->sinks; i++) {
		json_t *more = run->sink[i]->ops->report(run->sink[i]);

		json_object_update(object, more);
		json_decref(more);
	}
	json_print(object);
}

int main(int argc, char **argv)
{
	struct serve_job job = {.igtl.idle_s = 30,
				.ros2.protocol = INCISE_OUTLET_ROS2,
				.source = {.rate_hz = 100, .speed = 1}};
	static struct serve_run run; /* with what lives as long as the program */

	cli_parse(&command, argc, argv, &job);
	if (argc - optind > 1)
		cli_usage("unexpected argument '%s'; give one source", argv[optind + 1]);
	job.source.operand = argv[optind];
	if (!job.http.address && !job.igtl.address)
		job.igtl.address = "127.0.0.1:18944";
	if (job.verbose)
		cli_be_verbose();
	cli_catch_signals();
	open_source(&run, &job);
	open_sinks(&run, &job);
	serve(&run, &job);
	for (int i = 0; i < run.sinks; i++)
		run.sink[i]->ops->close(run.sink[i]);
	report_serve(&run, &job);
	for (int i = 0; i < run.sinks; i++)
		run.sink[i]->ops->free(run.sink[i]);
	serve_stream_free(run.stream);
	if (run.source)
		run.source->ops->free(run.source);
	cli_finish();
	return 0;
}
