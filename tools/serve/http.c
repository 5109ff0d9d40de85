// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A page for browsers as a sink: what the stream sends, and orders of a visitor with the second token; see
 * http_server.h.
 *
 *     poses, forces, depths ─▶ rows ─ each 33 ms ─▶ {"live": …}     frames ─▶ pixels
 *     states of a loop ─▶ {"state": …}                 orders ─▶ the source
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>
#include <incise/outfile.h>
#include <incise/version.h>
#include <sys/stat.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/loop_report.h"
#include "http_server.h"
#include "serve.h"

/* Flags of a tick that are no warnings. */
#define EVERYDAY                                                           \
	(INCISE_TICK_CONTACT | INCISE_TICK_IN_CUT | INCISE_TICK_MEMBRANE | \
	 INCISE_TICK_LUMEN)
#define ROWS 1024 /* of a message: more are left out, counted */
#define GATHER_NS 30000000LL
#define STATE_NS 190000000LL
#define OCTAVE 8 /* buckets of a histogram in one of the page */

enum { FORCE, DEPTH, X, Y, Z, TRACKS };

struct http {
	struct serve_sink base;
	const struct serve_info *info;
	const struct serve_http_options *options;
	struct serve_source *source;
	struct http_server *server;
	int wake;
	char *address;
	struct http_counts counts; /* at the end */

	int n;
	double t[ROWS], value[ROWS][TRACKS]; /* NAN: not in this row */
	int64_t left_ns;		     /* when rows left */
	uint64_t left_out, samples_lost;

	struct pixels pixels;
	char state[20], text[300], tool[16];
	double pose[7];
	bool has_pose;
	int64_t told_ns;
};

static void put_http_row(struct http *http, const struct serve_item *item, int track,
			 const double *values, int n)
{
	double *row;

	if (http->n == ROWS) {
		http->left_out++;
		return;
	}
	http->t[http->n] = (double)item->utc_ns * 1e-9;
	row = http->value[http->n++];
	for (int i = 0; i < TRACKS; i++)
		row[i] = i >= track && i < track + n ? values[i - track] : NAN;
}

static void send_state(struct http *http, json_t *more)
{
	json_t *state =
		json_pack("{so so sI so}", "word", json_text(http->state), "text",
			  json_text(http->text), "lost", (json_int_t)http->samples_lost,
			  "capture", json_text_or_null(http->options->capture));
	char *text;

	if (*http->tool)
		json_object_set_new(state, "tool", json_text(http->tool));
	if (http->has_pose)
		json_object_set_new(state, "pose",
				    json_pack("{so so}", "position_mm",
					      json_numbers(http->pose, 3), "quaternion",
					      json_numbers(http->pose + 3, 4)));
	json_object_update(state, more);
	json_decref(more);
	more = json_pack("{so}", "state", state);
	text = json_dumps(more, JSON_COMPACT | JSON_REAL_PRECISION(9));
	if (text)
		http_server_text(http->server, text);
	free(text);
	json_decref(more);
}

/* A quarter of an octave each, from the first with a count to the last. */
static json_t *histogram_of(const struct incise_state_histogram *histogram)
{
	json_t *edges = json_array(), *counts = json_array();
	int last = INCISE_STATE_BUCKETS - 1, first = 0;

	while (last > 0 && !histogram->count[last])
		last--;
	while (first < last && !histogram->count[first])
		first++;
	first -= first % OCTAVE;
	for (int i = first; i <= last; i += OCTAVE) {
		uint64_t n = 0;

		for (int k = i; k < i + OCTAVE && k < INCISE_STATE_BUCKETS; k++)
			n += histogram->count[k];
		json_array_append_new(
			edges,
			json_number(incise_state_edge(
					    fmin(i + OCTAVE, INCISE_STATE_BUCKETS) - 1) *
				    1e-3));
		json_array_append_new(counts, json_integer((json_int_t)n));
	}
	return json_pack("{so so}", "edges_us", edges, "counts", counts);
}

static void send_loop(struct http *http, const struct incise_state_now *now)
{
	json_t *warnings = json_array(), *more;

	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		if ((now->tick.flags & ~EVERYDAY) >> i & 1 && loop_flag_names[i])
			json_array_append_new(warnings, json_text(loop_flag_names[i]));
	if (now->skipped)
		json_array_append_new(
			warnings, json_taken(cli_text("%llu ticks were skipped",
						      (unsigned long long)now->skipped)));
	snprintf(http->tool, sizeof(http->tool), "%s",
		 now->ticks ? loop_tool_names[now->tick.tool] : "");
	more = json_pack("{so so so}", "rate_hz", json_number(now->rate_hz), "late",
			 histogram_of(&now->lateness), "warnings", warnings);
	send_state(http, more);
}

static void keep_status(struct http *http, const struct serve_item *item)
{
	static const bool well[] = {
		[SERVE_RUNS] = true, [SERVE_STARTS] = true, [SERVE_ENDED] = true};

	snprintf(http->state, sizeof(http->state), "%s", item->status.name);
	snprintf(http->text, sizeof(http->text), "%s", item->status.text);
	send_state(http, json_pack("{sb}", "well",
				   item->status.state < (int)sizeof(well) &&
					   well[item->status.state]));
}

static void send_pixels(struct http *http, const struct serve_item *item)
{
	if (pixels_convert(&http->pixels, item->frame))
		return;
	web_reduce(&http->pixels);
	http_server_frame(http->server, (double)item->utc_ns * 1e-9, &http->pixels);
}

static void http_send(struct serve_sink *sink, const struct serve_item *item)
{
	struct http *http = (struct http *)sink;
	const double *f = item->force.mean_N;
	double size_N;

	http->samples_lost = item->lost;
	if (item->kind != SERVE_STATUS && !http_server_has_visitors(http->server))
		return;
	switch (item->kind) {
	case SERVE_POSE:
		put_http_row(http, item, X, item->pose.position_mm, 3);
		memcpy(http->pose, item->pose.position_mm, 3 * sizeof(double));
		memcpy(http->pose + 3, item->pose.quaternion, 4 * sizeof(double));
		http->has_pose = true;
		break;
	case SERVE_FORCE: /* a loop's has a direction, a channel's a sign */
		size_N = http->info->commanded
				 ? sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
				 : f[2];
		put_http_row(http, item, FORCE, &size_N, 1);
		break;
	case SERVE_DEPTH:
		put_http_row(http, item, DEPTH, &item->depth_mm, 1);
		break;
	case SERVE_FRAME:
		send_pixels(http, item);
		break;
	case SERVE_LOOP:
		send_loop(http, item->loop);
		break;
	default:
		keep_status(http, item);
	}
}

/* Rows of one kind leave together: null would be a gap. */
static void send_rows(struct http *http, int track, int n)
{
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);
	bool first = true;

	if (!out)
		return;
	fputs("{\"live\":{\"t\":[", out);
	for (int i = 0; i < http->n; i++)
		if (!isnan(http->value[i][track])) {
			fprintf(out, "%s%.6f", first ? "" : ",", http->t[i]);
			first = false;
		}
	fputs("],\"tracks\":[", out);
	for (int k = 0; k < TRACKS; k++) {
		bool one = true;

		fputs(k ? "," : "", out);
		if (k < track || k >= track + n) {
			fputs("null", out);
			continue;
		}
		fputc('[', out);
		for (int i = 0; i < http->n; i++)
			if (!isnan(http->value[i][track])) {
				fprintf(out, "%s%.6g", one ? "" : ",", http->value[i][k]);
				one = false;
			}
		fputc(']', out);
	}
	fputs("]}}", out);
	if (!fclose(out) && !first)
		http_server_text(http->server, text);
	free(text);
}

static void http_flush(struct serve_sink *sink)
{
	struct http *http = (struct http *)sink;
	int64_t now = cli_now_ns();

	if (!http->n || now - http->left_ns < GATHER_NS)
		return;
	http->left_ns = now;
	send_rows(http, FORCE, 1);
	send_rows(http, DEPTH, 1);
	send_rows(http, X, 3);
	http->n = 0;
}

/* Five times a second: the pose, and a capture, of a rig; a loop's state has its own pace. */
static void http_tick(struct serve_sink *sink, int64_t now_ns)
{
	struct http *http = (struct http *)sink;

	if (http->info->commanded || !http->has_pose ||
	    now_ns - http->told_ns < STATE_NS || !http_server_has_visitors(http->server))
		return;
	http->told_ns = now_ns;
	send_state(http, json_object());
}

/* --- orders ------------------------------------------------------------------------------ */

static int http_fd(const struct serve_sink *sink)
{
	return ((const struct http *)sink)->wake;
}

static void http_work(struct serve_sink *sink)
{
	struct http *http = (struct http *)sink;
	struct http_order order;
	char reply[HTTP_REPLY];
	uint64_t n;

	if (read(http->wake, &n, sizeof(n)) < 0)
		return;
	while (http_server_order(http->server, &order)) {
		bool failed = true;

		snprintf(reply, sizeof(reply), "%s has no such order: %s",
			 http->info->name, order.what);
		if (http->source && http->source->ops->order)
			failed = http->source->ops->order(http->source, order.what,
							  order.text, reply,
							  sizeof(reply));
		http_server_reply(http->server, &order, failed, reply);
	}
}

/* --- report ------------------------------------------------------------------------------ */

static int http_summary(const struct serve_sink *sink, char *text, size_t size)
{
	struct http_counts counts =
		http_server_counts(((const struct http *)sink)->server);

	return snprintf(text, size, "%d pages, %llu messages lost", counts.now,
			(unsigned long long)counts.lost);
}

static void http_close(struct serve_sink *sink)
{
	struct http *http = (struct http *)sink;

	http->counts = http_server_counts(http->server);
	http->address = cli_text("%s", http_server_address(http->server));
	http_server_free(http->server);
	close(http->wake);
}

static json_t *http_report(const struct serve_sink *sink)
{
	const struct http *http = (const struct http *)sink;
	const struct http_counts *counts = &http->counts;

	return json_pack("{s{so sI sI sI sI sI}}", "http", "address",
			 json_text(http->address), "accepted",
			 (json_int_t)counts->visitors, "refused",
			 (json_int_t)counts->refused, "sent", (json_int_t)counts->sent,
			 "lost", (json_int_t)counts->lost, "requests",
			 (json_int_t)counts->requests);
}

static void http_print(const struct serve_sink *sink)
{
	const struct http *http = (const struct http *)sink;

	printf("http://%s: %llu pages, %llu refused; %llu messages sent, %llu lost\n",
	       http->address, (unsigned long long)http->counts.visitors,
	       (unsigned long long)http->counts.refused,
	       (unsigned long long)http->counts.sent,
	       (unsigned long long)http->counts.lost);
}

static void http_free(struct serve_sink *sink)
{
	struct http *http = (struct http *)sink;

	free(http->pixels.bytes);
	free(http->address);
	free(http);
}

static const struct serve_sink_ops http_ops = {
	.send = http_send,
	.flush = http_flush,
	.tick = http_tick,
	.fd = http_fd,
	.work = http_work,
	.summary = http_summary,
	.close = http_close,
	.report = http_report,
	.print = http_print,
	.free = http_free,
};

/* --- opening ----------------------------------------------------------------------------- */

static char *live_head(const struct http *http)
{
	const struct serve_info *info = http->info;
	json_t *head = web_head_new("live", info->name, "time", "s", 0, 0);
	char *text;

	web_head_panel(head, info->kinds[SERVE_FORCE] ? "force" : NULL, "N", "force");
	web_head_panel(head, info->kinds[SERVE_DEPTH] ? "depth" : NULL, "mm", "depth");
	web_head_panel(head, info->kinds[SERVE_POSE] ? "position" : NULL, "mm", "x|y|z");
	if (info->kinds[SERVE_FRAME])
		json_object_set_new(head, "frames", json_pack("{sb}", "shown", 1));
	if (info->tools)
		json_object_set_new(head, "tools",
				    json_pack("[ssss]", loop_tool_names[0],
					      loop_tool_names[1], loop_tool_names[2],
					      loop_tool_names[3]));
	text = json_dumps(head, JSON_COMPACT);
	json_decref(head);
	return text;
}

/*
 * The address in the file of a server before, so that its pages come back to this one: of a file that nobody else
 * could read. NULL: none.
 */
static char *address_before(const char *path)
{
	struct stat st;
	FILE *file = path ? fopen(path, "re") : NULL;
	char line[300];
	bool ours = file && !fstat(fileno(file), &st) && S_ISREG(st.st_mode) &&
		    st.st_uid == geteuid() && !(st.st_mode & 077) &&
		    fgets(line, sizeof(line), file);

	if (file)
		fclose(file);
	return ours ? cli_text("%s", line) : NULL;
}

/* The secret address: to a person at a terminal, or into a file for this user alone; never to a log. */
static void tell_url(const struct http *http)
{
	const char *path = http->options->url;
	char *url = http_server_url(http->server);
	struct incise_error err = {0};
	struct incise_outfile *file;
	mode_t mask = umask(077);

	if (path) {
		file = cli_require(incise_outfile_open(path, &err), &err);
		fprintf(incise_outfile_stream(file), "%s\n", url);
		cli_check(incise_outfile_commit(file, &err), &err);
	} else {
		fprintf(stderr, "open %s\n", url);
	}
	umask(mask);
	free(url);
}

struct serve_sink *serve_http_new(const struct serve_http_options *options,
				  const struct serve_info *info,
				  struct serve_source *source)
{
	struct http *http = cli_alloc(1, sizeof(*http));
	struct http_server_setup setup = {.address = options->address,
					  .control = options->control,
					  .file = options->view ? web_open(options->view)
								: NULL};
	char *before;

	http->base.ops = &http_ops;
	http->info = info;
	http->options = options;
	http->source = source;
	http->wake = setup.wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	if (http->wake < 0)
		cli_fail("--http: %s", strerror(errno));
	setup.head = live_head(http);
	setup.before = before = address_before(options->url);
	http->server = http_server_new(&setup);
	free(before);
	if (!options->url && !isatty(STDERR_FILENO))
		cli_fail(
			"the address of the page holds a secret, and standard error is no "
			"terminal; give --url FILE");
	tell_url(http);
	return &http->base;
}
