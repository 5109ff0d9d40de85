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
#include <endian.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <openigtlink/igtl_image.h>
#include <openigtlink/igtl_string.h>
#include <openigtlink/igtl_transform.h>
#include "../../lib/device/igtl/igtl_message.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/pixels.h"
#include "clients.h"
#include "serve.h"

enum output { POSE, FORCE, DATA, FRAME, STATUS, REPLY, OUTPUTS };

static const struct {
	const char *type, *name;
} outputs[OUTPUTS] = {
	[POSE] = {"TRANSFORM", "TipToTracker"}, [FORCE] = {"TRANSFORM", "Force"},
	[DATA] = {"STRING", "ForceData"},	[FRAME] = {"IMAGE", "Camera"},
	[STATUS] = {"STATUS", "Status"},	[REPLY] = {"CAPABILITY", "incise"},
};

#define SMALL 1024    /* bytes of a text, and of a message's own parts */
#define BODY_MAX 4096 /* of what clients send */

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

/* An item as the content of a message: a head, and what follows it, in the order of the wire. */
struct sending {
	struct igtl *igtl;
	enum output output;
	const struct serve_item *item;
	const void *head, *content;
	size_t head_n, n;
	/* By version; packed when the first client needs it. */
	struct message *message[2];
};

static struct message *pack_message(const struct sending *sending,
				    const struct incise_igtl_label *label)
{
	size_t capacity = SMALL + sending->head_n + sending->n;
	struct message *message =
		message_new(sending->output, sending->output == FRAME, capacity);
	ssize_t n =
		incise_igtl_pack(message_bytes(message), capacity, label, sending->head,
				 sending->head_n, sending->content, sending->n);

	message_set_size(message, n > 0 ? (size_t)n : 0);
	return message;
}

static struct message *packed(struct sending *sending, int version)
{
	const struct serve_item *item = sending->item;
	struct message **message = &sending->message[version - 1];
	char t_ns[24], lost[24];
	const char *const metadata[][2] = {{"t_ns", t_ns}, {"lost", lost}};
	const struct incise_igtl_label label = {
		.version = version,
		.type = outputs[sending->output].type,
		.name = outputs[sending->output].name,
		.utc_ns = item->utc_ns,
		.id = sending->igtl->id,
		.metadata = metadata,
		.n_metadata = 2,
	};

	if (*message)
		return *message;
	snprintf(t_ns, sizeof(t_ns), "%lld", (long long)item->t_ns);
	snprintf(lost, sizeof(lost), "%llu", (unsigned long long)item->lost);
	*message = pack_message(sending, &label);
	return *message;
}

static void send_one(void *context, struct client *client, void *user)
{
	struct sending *sending = context;
	const struct peer *peer = user;

	if (!(peer->stopped & 1u << sending->output))
		clients_send(client, packed(sending, peer->version));
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

/* A TRANSFORM: columns of the rotation, then the translation. */
static void send_matrix(struct igtl *igtl, enum output output,
			const struct serve_item *item, igtl_float32 column[12])
{
	struct sending sending = {.igtl = igtl,
				  .output = output,
				  .item = item,
				  .head = column,
				  .head_n = IGTL_TRANSFORM_SIZE};

	igtl_transform_convert_byte_order(column);
	send_all(&sending);
}

static void send_pose(struct igtl *igtl, const struct serve_item *item)
{
	const double *q = item->pose.quaternion;
	igtl_float32 column[12];

	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		column[4 * i] =
			(float)(1 - 2 * (q[1 + j] * q[1 + j] + q[1 + k] * q[1 + k]));
		column[3 * j + i] = (float)(2 * (q[1 + i] * q[1 + j] - q[0] * q[1 + k]));
		column[3 * k + i] = (float)(2 * (q[1 + i] * q[1 + k] + q[0] * q[1 + j]));
		column[9 + i] = (float)item->pose.position_mm[i];
	}
	send_matrix(igtl, POSE, item, column);
}

static void send_data(struct igtl *igtl, const struct serve_item *item)
{
	char text[SMALL];
	igtl_string_header head = {.encoding = 3}; /* US-ASCII, by IANA's number */
	struct sending sending = {.igtl = igtl,
				  .output = DATA,
				  .item = item,
				  .head = &head,
				  .head_n = sizeof(head),
				  .content = text};
	json_t *object = json_pack("{sI so so si sI}", "t_ns", (json_int_t)item->t_ns,
				   "force_N", json_numbers(item->force.mean_N, 3), "sd_N",
				   json_number(item->force.sd_N), "samples",
				   item->force.samples, "lost", (json_int_t)item->lost);

	sending.n = json_dumpb(object, text, sizeof(text),
			       JSON_COMPACT | JSON_REAL_PRECISION(9));
	json_decref(object);
	head.length = (igtl_uint16)sending.n;
	igtl_string_convert_byte_order(&head);
	send_all(&sending);
}

static void send_force(struct igtl *igtl, const struct serve_item *item)
{
	const double *force_N = item->force.mean_N;
	igtl_float32 column[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

	for (int i = 0; i < 3; i++)
		column[9 + i] = (float)force_N[i];
	send_matrix(igtl, FORCE, item, column);
	send_data(igtl, item);
}

static struct incise_igtl_status status_of(enum incise_igtl_code code, uint64_t sub_code,
					   const char *error)
{
	struct incise_igtl_status status = {.code = htobe16(code),
					    .sub_code = (int64_t)htobe64(sub_code)};

	memcpy(status.error, error, strnlen(error, sizeof(status.error)));
	return status;
}

static void send_status(struct igtl *igtl, const struct serve_item *item)
{
	static const enum incise_igtl_code codes[] = {
		[SERVE_RUNS] = INCISE_IGTL_OK,
		[SERVE_STARTS] = INCISE_IGTL_NOT_READY,
		[SERVE_FAULT] = INCISE_IGTL_HARDWARE_FAILURE,
		[SERVE_ENDED] = INCISE_IGTL_SHUT_DOWN,
		[SERVE_ABSENT] = INCISE_IGTL_NOT_PRESENT,
	};
	const struct incise_igtl_status head =
		status_of(codes[item->status.state], item->lost, item->status.name);
	struct sending sending = {.igtl = igtl,
				  .output = STATUS,
				  .item = item,
				  .head = &head,
				  .head_n = sizeof(head),
				  .content = item->status.text,
				  .n = strlen(item->status.text) + 1};

	send_all(&sending);
}

/* A pixel is 1 mm, and the middle of the first one is the origin, as viewers expect. */
static void send_frame(struct igtl *igtl, const struct serve_item *item)
{
	const struct pixels *pixels = &igtl->pixels;
	int rc = pixels_convert(&igtl->pixels, item->frame);
	igtl_uint16 width = (igtl_uint16)pixels->width;
	igtl_uint16 height = (igtl_uint16)pixels->height;
	igtl_image_header head = {
		.version = IGTL_IMAGE_HEADER_VERSION,
		.num_components = (igtl_uint8)pixels->components,
		.scalar_type = IGTL_IMAGE_STYPE_TYPE_UINT8,
		.endian = IGTL_IMAGE_ENDIAN_LITTLE,
		.coord = IGTL_IMAGE_COORD_RAS,
		.size = {width, height, 1},
		.matrix = {1, 0, 0, 0, 1, 0, 0, 0, 1, (float)(width - 1) / 2,
			   (float)(height - 1) / 2, 0},
		.subvol_size = {width, height, 1},
	};
	struct sending sending = {.igtl = igtl,
				  .output = FRAME,
				  .item = item,
				  .head = &head,
				  .head_n = sizeof(head),
				  .content = pixels->bytes,
				  .n = (size_t)width * height *
				       (size_t)pixels->components};

	if (rc == -ENOTSUP && !igtl->warned) {
		igtl->warned = true;
		cli_warn(
			"frames are JPEG, and this incise was built without libjpeg: they are "
			"not sent");
	}
	if (rc)
		return;
	igtl_image_convert_byte_order(&head);
	send_all(&sending);
}

static void igtl_send(struct serve_sink *sink, const struct serve_item *item)
{
	static void (*const send[SERVE_KINDS])(struct igtl *,
					       const struct serve_item *) = {
		[SERVE_POSE] = send_pose,
		[SERVE_FORCE] = send_force,
		[SERVE_FRAME] = send_frame,
		[SERVE_STATUS] = send_status,
	};

	if (send[item->kind])
		send[item->kind]((struct igtl *)sink, item);
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
						.type = outputs[STATUS].type,
						.name = outputs[STATUS].name,
						.utc_ns = serve_utc_of(cli_now_ns())};
	const struct incise_igtl_status status =
		status_of(INCISE_IGTL_BUSY, CLIENTS_MOST, "busy");
	char text[100];
	ssize_t n;

	snprintf(text, sizeof(text),
		 "%d clients are connected, and no more are served; end one of them",
		 CLIENTS_MOST);
	n = incise_igtl_pack(bytes, capacity, &label, &status, sizeof(status), text,
			     strlen(text) + 1);
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
static void send_capability(struct client *client, int version)
{
	static const char types[][IGTL_HEADER_TYPE_SIZE] = {
		"TRANSFORM", "STRING", "IMAGE", "STATUS", "CAPABILITY"};
	const struct incise_igtl_label label = {.version = version,
						.type = outputs[REPLY].type,
						.name = outputs[REPLY].name,
						.utc_ns = serve_utc_of(cli_now_ns())};
	const struct sending sending = {
		.output = REPLY, .content = types, .n = sizeof(types)};
	struct message *message = pack_message(&sending, &label);

	clients_send(client, message);
	message_drop(message);
}

static void answer_igtl_client(struct igtl *igtl, struct client *client,
			       struct peer *peer,
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
		send_capability(client, peer->version);
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
			answer_igtl_client(igtl, client, peer, &message);
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
