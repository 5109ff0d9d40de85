// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * OpenIGTLink as a sink: items become messages, for clients of both header versions.
 *
 *     item          message                         name
 *     pose          TRANSFORM, mm                   TipToTracker
 *     force         TRANSFORM, translation in N     Force
 *                   STRING, JSON                    ForceData
 *     frame         IMAGE, luminance or RGB         Camera
 *     status        STATUS                          Status
 *
 * The names differ, since pyigtl keeps one message for each name.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/igtl.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "clients.h"
#include "pixels.h"
#include "serve.h"

enum output { POSE, FORCE, DATA, FRAME, STATUS, REPLY, OUTPUTS };

static const struct {
	const char *type, *name;
} outputs[OUTPUTS] = {
	[POSE] = {"TRANSFORM", "TipToTracker"}, [FORCE] = {"TRANSFORM", "Force"},
	[DATA] = {"STRING", "ForceData"},	[FRAME] = {"IMAGE", "Camera"},
	[STATUS] = {"STATUS", "Status"},	[REPLY] = {"CAPABILITY", "incise"},
};

#define SMALL 1024    /* capacity of all but frames */
#define BODY_MAX 4096 /* of clients' messages */
#define FRAME_HEAD 512

struct igtl {
	struct serve_sink base;
	struct clients *clients;
	const struct serve_info *info;
	int version;			    /* 0: as the client */
	struct message *newest[OUTPUTS][2]; /* for GET_, by version */
	struct pixels pixels;
	uint32_t id;
	uint64_t requests, ignored; /* requests of clients */
	bool warned;
};

/* A client, and its choices. */
struct peer {
	struct incise_igtl_stream *stream;
	int version;
	unsigned int stopped; /* outputs, as bits */
};

/* --- sending ------------------------------------------------------------------------- */

struct sending {
	struct igtl *igtl;
	enum output output;
	const struct serve_item *item;
	ssize_t (*pack)(struct sending *sending, struct message *message,
			const struct incise_igtl_label *label);
	size_t capacity;
	struct message
		*message[2]; /* by version; packed when the first client needs it */
	bool failed;
	char text[SMALL]; /* of a STRING */
	size_t n;
};

static struct message *packed(struct sending *sending, int version)
{
	const struct serve_item *item = sending->item;
	struct message **message = &sending->message[version - 1];
	char t_ns[24], lost[24];
	const struct incise_igtl_pair pairs[] = {
		{.key = "t_ns",
		 .key_n = 4,
		 .value = t_ns,
		 .value_n = (uint32_t)snprintf(t_ns, sizeof(t_ns), "%lld",
					       (long long)item->t_ns)},
		{.key = "lost",
		 .key_n = 4,
		 .value = lost,
		 .value_n = (uint32_t)snprintf(lost, sizeof(lost), "%llu",
					       (unsigned long long)item->lost)},
	};
	const struct incise_igtl_label label = {
		.version = version,
		.name = outputs[sending->output].name,
		.utc_ns = item->utc_ns,
		.id = sending->igtl->id,
		.metadata = pairs,
		.n_metadata = 2,
	};
	ssize_t n;

	if (*message || sending->failed)
		return *message;
	*message =
		message_new(sending->output, sending->output == FRAME, sending->capacity);
	n = sending->pack(sending, *message, &label);
	if (n < 0) {
		message_drop(*message);
		*message = NULL;
		sending->failed = true;
		return NULL;
	}
	message_set_size(*message, (size_t)n);
	return *message;
}

static void send_one(void *context, struct client *client, void *user)
{
	struct sending *sending = context;
	const struct peer *peer = user;
	struct message *message;

	if (peer->stopped & 1u << sending->output)
		return;
	message = packed(sending, peer->version);
	if (message)
		clients_send(client, message);
}

/*
 * Send to all, and keep it for clients that ask. Nothing older is kept: a client that comes
 * later gets a value that is true, or waits for the next one.
 */
static void send_all(struct sending *sending)
{
	struct igtl *igtl = sending->igtl;

	igtl->id++;
	clients_each(igtl->clients, send_one, sending);
	for (int i = 0; i < 2; i++) {
		struct message **newest = &igtl->newest[sending->output][i];

		if (*newest)
			message_drop(*newest);
		*newest = sending->output == STATUS ? packed(sending, i + 1)
						    : sending->message[i];
	}
}

static ssize_t pack_pose(struct sending *sending, struct message *message,
			 const struct incise_igtl_label *label)
{
	const double *q = sending->item->pose.quaternion;
	double matrix[3][4];

	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		matrix[i][i] = 1 - 2 * (q[1 + j] * q[1 + j] + q[1 + k] * q[1 + k]);
		matrix[i][j] = 2 * (q[1 + i] * q[1 + j] - q[0] * q[1 + k]);
		matrix[i][k] = 2 * (q[1 + i] * q[1 + k] + q[0] * q[1 + j]);
		matrix[i][3] = sending->item->pose.position_mm[i];
	}
	return incise_igtl_pack_transform(message_bytes(message), sending->capacity,
					  label, matrix);
}

static ssize_t pack_force(struct sending *sending, struct message *message,
			  const struct incise_igtl_label *label)
{
	const double *force_N = sending->item->force.mean_N;
	const double matrix[3][4] = {
		{1, 0, 0, force_N[0]}, {0, 1, 0, force_N[1]}, {0, 0, 1, force_N[2]}};

	return incise_igtl_pack_transform(message_bytes(message), sending->capacity,
					  label, matrix);
}

static ssize_t pack_data(struct sending *sending, struct message *message,
			 const struct incise_igtl_label *label)
{
	return incise_igtl_pack_string(message_bytes(message), sending->capacity, label,
				       sending->text, sending->n);
}

static ssize_t pack_status(struct sending *sending, struct message *message,
			   const struct incise_igtl_label *label)
{
	static const uint16_t codes[] = {
		[SERVE_RUNS] = INCISE_IGTL_OK,
		[SERVE_STARTS] = INCISE_IGTL_NOT_READY,
		[SERVE_FAULT] = INCISE_IGTL_HARDWARE_FAILURE,
		[SERVE_ENDED] = INCISE_IGTL_SHUT_DOWN,
		[SERVE_ABSENT] = INCISE_IGTL_NOT_PRESENT,
	};
	struct incise_igtl_status status = {.code = codes[sending->item->status.state],
					    .sub_code = (int64_t)sending->item->lost,
					    .text = sending->item->status.text};

	snprintf(status.error, sizeof(status.error), "%s", sending->item->status.name);
	return incise_igtl_pack_status(message_bytes(message), sending->capacity, label,
				       &status);
}

/* A pixel is 1 mm, and the middle of the first one is the origin, as viewers expect. */
static ssize_t pack_frame(struct sending *sending, struct message *message,
			  const struct incise_igtl_label *label)
{
	const struct pixels *pixels = &sending->igtl->pixels;
	uint16_t width = (uint16_t)pixels->width, height = (uint16_t)pixels->height;
	const struct incise_igtl_image image = {
		.components = (uint8_t)pixels->components,
		.scalar = INCISE_IGTL_UINT8,
		.little = true,
		.ras = true,
		.size = {width, height, 1},
		.axis = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
		.centre = {(width - 1) / 2.0, (height - 1) / 2.0, 0},
		.part = {width, height, 1},
		.pixel = pixels->bytes,
		.n = (size_t)width * height * (size_t)pixels->components,
	};

	return incise_igtl_pack_image(message_bytes(message), sending->capacity, label,
				      &image);
}

static void send_force(struct igtl *igtl, const struct serve_item *item)
{
	struct sending force = {.igtl = igtl,
				.output = FORCE,
				.item = item,
				.pack = pack_force,
				.capacity = SMALL};
	struct sending data = {.igtl = igtl,
			       .output = DATA,
			       .item = item,
			       .pack = pack_data,
			       .capacity = SMALL};
	json_t *object = json_pack("{sI so so si sI}", "t_ns", (json_int_t)item->t_ns,
				   "force_N", json_numbers(item->force.mean_N, 3), "sd_N",
				   json_number(item->force.sd_N), "samples",
				   item->force.samples, "lost", (json_int_t)item->lost);

	data.n = json_dumpb(object, data.text, sizeof(data.text),
			    JSON_COMPACT | JSON_REAL_PRECISION(9));
	json_decref(object);
	send_all(&force);
	send_all(&data);
}

static void send_frame(struct igtl *igtl, const struct serve_item *item)
{
	struct sending frame = {
		.igtl = igtl, .output = FRAME, .item = item, .pack = pack_frame};
	int rc = pixels_convert(&igtl->pixels, item->frame);

	if (rc == -ENOTSUP && !igtl->warned) {
		igtl->warned = true;
		cli_warn(
			"frames are JPEG, and this incise was built without libjpeg: they are "
			"not sent");
	}
	if (rc)
		return;
	frame.capacity = FRAME_HEAD + (size_t)igtl->pixels.width *
					      (size_t)igtl->pixels.height *
					      (size_t)igtl->pixels.components;
	send_all(&frame);
}

static void igtl_send(struct serve_sink *sink, const struct serve_item *item)
{
	struct igtl *igtl = (struct igtl *)sink;
	struct sending small = {.igtl = igtl, .item = item, .capacity = SMALL};

	switch (item->kind) {
	case SERVE_POSE:
		small.output = POSE;
		small.pack = pack_pose;
		send_all(&small);
		break;
	case SERVE_FORCE:
		send_force(igtl, item);
		break;
	case SERVE_FRAME:
		send_frame(igtl, item);
		break;
	default:
		small.output = STATUS;
		small.pack = pack_status;
		send_all(&small);
	}
}

/* --- receiving ----------------------------------------------------------------------- */

static void *igtl_opened(void *context, struct client *client)
{
	const struct igtl *igtl = context;
	struct peer *peer = cli_alloc(1, sizeof(*peer));

	(void)client;
	peer->version = igtl->version ? igtl->version : 1;
	peer->stream = incise_igtl_stream_new(BODY_MAX);
	if (!peer->stream)
		cli_fail("no memory");
	return peer;
}

static void igtl_closed(void *user)
{
	struct peer *peer = user;

	incise_igtl_stream_free(peer->stream);
	free(peer);
}

static size_t igtl_full(void *context, uint8_t *bytes, size_t capacity)
{
	const struct igtl *igtl = context;
	const struct incise_igtl_label label = {.version =
							igtl->version ? igtl->version : 1,
						.name = outputs[STATUS].name,
						.utc_ns = serve_utc_of(cli_now_ns())};
	struct incise_igtl_status status = {
		.code = INCISE_IGTL_BUSY, .sub_code = CLIENTS_MOST, .error = "busy"};
	char text[100];
	ssize_t n;

	snprintf(text, sizeof(text),
		 "%d clients are connected, and no more are served; end one of them",
		 CLIENTS_MOST);
	status.text = text;
	n = incise_igtl_pack_status(bytes, capacity, &label, &status);
	return n > 0 ? (size_t)n : 0;
}

static bool igtl_inside(void *user)
{
	return incise_igtl_stream_inside(((const struct peer *)user)->stream);
}

/* The outputs that a request is for, as bits: by type, and by name if it has one. */
static unsigned int asked(const struct incise_igtl_message *message)
{
	const char *type = message->type + 4;
	unsigned int found = 0;

	for (int i = 0; i < REPLY; i++) {
		/* GET_TRANSFORM is too long for its field: the protocol has GET_TRANS. */
		const char *own = outputs[i].type;
		size_t n = strcmp(own, "TRANSFORM") ? strlen(own) : 5;

		if (!strncmp(type, own, n) && strlen(type) <= strlen(own) &&
		    (!*message->name || !strcmp(message->name, outputs[i].name)))
			found |= 1u << i;
	}
	return found;
}

/* The types that are sent, 12 bytes each. */
static void send_capability(struct igtl *igtl, struct client *client, int version)
{
	static const char types[][INCISE_IGTL_TYPE] = {"TRANSFORM", "STRING", "IMAGE",
						       "STATUS", "CAPABILITY"};
	const struct incise_igtl_label label = {.version = version,
						.name = outputs[REPLY].name,
						.utc_ns = serve_utc_of(cli_now_ns())};
	struct message *message = message_new(REPLY, false, SMALL);
	ssize_t n = incise_igtl_pack(message_bytes(message), SMALL, &label, "CAPABILITY",
				     types, sizeof(types));

	(void)igtl;
	if (n > 0) {
		message_set_size(message, (size_t)n);
		clients_send(client, message);
	}
	message_drop(message);
}

static void answer(struct igtl *igtl, struct client *client, struct peer *peer,
		   const struct incise_igtl_message *message)
{
	bool get = !strncmp(message->type, "GET_", 4);
	bool start = !strncmp(message->type, "STT_", 4);
	bool stop = !strncmp(message->type, "STP_", 4);
	unsigned int found = get || start || stop ? asked(message) : 0;

	if (!igtl->version)
		peer->version = message->version;
	igtl->requests++;
	if (get && !strncmp(message->type + 4, "CAPABIL", 7))
		send_capability(igtl, client, peer->version);
	else if (!found)
		igtl->ignored++;
	else if (start)
		peer->stopped &= ~found;
	else if (stop)
		peer->stopped |= found;
	for (int i = 0; i < REPLY && get; i++)
		if (found & 1u << i && igtl->newest[i][peer->version - 1])
			clients_send(client, igtl->newest[i][peer->version - 1]);
}

static const char *igtl_received(void *context, struct client *client, void *user,
				 const uint8_t *bytes, size_t n)
{
	struct igtl *igtl = context;
	struct peer *peer = user;
	struct incise_igtl_message message;
	int found;

	while ((found = incise_igtl_stream_next(peer->stream, &bytes, &n, &message))) {
		if (found == -EPROTO)
			return "it sent bytes that are not OpenIGTLink";
		if (found == 1)
			answer(igtl, client, peer, &message);
		else
			igtl->ignored++;
	}
	return NULL;
}

/* --- the sink ------------------------------------------------------------------------ */

static int igtl_fd(const struct serve_sink *sink)
{
	return clients_fd(((const struct igtl *)sink)->clients);
}

static void igtl_flush(struct serve_sink *sink)
{
	clients_flush(((struct igtl *)sink)->clients);
}

static void igtl_work(struct serve_sink *sink)
{
	clients_work(((struct igtl *)sink)->clients);
}

static void igtl_tick(struct serve_sink *sink, int64_t now_ns)
{
	clients_tick(((struct igtl *)sink)->clients, now_ns);
}

static bool igtl_is_empty(const struct serve_sink *sink)
{
	return clients_are_empty(((const struct igtl *)sink)->clients);
}

static int igtl_summary(const struct serve_sink *sink, char *text, size_t size)
{
	return clients_summary(((const struct igtl *)sink)->clients, text, size);
}

static void igtl_close(struct serve_sink *sink)
{
	clients_close(((struct igtl *)sink)->clients, "incise serve has ended");
}

static json_t *igtl_report(const struct serve_sink *sink)
{
	const struct igtl *igtl = (const struct igtl *)sink;
	json_t *report = clients_report(igtl->clients);

	json_set_integer(report, "requests", (json_int_t)igtl->requests);
	json_set_integer(report, "requests_ignored", (json_int_t)igtl->ignored);
	return json_pack("{so}", "igtl", report);
}

static void igtl_print(const struct serve_sink *sink)
{
	clients_print(((const struct igtl *)sink)->clients);
}

static void igtl_free(struct serve_sink *sink)
{
	struct igtl *igtl = (struct igtl *)sink;

	for (int i = 0; i < 2 * OUTPUTS; i++)
		if (igtl->newest[i / 2][i % 2])
			message_drop(igtl->newest[i / 2][i % 2]);
	clients_free(igtl->clients);
	free(igtl->pixels.bytes);
	free(igtl);
}

static const struct serve_sink_ops igtl_ops = {
	.send = igtl_send,
	.flush = igtl_flush,
	.fd = igtl_fd,
	.work = igtl_work,
	.tick = igtl_tick,
	.is_empty = igtl_is_empty,
	.summary = igtl_summary,
	.close = igtl_close,
	.report = igtl_report,
	.print = igtl_print,
	.free = igtl_free,
};

struct serve_sink *serve_igtl_new(const struct serve_igtl_options *options,
				  const struct serve_info *info)
{
	struct igtl *igtl = cli_alloc(1, sizeof(*igtl));
	const struct clients_setup setup = {
		.address = options->address,
		.idle_s = options->idle_s,
		.opened = igtl_opened,
		.received = igtl_received,
		.inside = igtl_inside,
		.closed = igtl_closed,
		.full = igtl_full,
		.context = igtl,
	};

	igtl->base.ops = &igtl_ops;
	igtl->info = info;
	igtl->version = options->version;
	igtl->clients = clients_new(&setup);
	cli_note("OpenIGTLink on %s: %s", clients_address(igtl->clients), info->name);
	return &igtl->base;
}
