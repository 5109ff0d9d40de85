// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The Lab Streaming Layer as a sink: three streams with times of acquisition.
 *
 *     item          stream           content   channels
 *     pose          PREFIX-pose      MoCap     x, y, z in mm; qw, qx, qy, qz
 *     force         PREFIX-force     Force     Fx, Fy, Fz in N; sd in N
 *     status        PREFIX-events    Markers   JSON, when the state changes
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/outlet.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "serve.h"

enum output { POSE, FORCE, EVENTS, OUTPUTS };

static const struct incise_outlet_channel pose_channels[] = {
	{"x", "PositionX", "mm"},
	{"y", "PositionY", "mm"},
	{"z", "PositionZ", "mm"},
	{"qw", "OrientationA", "normalized"},
	{"qx", "OrientationB", "normalized"},
	{"qy", "OrientationC", "normalized"},
	{"qz", "OrientationD", "normalized"},
};
static const struct incise_outlet_channel force_channels[] = {
	{"Fx", "ForceX", "N"},
	{"Fy", "ForceY", "N"},
	{"Fz", "ForceZ", "N"},
	{"sd", "StandardDeviation", "N"},
};

#define COUNT(array) ((int)(sizeof(array) / sizeof(*(array))))

static const struct {
	const char *name, *type;
	const struct incise_outlet_channel *channels;
	int n;
	enum serve_kind kind;
} outputs[OUTPUTS] = {
	[POSE] = {"pose", "MoCap", pose_channels, COUNT(pose_channels), SERVE_POSE},
	[FORCE] = {"force", "Force", force_channels, COUNT(force_channels), SERVE_FORCE},
	[EVENTS] = {"events", "Markers", NULL, 0, SERVE_STATUS},
};

struct lsl {
	struct serve_sink base;
	const char *prefix;
	const struct incise_outlets *outlets;
	struct incise_outlet *outlet[OUTPUTS]; /* NULL: not in the source */
	uint64_t sent[OUTPUTS];
	enum serve_state state;
	char text[200];
	bool has_state;
};

static struct lsl *lsl_of(struct serve_sink *sink)
{
	return (struct lsl *)sink;
}

static const struct lsl *of_const(const struct serve_sink *sink)
{
	return (const struct lsl *)sink;
}

/* A status is sent each second; an event is a status that differs. */
static void send_event(struct lsl *lsl, const struct serve_item *item)
{
	const char *text = item->status.text ? item->status.text : "";
	json_t *event;
	char *line;

	if (lsl->has_state && lsl->state == item->status.state &&
	    !strncmp(lsl->text, text, sizeof(lsl->text) - 1))
		return;
	lsl->has_state = true;
	lsl->state = item->status.state;
	snprintf(lsl->text, sizeof(lsl->text), "%s", text);
	event = json_pack("{so so sI}", "state", json_text(item->status.name), "text",
			  json_text(text), "lost", (json_int_t)item->lost);
	line = event ? json_dumps(event, JSON_COMPACT) : NULL;
	if (line) {
		lsl->outlets->push_text(lsl->outlet[EVENTS], line, item->here_ns);
		lsl->sent[EVENTS]++;
	}
	free(line);
	json_decref(event);
}

static void send_values(struct lsl *lsl, enum output output, const double *values,
			const struct serve_item *item)
{
	lsl->outlets->push(lsl->outlet[output], values, item->here_ns);
	lsl->sent[output]++;
}

static void lsl_send(struct serve_sink *sink, const struct serve_item *item)
{
	struct lsl *lsl = lsl_of(sink);
	const double *p = item->pose.position_mm, *q = item->pose.quaternion;
	const double *f = item->force.mean_N;

	if (item->kind == SERVE_POSE && lsl->outlet[POSE])
		send_values(lsl, POSE,
			    (double[]){p[0], p[1], p[2], q[0], q[1], q[2], q[3]}, item);
	else if (item->kind == SERVE_FORCE && lsl->outlet[FORCE])
		send_values(lsl, FORCE, (double[]){f[0], f[1], f[2], item->force.sd_N},
			    item);
	else if (item->kind == SERVE_STATUS)
		send_event(lsl, item);
}

static int lsl_summary(const struct serve_sink *sink, char *text, size_t size)
{
	const struct lsl *lsl = of_const(sink);
	int read = 0, offered = 0;

	for (int i = 0; i < OUTPUTS; i++) {
		offered += !!lsl->outlet[i];
		read += lsl->outlet[i] && lsl->outlets->has_readers(lsl->outlet[i]);
	}
	return snprintf(text, size, "LSL %s: %d of %d streams read", lsl->prefix, read,
			offered);
}

static void lsl_close(struct serve_sink *sink)
{
	struct lsl *lsl = lsl_of(sink);

	for (int i = 0; i < OUTPUTS; i++)
		lsl->outlets->close(lsl->outlet[i]);
	memset(lsl->outlet, 0, sizeof(lsl->outlet));
}

static json_t *lsl_report(const struct serve_sink *sink)
{
	const struct lsl *lsl = of_const(sink);

	return json_pack("{s{so sI sI sI}}", "lsl", "prefix", json_text(lsl->prefix),
			 "poses", (json_int_t)lsl->sent[POSE], "forces",
			 (json_int_t)lsl->sent[FORCE], "events",
			 (json_int_t)lsl->sent[EVENTS]);
}

static void lsl_print(const struct serve_sink *sink)
{
	const struct lsl *lsl = of_const(sink);

	printf("LSL %s: %llu poses, %llu forces, %llu events\n", lsl->prefix,
	       (unsigned long long)lsl->sent[POSE], (unsigned long long)lsl->sent[FORCE],
	       (unsigned long long)lsl->sent[EVENTS]);
}

static void lsl_free(struct serve_sink *sink)
{
	free(sink);
}

static const struct serve_sink_ops ops = {
	.send = lsl_send,
	.summary = lsl_summary,
	.close = lsl_close,
	.report = lsl_report,
	.print = lsl_print,
	.free = lsl_free,
};

static void offer(struct lsl *lsl, enum output output, const struct serve_info *info)
{
	struct incise_error err = {0};
	char host[64] = "";
	char *name = cli_text("%s-%s", lsl->prefix, outputs[output].name), *id;
	struct incise_outlet_setup setup = {
		.name = name,
		.type = outputs[output].type,
		/* A pose comes when the tracker has one; a force is a mean of each period. */
		.rate_hz = output == FORCE ? info->rate_hz : 0,
		.channels = outputs[output].channels,
		.n = outputs[output].n,
	};

	gethostname(host, sizeof(host) - 1);
	id = cli_text("%s@%s", name, host);
	setup.source_id = id;
	lsl->outlet[output] = lsl->outlets->open(&setup, &err);
	if (!lsl->outlet[output])
		cli_fail_with(&err);
	free(id);
	free(name);
}

struct serve_sink *serve_lsl_new(const char *prefix, const struct serve_info *info)
{
	struct lsl *lsl = cli_alloc(1, sizeof(*lsl));
	struct incise_error err = {0};

	lsl->base.ops = &ops;
	lsl->prefix = prefix;
	if (incise_outlets_open("--lsl", &lsl->outlets, &err))
		cli_fail_with(&err);
	for (int i = 0; i < OUTPUTS; i++)
		if (info->kinds[outputs[i].kind])
			offer(lsl, (enum output)i, info);
	return &lsl->base;
}
