// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The Lab Streaming Layer, and ROS 2, as sinks: three streams with times of acquisition. A loop's force
 * is its command.
 *
 *     item      stream of LSL      content   channels                     topic of ROS 2
 *     pose      PREFIX-pose        MoCap     x, y, z in mm; qw … qz       /NAME/measured_cp
 *     force     PREFIX-force       Force     Fx, Fy, Fz in N; sd in N     /NAME/measured_cf or setpoint_cf
 *     status    PREFIX-events      Markers   JSON, when the state         /NAME/events
 *                                            changes
 */
#include <ctype.h>
#include <net/if.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../../lib/base/ros2.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "serve.h"

#define DOMAIN_MAX 232 /* of ROS 2 */

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
	enum serve_kind kind;
	const struct incise_outlet_channel *channels;
	int n;
} outputs[OUTPUTS] = {
	[POSE] = {SERVE_POSE, pose_channels, COUNT(pose_channels)},
	[FORCE] = {SERVE_FORCE, force_channels, COUNT(force_channels)},
	[EVENTS] = {SERVE_STATUS, NULL, 0},
};

static const struct protocol {
	const char *option, *title, *key; /* the key of its report */
	const char *commanded;		  /* name of a loop's force; NULL: as others */
	const char *name[OUTPUTS], *type[OUTPUTS], *frame[OUTPUTS];
} protocols[] = {
	{"--lsl",
	 "LSL",
	 "lsl",
	 NULL,
	 {"-pose", "-force", "-events"},
	 {"MoCap", "Force", "Markers"},
	 {0}},
	{"--ros2",
	 "ROS 2",
	 "ros2",
	 "/setpoint_cf",
	 {"/measured_cp", "/measured_cf", "/events"},
	 {ROS2_POSE, ROS2_WRENCH, ROS2_LOG},
	 {ROS2_FRAME_TRACKER, ROS2_FRAME_SCALPEL}},
};

struct outlets {
	struct serve_sink base;
	const struct serve_outlets_options *options;
	const struct protocol *protocol;
	const struct incise_outlets *functions;
	struct incise_outlet *outlet[OUTPUTS]; /* NULL: not in the source */
	uint64_t sent[OUTPUTS];
};

/* Times of ROS 2 are UTC. */
static int64_t choose_time(const struct outlets *outlets, const struct serve_item *item)
{
	return outlets->options->protocol == INCISE_OUTLET_ROS2 ? item->utc_ns
								: item->here_ns;
}

static void send_event(struct outlets *outlets, const struct serve_item *item)
{
	json_t *event;
	char *line;

	if (!item->status.changed)
		return;
	event = json_pack("{so so sI}", "state", json_text(item->status.name), "text",
			  json_text(item->status.text), "lost", (json_int_t)item->lost);
	line = event ? json_dumps(event, JSON_COMPACT) : NULL;
	if (line) {
		outlets->functions->push_text(outlets->outlet[EVENTS], line,
					      choose_time(outlets, item));
		outlets->sent[EVENTS]++;
	}
	free(line);
	json_decref(event);
}

static void send_values(struct outlets *outlets, enum output output, const double *values,
			const struct serve_item *item)
{
	outlets->functions->push(outlets->outlet[output], values,
				 choose_time(outlets, item));
	outlets->sent[output]++;
}

static void outlets_send(struct serve_sink *sink, const struct serve_item *item)
{
	struct outlets *outlets = (struct outlets *)sink;
	const double *p = item->pose.position_mm, *q = item->pose.quaternion;
	const double *f = item->force.mean_N;

	if (item->kind == SERVE_POSE && outlets->outlet[POSE])
		send_values(outlets, POSE,
			    (double[]){p[0], p[1], p[2], q[0], q[1], q[2], q[3]}, item);
	else if (item->kind == SERVE_FORCE && outlets->outlet[FORCE])
		send_values(outlets, FORCE,
			    (double[]){f[0], f[1], f[2], item->force.sd_N}, item);
	else if (item->kind == SERVE_STATUS)
		send_event(outlets, item);
}

static int outlets_summary(const struct serve_sink *sink, char *text, size_t size)
{
	const struct outlets *outlets = (const struct outlets *)sink;
	int read = 0, offered = 0;

	for (int i = 0; i < OUTPUTS; i++) {
		offered += !!outlets->outlet[i];
		read += outlets->outlet[i] &&
			outlets->functions->has_readers(outlets->outlet[i]);
	}
	return snprintf(text, size, "%s %s: %d of %d streams read",
			outlets->protocol->title, outlets->options->prefix, read,
			offered);
}

static void outlets_close(struct serve_sink *sink)
{
	struct outlets *outlets = (struct outlets *)sink;

	for (int i = 0; i < OUTPUTS; i++)
		outlets->functions->close(outlets->outlet[i]);
	memset(outlets->outlet, 0, sizeof(outlets->outlet));
}

static json_t *outlets_report(const struct serve_sink *sink)
{
	const struct outlets *outlets = (const struct outlets *)sink;

	return json_pack("{s{so sI sI sI}}", outlets->protocol->key, "prefix",
			 json_text(outlets->options->prefix), "poses",
			 (json_int_t)outlets->sent[POSE], "forces",
			 (json_int_t)outlets->sent[FORCE], "events",
			 (json_int_t)outlets->sent[EVENTS]);
}

static void outlets_print(const struct serve_sink *sink)
{
	const struct outlets *outlets = (const struct outlets *)sink;

	printf("%s %s: %llu poses, %llu forces, %llu events\n", outlets->protocol->title,
	       outlets->options->prefix, (unsigned long long)outlets->sent[POSE],
	       (unsigned long long)outlets->sent[FORCE],
	       (unsigned long long)outlets->sent[EVENTS]);
}

static void outlets_free(struct serve_sink *sink)
{
	free(sink);
}

static const struct serve_sink_ops ops = {
	.send = outlets_send,
	.summary = outlets_summary,
	.close = outlets_close,
	.report = outlets_report,
	.print = outlets_print,
	.free = outlets_free,
};

static void offer(struct outlets *outlets, enum output output,
		  const struct serve_info *info)
{
	const struct protocol *protocol = outlets->protocol;
	bool commanded = output == FORCE && info->commanded && protocol->commanded;
	struct incise_error err = {0};
	char host[64] = "";
	char *name = cli_text("%s%s", outlets->options->prefix,
			      commanded ? protocol->commanded : protocol->name[output]),
	     *id;
	struct incise_outlet_setup setup = {
		.name = name,
		.type = protocol->type[output],
		/* A pose comes when the tracker has one; a force is a mean of each period. */
		.rate_hz = output == FORCE ? info->rate_hz : 0,
		.channels = outputs[output].channels,
		.n = outputs[output].n,
		.frame = commanded ? ROS2_FRAME_TRACKER : protocol->frame[output],
		.domain = outlets->options->domain,
		.interface = outlets->options->interface,
	};

	gethostname(host, sizeof(host) - 1);
	id = cli_text("%s@%s", name, host);
	setup.source_id = id;
	outlets->outlet[output] =
		cli_require(outlets->functions->open(&setup, &err), &err);
	free(id);
	free(name);
}

struct serve_sink *serve_outlets_new(const struct serve_outlets_options *options,
				     const struct serve_info *info)
{
	struct outlets *outlets = cli_alloc(1, sizeof(*outlets));
	struct incise_error err = {0};
	sigset_t all, before;

	outlets->base.ops = &ops;
	outlets->options = options;
	outlets->protocol = &protocols[options->protocol];
	cli_check(incise_outlets_open(outlets->protocol->option, options->protocol,
				      &outlets->functions, &err),
		  &err);
	/* Threads of the library are not to take this program's signals. */
	sigfillset(&all);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	for (int i = 0; i < OUTPUTS; i++)
		if (info->kinds[outputs[i].kind])
			offer(outlets, (enum output)i, info);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	return &outlets->base;
}

/* --- the option of ROS 2 --------------------------------------------------------------- */

/* Words with '/' between them. */
static bool is_ros_name(const char *name)
{
	static const char word[] = "abcdefghijklmnopqrstuvwxyz_0123456789"
				   "ABCDEFGHIJKLMNOPQRSTUVWXYZ";
	size_t n = strspn(name, word);

	while (n && !isdigit(*name) && name[n] == '/') {
		name += n + 1;
		n = strspn(name, word);
	}
	return n && !isdigit(*name) && !name[n];
}

/* The variables by which nodes of ROS 2 find their domain. */
static void parse_ros2_environment(struct serve_outlets_options *ros2)
{
	const char *domain = getenv("ROS_DOMAIN_ID"),
		   *only = getenv("ROS_LOCALHOST_ONLY");
	const char *range = getenv("ROS_AUTOMATIC_DISCOVERY_RANGE");

	if (domain && *domain)
		ros2->domain =
			(int)cli_integer("ros2: ROS_DOMAIN_ID", domain, 0, DOMAIN_MAX);
	if ((only && !strcmp(only, "1")) || (range && !strcmp(range, "LOCALHOST")))
		ros2->interface = "lo";
}

/* "neck", "/lab/neck,domain=3,interface=lo" */
void serve_ros2_parse(void *member, char *text)
{
	static const struct cli_option keys[] = {
		{0, "ros2 domain", "N", NULL,
		 CLI_INTEGER(struct serve_outlets_options, domain, 0, DOMAIN_MAX)},
		{0, "ros2 interface", "IF", NULL,
		 CLI_TEXT(struct serve_outlets_options, interface)},
		{0},
	};
	struct serve_outlets_options *ros2 = member;
	char *comma = strchr(text, ',');

	parse_ros2_environment(ros2);
	if (comma) {
		*comma++ = '\0';
		cli_keys(comma, keys, ros2);
	}
	if (ros2->interface && !if_nametoindex(ros2->interface))
		cli_usage(
			"--ros2: there is no network interface '%s'; 'ip link' lists them",
			ros2->interface);
	ros2->prefix = text + (*text == '/');
	if (!is_ros_name(ros2->prefix))
		cli_usage(
			"--ros2: '%s' is no name in ROS 2; give letters, digits, '_' and '/', for "
			"example neck",
			text);
}
