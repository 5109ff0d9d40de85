// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A Haply Inverse3, with or without a VerseGrip, behind the Inverse Service,
 * "haply:[HOST:PORT][/ID]".
 *
 * This side is the clock: the service answers each message, which carries a force, by one frame. wait()
 * returns twice a period, so that the force of a message is the newest one:
 *
 *     wait()  |- sleep -|- message ── frame -|- sleep -|- message ── frame -|
 *     read()            ·                  state       ·                  state
 *     push()          force                          force
 *
 * A state is as young as its message, or younger. No message follows one that has no answer yet.
 * Safety and batteries are events of a second port, where there is one.
 */
#include <errno.h>
#include <netdb.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <libwebsockets.h>
#include "../../base/monotonic.h"
#include "../../base/vector.h"
#include "../../rig/backends.h"
#include "haply_message.h"

#define MS INT64_C(1000000)
#define PORT 10001
#define EVENTS_AFTER 19 /* 10020 */
#define RATE_HZ 1000
#define OPEN_NS (3000 * MS)
#define ANSWER_NS MS /* assumed, of poses and forces */
#define CLOSE_NS (100 * MS)
#define LATE_PERIODS 4
#define CONFIG_NS (1000 * MS) /* between two requests for the config */
#define BRIEF_NS (1000 * MS)  /* a protection counts that no event ends */
#define REPEATS 2	      /* messages with the force of one push */
#define BAD_MOST 50	      /* frames in a row that are not understood */
/* The service documents that the device goes idle without a new force, and not how soon. */
#define DEADMAN_S 0.1
#define LATE "answers late; end other programs, or lower haptic_setup.rate_hz"
#define SCALED                                                                      \
	"has a scaled space, in which forces are not those of the plan; reset its " \
	"transform and mount"

struct haply_link {
	struct lws *wsi; /* NULL: closed */
	bool is_open;
	char in[HAPLY_FRAME_MAX];
	size_t in_n; /* HAPLY_FRAME_MAX: it is longer */
};

struct haply {
	struct incise_haptic haptic; /* first */
	struct incise_haptic_info info;
	char host[256], address[NI_MAXHOST];
	char id[HAPLY_ID_SIZE], grip[HAPLY_ID_SIZE];
	int port;
	struct lws_context *context;
	struct haply_link frames, events;
	char out[LWS_PRE + HAPLY_COMMAND_MAX];
	size_t out_n;		  /* 0: nothing to send */
	struct haply_frame frame; /* the last one */
	enum haply_format format;
	int64_t period_ns, due_ns, sent_ns, config_ns;
	bool waits; /* for the answer of a message; at first, for the inventory */
	bool late;  /* it is, and a sample has said so */
	double force_N[3];
	int repeats; /* messages with this force */
	struct incise_haptic_sample sample;
	bool has_sample, mount_scaled;
	uint64_t seq, lost;
	int bad;	  /* frames in a row */
	uint32_t states;  /* haply_protection, BATTERY and CHANGED */
	int64_t brief_ns; /* HAPLY_BRIEF began */
	char event[160];  /* the last state's */
	char ended[300];  /* why there is no force until it is opened again; or "" */
	int error;	  /* negative; for good */
	char cause[400];
};

static struct haply *haply_of(const struct incise_haptic *haptic)
{
	return (struct haply *)haptic;
}

/* --- samples -------------------------------------------------------------------------- */

static void fail(struct haply *h, int error, const char *cause)
{
	h->error = error;
	snprintf(h->cause, sizeof(h->cause), "the Inverse Service at %s port %d %s",
		 h->host, h->port, cause);
}

/* Position and orientation are there already. */
static void add_sample(struct haply *h, int64_t t_ns, const char *not_ready)
{
	if (incise_monotonic_ns() - h->brief_ns > BRIEF_NS)
		h->states &= ~(uint32_t)HAPLY_BRIEF;
	h->sample.t_ns = t_ns;
	h->sample.seq = h->seq++;
	h->sample.flags =
		(not_ready ? INCISE_HAPTIC_NOT_READY : 0) |
		(h->states < HAPLY_BRAKE && !*h->ended ? 0 : INCISE_HAPTIC_PROTECTED) |
		(h->states & (HAPLY_BRAKE - 1));
	h->has_sample = true;
	if (h->states & INCISE_HAPTIC_CHANGED)
		not_ready = "was unplugged, or is another one now; start again";
	snprintf(h->cause, sizeof(h->cause), h->sample.flags ? "Inverse3 %s %s%s" : "",
		 h->id, not_ready ? not_ready : h->event,
		 not_ready ? "" : "; see the manual of the device");
	if (*h->ended)
		snprintf(h->cause, sizeof(h->cause), "Inverse3 %s: %s", h->id, h->ended);
}

static void use_config(struct haply *h)
{
	h->mount_scaled = h->frame.mount_scaled;
	if (*h->info.filters && strcmp(h->info.filters, h->frame.filters))
		snprintf(h->ended, sizeof(h->ended),
			 "its filters changed (now %s): start again", h->frame.filters);
}

static void use_frame(struct haply *h, bool late)
{
	const struct haply_frame *frame = &h->frame;
	const char *not_ready = frame->not_ready;

	if (frame->has_config)
		use_config(h);
	if (*h->id && !*frame->id && frame->n)
		h->states |= INCISE_HAPTIC_CHANGED;
	if (v3_finite(frame->position_mm))
		v3_copy(h->sample.position_mm, frame->position_mm);
	v3_copy(h->sample.velocity_mm_s, frame->velocity_mm_s);
	memcpy(h->sample.quaternion, frame->quaternion, sizeof(frame->quaternion));
	h->sample.buttons = frame->buttons;
	if (!not_ready && (frame->scaled || h->mount_scaled))
		not_ready = SCALED;
	add_sample(h, h->sent_ns, !not_ready && late ? LATE : not_ready);
}

static void take_frame(struct haply *h, const char *text, size_t n)
{
	bool late = incise_monotonic_ns() - h->sent_ns > LATE_PERIODS * h->period_ns;

	/* No message asked for this frame. */
	if (!h->waits)
		return;
	h->waits = h->late = false;
	/* A VerseGrip that comes after the start is not that of the plan. */
	if (!haply_frame_parse(&h->frame, text, n, h->id,
			       h->period_ns && !*h->grip ? NULL : h->grip)) {
		h->bad = 0;
		use_frame(h, late && h->period_ns);
		return;
	}
	h->lost++;
	add_sample(
		h, h->sample.t_ns,
		"sent a frame that is not understood; see the messages of its service");
	if (++h->bad >= BAD_MOST)
		fail(h, -EPROTO, "sends no frames that are understood; update it");
}

static void take_event(struct haply *h, const char *text, size_t n)
{
	int state =
		haply_event_parse(text, n, h->id, h->grip, h->event, sizeof(h->event));

	h->states |= (uint32_t)(state > 0 ? state : 0);
	h->states &= ~(uint32_t)(state < 0 ? -state : 0);
	if (state == HAPLY_BRIEF)
		h->brief_ns = incise_monotonic_ns();
}

/* --- connections ---------------------------------------------------------------------- */

static void receive_piece(struct haply *h, struct haply_link *link, const char *piece,
			  size_t n)
{
	size_t space = HAPLY_FRAME_MAX - link->in_n;

	n = n < space ? n : space;
	memcpy(link->in + link->in_n, piece, n);
	link->in_n += n;
	if (!lws_is_final_fragment(link->wsi) || lws_remaining_packet_payload(link->wsi))
		return;
	(link == &h->frames ? take_frame : take_event)(h, link->in, link->in_n);
	link->in_n = 0;
}

static int handle_link(struct lws *wsi, enum lws_callback_reasons reason, void *user,
		       void *in, size_t n)
{
	struct haply *h = lws_context_user(lws_get_context(wsi));
	struct haply_link *link = user;

	switch (reason) {
	case LWS_CALLBACK_CLIENT_ESTABLISHED:
		link->is_open = true;
		return 0;
	case LWS_CALLBACK_CLIENT_RECEIVE:
		receive_piece(h, link, in, n);
		return 0;
	case LWS_CALLBACK_CLIENT_WRITEABLE:
		if (!h->out_n || link != &h->frames)
			return 0;
		lws_write(wsi, (unsigned char *)h->out + LWS_PRE, h->out_n,
			  LWS_WRITE_TEXT);
		h->out_n = 0;
		return 0;
	case LWS_CALLBACK_CLIENT_CONNECTION_ERROR:
	case LWS_CALLBACK_CLIENT_CLOSED:
		if (link == &h->events && link->is_open)
			snprintf(
				h->ended, sizeof(h->ended),
				"the port of its events closed, its safety is not known: "
				"start its service, then start again");
		link->is_open = false;
		link->wsi = NULL;
		return 0;
	default:
		return lws_callback_http_dummy(wsi, reason, user, in, n);
	}
}

static void connect_link(struct haply *h, struct haply_link *link, int port)
{
	struct lws_client_connect_info info = {
		.context = h->context,
		.address = h->address,
		.host = h->host,
		.origin = h->host,
		.port = port,
		.path = "/",
		.local_protocol_name = "haply",
		.userdata = link,
		.pwsi = &link->wsi,
	};

	if (!lws_client_connect_via_info(&info))
		link->wsi = NULL;
}

/* Until the answer is there, the connection ends, or the time is over. 0 or -EINTR. */
static int wait_answer(struct haply *h, int64_t until_ns)
{
	for (;;) {
		struct haply_link *link = &h->frames;
		struct pollfd on = {.events = POLLIN};
		struct timespec most = {0};
		int64_t left_ns;

		lws_service(h->context, -1);
		left_ns = until_ns - incise_monotonic_ns();
		if (!h->waits || !link->wsi || left_ns <= 0)
			return 0;
		/* While it connects, the library has sockets and timers of its own. */
		on.fd = link->is_open ? lws_get_socket_fd(link->wsi) : -1;
		on.events |= h->out_n ? POLLOUT : 0;
		most.tv_nsec = left_ns < MS ? left_ns : MS;
		if (ppoll(&on, 1, &most, NULL) < 0 && errno == EINTR)
			return -EINTR;
	}
}

/* --- the loop ------------------------------------------------------------------------- */

static void send_message(struct haply *h)
{
	const double none_N[3] = {0};
	int64_t now_ns = incise_monotonic_ns();
	const char *session = NULL;

	if (!h->config_ns)
		session = HAPLY_NAME_SESSION;
	else if (now_ns - h->config_ns > CONFIG_NS)
		session = HAPLY_ASK_CONFIG;
	h->config_ns = session ? now_ns : h->config_ns;
	h->out_n =
		haply_command_print(h->out + LWS_PRE, HAPLY_COMMAND_MAX, h->format, h->id,
				    h->repeats++ < REPEATS ? h->force_N : none_N,
				    session);
	lws_callback_on_writable(h->frames.wsi);
	h->waits = true;
	h->sent_ns = now_ns;
	h->due_ns += h->period_ns;
	if (h->due_ns < now_ns)
		h->due_ns = now_ns + h->period_ns;
}

static int wait_haply(struct incise_haptic *haptic, int64_t most_ns)
{
	struct haply *h = haply_of(haptic);
	int64_t now_ns = incise_monotonic_ns(), until_ns = now_ns + most_ns, late_ns;
	int rc;

	if (h->error || (!h->waits && now_ns < h->due_ns)) {
		if (!h->error && h->due_ns < until_ns)
			until_ns = h->due_ns;
		incise_monotonic_sleep_until(until_ns);
		return 0;
	}
	if (!h->waits)
		send_message(h);
	late_ns = h->sent_ns + LATE_PERIODS * h->period_ns;
	rc = wait_answer(h, until_ns > late_ns && !h->late ? late_ns : until_ns);
	if (!h->frames.wsi)
		fail(h, -ENODEV, "closed the connection; start it, then start again");
	if (h->waits && !h->late && incise_monotonic_ns() >= late_ns) {
		h->late = true;
		add_sample(h, h->sample.t_ns, LATE);
	}
	return rc;
}

static int read_haply(struct incise_haptic *haptic, struct incise_haptic_sample *samples,
		      int n)
{
	struct haply *h = haply_of(haptic);

	if (h->error)
		return h->error;
	if (n < 1 || !h->has_sample)
		return 0;
	*samples = h->sample;
	h->has_sample = false;
	return 1;
}

/* Without a known largest force there is none. */
static int push_haply(struct incise_haptic *haptic, const double force_N[3],
		      const double torque_N_mm[3])
{
	struct haply *h = haply_of(haptic);
	double size_N = v3_length(force_N), peak_N = haptic->info.peak_N;
	double share = size_N > peak_N ? peak_N / size_N * (1 - 1e-12) : 1;

	(void)torque_N_mm;
	if (h->sample.flags & ~(uint32_t)INCISE_HAPTIC_BATTERY)
		share = 0;
	for (int i = 0; i < 3; i++)
		h->force_N[i] = force_N[i] * share;
	h->repeats = 0;
	return h->error;
}

static void get_info(const struct incise_haptic *haptic, struct incise_haptic_info *info)
{
	*info = haply_of(haptic)->info;
}

static uint64_t count_lost(const struct incise_haptic *haptic)
{
	return haply_of(haptic)->lost;
}

static int print_cause(struct incise_haptic *haptic, char *text, size_t size)
{
	return snprintf(text, size, "%s", haply_of(haptic)->cause);
}

static void close_haply(struct incise_haptic *haptic)
{
	struct haply *h = haply_of(haptic);

	if (h->frames.is_open && h->config_ns) {
		h->repeats = REPEATS;
		send_message(h);
		wait_answer(h, incise_monotonic_ns() + CLOSE_NS);
	}
	if (h->context)
		lws_context_destroy(h->context);
	free(h);
}

static const struct incise_haptic_ops ops = {
	.read = read_haply,
	.push = push_haply,
	.wait = wait_haply,
	.info = get_info,
	.lost = count_lost,
	.close = close_haply,
	.cause = print_cause,
};

/* --- opening -------------------------------------------------------------------------- */

static bool parse_arguments(struct haply *h, const char *arguments)
{
	int n = 0, all = 0;

	snprintf(h->host, sizeof(h->host), "localhost");
	h->port = PORT;
	if (*arguments && *arguments != '/' &&
	    sscanf(arguments, "%255[^:/]:%5d%n", h->host, &h->port, &n) != 2)
		return false;
	arguments += n;
	if (*arguments)
		sscanf(arguments, "/%23[^/]%n", h->id, &all);
	return !arguments[all] && h->port > 0 && h->port <= 65535 - EVENTS_AFTER;
}

static bool create_context(struct haply *h)
{
	static const struct lws_protocols protocols[] = {
		{.name = "haply", .callback = handle_link}, {0}};
	const struct lws_context_creation_info info = {
		.port = CONTEXT_PORT_NO_LISTEN,
		.protocols = protocols,
		.gid = (gid_t)-1,
		.uid = (uid_t)-1,
		.fd_limit_per_thread = 8,
		.user = h,
	};

	lws_set_log_level(0, NULL);
	h->context = lws_create_context(&info);
	return h->context;
}

/* Address by address: libwebsockets 4.3 gives up a host whose first address refuses it. */
static void connect_host(struct haply *h, int64_t until_ns)
{
	struct addrinfo hints = {.ai_socktype = SOCK_STREAM}, *found = NULL, *one;

	if (getaddrinfo(h->host, NULL, &hints, &found))
		return;
	for (one = found; one && !h->frames.wsi; one = one->ai_next) {
		if (getnameinfo(one->ai_addr, one->ai_addrlen, h->address,
				sizeof(h->address), NULL, 0, NI_NUMERICHOST))
			continue;
		connect_link(h, &h->frames, h->port);
		wait_answer(h, until_ns);
	}
	freeaddrinfo(found);
}

/* Connect, and wait for the inventory, which is the first frame. */
static int connect_service(struct haply *h, const char *arguments, const char *where,
			   struct incise_error *err)
{
	int64_t until_ns = incise_monotonic_ns() + OPEN_NS;

	if (!parse_arguments(h, arguments))
		return incise_error_set(err, EINVAL,
					"%s: \"%.80s\": expected haply:[HOST:PORT][/ID], "
					"such as haply:localhost:10001/049D; correct it",
					where, arguments);
	if (!create_context(h))
		return incise_error_set(err, ENOMEM, "%s: %s", where, strerror(ENOMEM));
	h->waits = true;
	h->sent_ns = incise_monotonic_ns();
	connect_host(h, until_ns);
	if (h->waits || h->bad)
		return incise_error_set(err, h->bad ? EPROTO : ENODEV,
					"%s: no Inverse Service at %.100s port %d; start "
					"haply-inverse-service, or correct host and port",
					where, h->host, h->port);
	connect_link(h, &h->events, h->port + EVENTS_AFTER);
	while (h->events.wsi && !h->events.is_open && incise_monotonic_ns() < until_ns) {
		lws_service(h->context, -1);
		incise_monotonic_sleep_until(incise_monotonic_ns() + MS);
	}
	return 0;
}

static void fill_info(struct haply *h, double rate_hz)
{
	struct incise_haptic_info *info = &h->info;

	snprintf(info->name, sizeof(info->name), "Haply Inverse3 %s", h->id);
	info->rate_hz = rate_hz > 0 ? rate_hz : RATE_HZ;
	h->period_ns = (int64_t)(INCISE_NS_PER_S / info->rate_hz);
	info->latency_ns = info->force_latency_ns = ANSWER_NS;
	info->deadman_s = DEADMAN_S;
	info->buttons = *h->grip ? HAPLY_BUTTONS : 0;
	info->measures_velocity = true;
	info->measures_orientation = *h->grip;
	info->own_gravity = h->frame.own_gravity;
	snprintf(info->filters, sizeof(info->filters), "%s", h->frame.filters);
	if (!h->events.is_open)
		snprintf(info->note, sizeof(info->note),
			 "no events at port %d: its safety and its batteries are not "
			 "known",
			 h->port + EVENTS_AFTER);
}

static int choose_inverse3(struct haply *h, const char *where, struct incise_error *err)
{
	const struct haply_frame *frame = &h->frame;

	if (!*frame->id || (!*h->id && frame->n > 1))
		return incise_error_set(
			err, *frame->id ? EINVAL : ENODEV,
			"%s: the Inverse3 of %.100s port %d are: %s; plug one in, or "
			"name one, as in haply:%.100s:%d/049D",
			where, h->host, h->port, frame->n ? frame->ids : "none", h->host,
			h->port);
	snprintf(h->id, sizeof(h->id), "%s", frame->id);
	snprintf(h->grip, sizeof(h->grip), "%s", frame->grip);
	h->format = frame->format;
	h->has_sample = false;
	h->seq = 0;
	return 0;
}

static void *open_haply(const struct incise_backend_request *request,
			struct incise_error *err)
{
	struct haply *h = calloc(1, sizeof(*h));
	int rc;

	if (!h) {
		incise_error_set(err, ENOMEM, "%s: %s", request->where, strerror(ENOMEM));
		return NULL;
	}
	h->haptic.ops = &ops;
	rc = connect_service(h, request->arguments, request->where, err);
	if (!rc)
		rc = choose_inverse3(h, request->where, err);
	if (!rc) {
		fill_info(h, request->haptic->rate_hz);
		return &h->haptic;
	}
	close_haply(&h->haptic);
	errno = -rc;
	return NULL;
}

/* Each Inverse3 of a service; where there is none, none. Few machines have one at the default address. */
static int scan_haply(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err)
{
	struct haply *h = calloc(1, sizeof(*h));
	int rc = h ? connect_service(h, arguments, "haply", err) : -ENOMEM;
	char *rest = rc ? NULL : h->frame.ids, *id;

	while (!rc && (id = strsep(&rest, ", "))) {
		struct incise_scan_device device = {.usable = true};

		if (!*id)
			continue;
		snprintf(device.device, sizeof(device.device), "haply:%s:%d/%s", h->host,
			 h->port, id);
		snprintf(device.what, sizeof(device.what), "Haply Inverse3 %s", id);
		rc = found(context, &device);
	}
	if (h)
		close_haply(&h->haptic);
	if (rc == -ENODEV && !*arguments && err)
		err->code = 0;
	return rc == -ENODEV ? 0 : rc;
}

const struct incise_backend incise_haptic_haply = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "haptic",
	.name = "haply",
	.open = open_haply,
	.scan = scan_haply,
};

INCISE_MODULE(incise_haptic_haply);
