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
 * A state is as young as its message, or younger. No message follows one that has no answer yet: the
 * device keeps its force so long, or goes idle. Only the message behind a late answer is scaled:
 *
 *     late by periods     0 ─────── 2 ─────── 3 ───────▶ deadman
 *     force of the next   all of it   fades to 0      0   not ready
 *
 * beyond the latency, and it returns by the ramp of each owner.
 *
 * Safety and batteries are events of a second port, where there is one.
 */
#include <errno.h>
#include <netdb.h>
#include <poll.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <libwebsockets.h>
#include <incise/haptic_page.h>
#include "../../base/vector.h"
#include "../../rig/backends.h"
#include "../../rig/haptic_backend.h"
#include "haply_message.h"

#define MS INT64_C(1000000)
#define PORT 10001
#define EVENTS_AFTER 19 /* 10020 */
#define RATE_HZ 1000
#define OPEN_NS (3000 * MS)
#define ANSWER_NS MS /* assumed, of poses and forces */
#define CLOSE_NS (100 * MS)
#define HELD_PERIODS 2	      /* missed, with all of the force */
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
	struct incise_clock *clock;
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
	bool waits;   /* for the answer of a message; at first, for the inventory */
	bool late;    /* it is beyond the deadman, and a sample has said so */
	double share; /* 0 … 1, of the force, as answers are in time */
	int64_t answered_ns;
	double force_N[3];
	int repeats; /* messages with this force */
	struct incise_haptic_sample sample;
	bool has_sample, mount_scaled;
	uint64_t seq;
	int bad;	  /* frames in a row */
	uint32_t states;  /* haply_protection, BATTERY and CHANGED */
	int64_t brief_ns; /* HAPLY_BRIEF began */
	char event[160];  /* the last state's */
	char ended[300];  /* why there is no force until it is opened again; or "" */
};

static struct haply *haply_of(const struct incise_haptic *haptic)
{
	return (struct haply *)haptic;
}

/* --- samples -------------------------------------------------------------------------- */

static int64_t get_now(const struct haply *h)
{
	return incise_clock_now(h->clock);
}

static void fail(struct haply *h, int error, const char *cause)
{
	incise_haptic_end(&h->haptic, error, "the Inverse Service at %s port %d %s",
			  h->host, h->port, cause);
}

/* Position and orientation are there already. */
static void add_sample(struct haply *h, int64_t t_ns, const char *not_ready)
{
	if (get_now(h) - h->brief_ns > BRIEF_NS)
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
	snprintf(h->haptic.cause, sizeof(h->haptic.cause),
		 h->sample.flags ? "Inverse3 %s %s%s" : "", h->id,
		 not_ready ? not_ready : h->event,
		 not_ready ? "" : "; see the manual of the device");
	if (*h->ended)
		snprintf(h->haptic.cause, sizeof(h->haptic.cause), "Inverse3 %s: %s",
			 h->id, h->ended);
}

static void use_config(struct haply *h)
{
	h->mount_scaled = h->frame.mount_scaled;
	if (*h->haptic.info.filters && strcmp(h->haptic.info.filters, h->frame.filters))
		snprintf(h->ended, sizeof(h->ended),
			 "its filters changed (now %s): start again", h->frame.filters);
}

static void use_frame(struct haply *h)
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
	add_sample(h, h->sent_ns, not_ready);
}

static void share_force(struct haply *h)
{
	int64_t t_ns = get_now(h);
	double late_ns = (double)(t_ns - h->sent_ns - h->haptic.info.latency_ns);
	double ramp = (double)(t_ns - h->answered_ns) / INCISE_HAPTIC_PAGE_RAMP_NS;

	h->share =
		fmin(h->share + ramp, HELD_PERIODS + 1 - late_ns / (double)h->period_ns);
	h->share = fmin(fmax(h->share, 0), 1);
	h->answered_ns = t_ns;
}

static void take_frame(struct haply *h, const char *text, size_t n)
{
	/* No message asked for this frame. */
	if (!h->waits)
		return;
	h->waits = h->late = false;
	if (h->period_ns)
		share_force(h);
	/* A VerseGrip that comes after the start is not that of the plan. */
	if (!haply_frame_parse(&h->frame, text, n, h->id,
			       h->period_ns && !*h->grip ? NULL : h->grip)) {
		h->bad = 0;
		use_frame(h);
		return;
	}
	h->haptic.lost++;
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
		h->brief_ns = get_now(h);
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

/* While it is opened, the port of the events counts, too. */
static bool is_awaited(const struct haply *h)
{
	return h->waits || (!h->period_ns && h->events.wsi && !h->events.is_open);
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
		left_ns = until_ns - get_now(h);
		if (!is_awaited(h) || !link->wsi || left_ns <= 0)
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
	int64_t now_ns = get_now(h);
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
	int64_t now_ns = get_now(h), until_ns = now_ns + most_ns, dead_ns;
	int rc;

	if (haptic->error)
		return incise_clock_wait_until(h->clock, until_ns);
	if (!h->waits && now_ns < h->due_ns)
		return incise_clock_wait_until(h->clock, h->due_ns < until_ns ? h->due_ns
									      : until_ns);
	if (!h->waits)
		send_message(h);
	dead_ns = h->sent_ns + (int64_t)(DEADMAN_S * INCISE_NS_PER_S);
	rc = wait_answer(h, until_ns > dead_ns && !h->late ? dead_ns : until_ns);
	if (!h->frames.wsi)
		fail(h, -ENODEV, "closed the connection; start it, then start again");
	if (h->waits && !h->late && get_now(h) >= dead_ns) {
		h->late = true;
		add_sample(h, h->sample.t_ns, LATE);
	}
	return rc;
}

static int read_haply(struct incise_haptic *haptic, struct incise_haptic_sample *samples,
		      int n)
{
	struct haply *h = haply_of(haptic);

	if (n < 1 || !h->has_sample)
		return 0;
	*samples = h->sample;
	h->has_sample = false;
	return 1;
}

static int push_haply(struct incise_haptic *haptic, const double force_N[3],
		      const double torque_N_mm[3])
{
	struct haply *h = haply_of(haptic);
	bool off = h->sample.flags & ~(uint32_t)INCISE_HAPTIC_BATTERY;

	(void)torque_N_mm;
	incise_haptic_limit(h->force_N, force_N, off ? 0 : h->share,
			    haptic->info.peak_N * (1 - 1e-12));
	h->repeats = 0;
	return 0;
}

static void close_haply(struct incise_haptic *haptic)
{
	struct haply *h = haply_of(haptic);

	if (h->frames.is_open && h->config_ns) {
		h->repeats = REPEATS;
		send_message(h);
		wait_answer(h, get_now(h) + CLOSE_NS);
	}
	if (h->context)
		lws_context_destroy(h->context);
	free(h);
}

static const struct incise_haptic_ops ops = {
	.read = read_haply,
	.push = push_haply,
	.wait = wait_haply,
	.close = close_haply,
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
	int64_t until_ns;

	if (!parse_arguments(h, arguments))
		return incise_error_set(err, EINVAL,
					"%s: \"%.80s\": expected haply:[HOST:PORT][/ID], "
					"such as haply:localhost:10001/049D; correct it",
					where, arguments);
	if (!create_context(h))
		return incise_error_set(err, ENOMEM, "%s: %s", where, strerror(ENOMEM));
	h->waits = true;
	h->sent_ns = get_now(h);
	until_ns = h->sent_ns + OPEN_NS;
	connect_host(h, until_ns);
	if (h->waits || h->bad)
		return incise_error_set(err, h->bad ? EPROTO : ENODEV,
					"%s: no Inverse Service at %.100s port %d; start "
					"haply-inverse-service, or correct host and port",
					where, h->host, h->port);
	connect_link(h, &h->events, h->port + EVENTS_AFTER);
	wait_answer(h, until_ns);
	return 0;
}

static void fill_info(struct haply *h, double rate_hz)
{
	struct incise_haptic_info *info = &h->haptic.info;

	snprintf(info->name, sizeof(info->name), "Haply Inverse3 %s", h->id);
	info->rate_hz = rate_hz > 0 ? rate_hz : RATE_HZ;
	h->period_ns = (int64_t)(INCISE_NS_PER_S / info->rate_hz);
	info->latency_ns = info->force_latency_ns = ANSWER_NS;
	info->deadman_s = DEADMAN_S;
	info->buttons = *h->grip ? HAPLY_BUTTONS : 0;
	info->features = INCISE_HAPTIC_PAGE_VELOCITY |
			 (*h->grip ? INCISE_HAPTIC_PAGE_ORIENTATION : 0) |
			 (h->frame.own_gravity ? INCISE_HAPTIC_PAGE_GRAVITY : 0);
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
	struct haply *h = incise_device_new(sizeof(*h), request->where, err);
	int rc;

	if (!h)
		return NULL;
	h->haptic.ops = &ops;
	h->clock = request->clock;
	rc = connect_service(h, request->arguments, request->where, err);
	if (!rc)
		rc = choose_inverse3(h, request->where, err);
	if (!rc)
		fill_info(h, request->haptic->rate_hz);
	return incise_haptic_opened(&h->haptic, rc);
}

/* Each Inverse3 of a service; where there is none, none. Few machines have one at the default address. */
static int scan_haply(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err)
{
	struct haply *h = incise_device_new(sizeof(*h), "haply", err);
	struct incise_clock *clock = incise_clock_new_real();
	char *rest, *id;
	int rc = h && clock ? 0 : -ENOMEM;

	if (!rc) {
		h->clock = clock;
		rc = connect_service(h, arguments, "haply", err);
	}
	rest = rc ? NULL : h->frame.ids;
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
	incise_clock_free(clock);
	if (rc == -ENODEV && !*arguments && err)
		err->code = 0;
	return rc == -ENODEV ? 0 : rc;
}

INCISE_BACKEND(incise_haptic_haply, "haptic", "haply", .open = open_haply,
	       .scan = scan_haply);
