// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The page and its WebSocket; see http_server.h. What a browser sends may be anything.
 */
#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>
#include <libwebsockets.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "http_server.h"

#define TOKEN 33	    /* 128 bits in hexadecimal, and its 0 */
#define WAITING 64	    /* messages of a visitor */
#define ANSWERS 8	    /* of them to its requests */
#define ORDERS 16	    /* that wait */
#define PATIENCE_US 5000000 /* for the token */
#define SPANS (1 << 18)
#define HEADER 512

enum what { EVENT, FRAME, ANSWER };

struct message {
	int refs;
	enum what what;
	bool binary;
	uint64_t to; /* a visitor; 0: all */
	size_t n;
	uint8_t bytes[]; /* behind LWS_PRE */
};

/* A connection of a browser; of the page it has no queue. */
struct visitor {
	struct lws *wsi;
	uint64_t number; /* 0: not in the list */
	bool allowed, control;
	struct message *queue[WAITING];
	int n;
	char request[HTTP_REQUEST];
	size_t received;
};

struct http_server {
	lws_sorted_usec_list_t tick; /* first */
	struct http_server_setup setup;
	struct lws_context *context;
	pthread_t thread, reader;
	char token[TOKEN], control[TOKEN], address[100];
	uint8_t *page; /* behind LWS_PRE */
	size_t page_n;
	volatile sig_atomic_t stop;

	/* The thread alone uses these. */
	struct visitor *visitor[HTTP_VISITORS];
	uint64_t next;
	double told; /* share that is read, as visitors know it */

	pthread_mutex_t lock; /* of all that follows */
	struct message *pending[WAITING];
	int n_pending;
	struct http_order order[ORDERS];
	int n_orders;
	struct http_counts counts;
	char why[300]; /* the file could not be read */
};

/* --- messages ---------------------------------------------------------------------------- */

static struct message *new_message(enum what what, bool binary, uint64_t to, size_t n)
{
	struct message *message = cli_alloc(1, sizeof(*message) + LWS_PRE + n);

	message->refs = 1;
	message->what = what;
	message->binary = binary;
	message->to = to;
	message->n = n;
	return message;
}

static struct message *text_message(enum what what, uint64_t to, const char *text)
{
	struct message *message = new_message(what, false, to, strlen(text));

	memcpy(message->bytes + LWS_PRE, text, message->n);
	return message;
}

static void drop_message(struct message *message)
{
	if (!--message->refs)
		free(message);
}

static void count_lost(struct http_server *server, uint64_t n)
{
	pthread_mutex_lock(&server->lock);
	server->counts.lost += n;
	pthread_mutex_unlock(&server->lock);
}

/* In the thread: into a visitor's queue, where the oldest event or a frame makes room. */
static void queue_message(struct http_server *server, struct visitor *visitor,
			  struct message *message)
{
	int out = -1, answers = 0;

	for (int i = visitor->n - 1; i >= 0; i--) {
		enum what what = visitor->queue[i]->what;

		answers += what == ANSWER;
		if ((message->what == FRAME && what == FRAME) ||
		    (visitor->n == WAITING && what != ANSWER))
			out = i;
	}
	if (out >= 0) {
		drop_message(visitor->queue[out]);
		memmove(visitor->queue + out, visitor->queue + out + 1,
			(size_t)(--visitor->n - out) * sizeof(*visitor->queue));
		count_lost(server, 1);
	}
	if (visitor->n == WAITING || (message->what == ANSWER && answers >= ANSWERS)) {
		count_lost(server, 1);
		return;
	}
	message->refs++;
	visitor->queue[visitor->n++] = message;
	lws_callback_on_writable(visitor->wsi);
}

/* Messages of the serving thread, to those they are for. */
static void hand_out(struct http_server *server)
{
	struct message *pending[WAITING];
	int n;

	pthread_mutex_lock(&server->lock);
	n = server->n_pending;
	memcpy(pending, server->pending, sizeof(pending));
	server->n_pending = 0;
	pthread_mutex_unlock(&server->lock);
	for (int i = 0; i < n; i++) {
		for (int k = 0; k < HTTP_VISITORS; k++) {
			struct visitor *visitor = server->visitor[k];

			if (visitor && visitor->allowed &&
			    (!pending[i]->to || pending[i]->to == visitor->number))
				queue_message(server, visitor, pending[i]);
		}
		drop_message(pending[i]);
	}
}

/* In the serving thread. */
static void push_message(struct http_server *server, struct message *message)
{
	bool full;

	pthread_mutex_lock(&server->lock);
	full = server->n_pending == WAITING;
	server->counts.lost += full;
	if (!full)
		server->pending[server->n_pending++] = message;
	pthread_mutex_unlock(&server->lock);
	if (full)
		drop_message(message);
	lws_cancel_service(server->context);
}

void http_server_text(struct http_server *server, const char *text)
{
	push_message(server, text_message(EVENT, 0, text));
}

/* A frame behind its header, in the order of bytes of all that runs this. */
static struct message *frame_message(enum what what, uint64_t to, uint32_t id, double t_s,
				     const struct pixels *pixels)
{
	const uint32_t head[4] = {id, (uint32_t)pixels->width, (uint32_t)pixels->height,
				  (uint32_t)pixels->components};
	size_t n = (size_t)pixels->width * (size_t)pixels->height *
		   (size_t)pixels->components;
	struct message *message =
		new_message(what, true, to, sizeof(head) + sizeof(t_s) + n);
	uint8_t *at = message->bytes + LWS_PRE;

	memcpy(at, head, sizeof(head));
	memcpy(at + sizeof(head), &t_s, sizeof(t_s));
	memcpy(at + sizeof(head) + sizeof(t_s), pixels->bytes, n);
	return message;
}

void http_server_frame(struct http_server *server, double t_s,
		       const struct pixels *pixels)
{
	push_message(server, frame_message(FRAME, 0, 0, t_s, pixels));
}

void http_server_reply(struct http_server *server, const struct http_order *order,
		       bool error, const char *text)
{
	json_t *reply = json_pack("{sI so}", "id", order->id, error ? "error" : "ok",
				  json_text(text));
	char *line = reply ? json_dumps(reply, JSON_COMPACT) : NULL;

	if (line)
		push_message(server, text_message(ANSWER, order->visitor, line));
	free(line);
	json_decref(reply);
}

bool http_server_order(struct http_server *server, struct http_order *order)
{
	bool found;

	pthread_mutex_lock(&server->lock);
	found = server->n_orders > 0;
	if (found) {
		*order = server->order[0];
		memmove(server->order, server->order + 1,
			(size_t)--server->n_orders * sizeof(*server->order));
	}
	pthread_mutex_unlock(&server->lock);
	return found;
}

bool http_server_has_visitors(struct http_server *server)
{
	return http_server_counts(server).now > 0;
}

struct http_counts http_server_counts(struct http_server *server)
{
	struct http_counts counts;

	pthread_mutex_lock(&server->lock);
	counts = server->counts;
	pthread_mutex_unlock(&server->lock);
	return counts;
}

/* --- who may come ------------------------------------------------------------------------ */

/* A header into @text of HEADER bytes; false: it is not there, or too long. */
static bool header_of(struct lws *wsi, enum lws_token_indexes header, char text[HEADER])
{
	return lws_hdr_copy(wsi, text, HEADER, header) > 0;
}

/*
 * A host by its address, or localhost: a name that another site points to this machine (DNS
 * rebinding) is neither. The port may be that of a tunnel.
 */
static bool is_our_host(const char *host)
{
	char name[HEADER];
	struct in6_addr to;
	size_t n;

	if (*host == '[') {
		n = strcspn(++host, "]");
		if (host[n] != ']')
			return false;
	} else {
		n = strcspn(host, ":");
	}
	snprintf(name, sizeof(name), "%.*s", (int)n, host);
	return !strcmp(name, "localhost") || inet_pton(AF_INET, name, &to) == 1 ||
	       inet_pton(AF_INET6, name, &to) == 1;
}

static bool host_is_right(struct lws *wsi)
{
	char host[HEADER];

	return header_of(wsi, WSI_TOKEN_HOST, host) && is_our_host(host);
}

static bool origin_is_right(struct lws *wsi)
{
	char host[HEADER], origin[HEADER];

	return header_of(wsi, WSI_TOKEN_HOST, host) &&
	       header_of(wsi, WSI_TOKEN_ORIGIN, origin) &&
	       !strncmp(origin, "http://", 7) && !strcmp(origin + 7, host);
}

/* In a time that does not tell how much is right. */
static bool is_token(const char *given, const char token[TOKEN])
{
	size_t n = strlen(given);
	int differ = n != TOKEN - 1;

	for (size_t i = 0; i < n && i < TOKEN - 1; i++)
		differ |= given[i] ^ token[i];
	return !differ;
}

/* --- requests ------------------------------------------------------------------------------ */

static void answer(struct http_server *server, struct visitor *visitor, const char *text)
{
	struct message *message = text_message(ANSWER, 0, text);

	queue_message(server, visitor, message);
	drop_message(message);
}

static void answer_json(struct http_server *server, struct visitor *visitor,
			json_t *object)
{
	char *text = object ? json_dumps(object, JSON_COMPACT | JSON_REAL_PRECISION(10))
			    : NULL;

	if (text)
		answer(server, visitor, text);
	free(text);
	json_decref(object);
}

static void answer_error(struct http_server *server, struct visitor *visitor,
			 json_int_t id, const char *why)
{
	answer_json(server, visitor,
		    json_pack("{sI so}", "id", id, "error", json_text(why)));
}

static void send_head(struct http_server *server, struct visitor *visitor)
{
	json_t *head = server->setup.file ? web_head(server->setup.file)
					  : json_loads(server->setup.head, 0, NULL);

	if (visitor->control)
		json_object_set_new(head, "control", json_true());
	answer_json(server, visitor, json_pack("{so}", "head", head));
}

static void answer_part(struct http_server *server, struct visitor *visitor,
			json_int_t id, const json_t *get)
{
	double from = json_number_value(json_object_get(get, "from"));
	double to = json_number_value(json_object_get(get, "to"));
	json_int_t columns = json_integer_value(json_object_get(get, "columns"));
	struct incise_error err = {0};
	char *text = NULL;
	size_t n;
	FILE *out = open_memstream(&text, &n);
	int rc = -EINVAL;

	if (!out)
		return;
	fprintf(out, "{\"id\":%lld,\"part\":", (long long)id);
	if (columns < 1 || columns > WEB_COLUMNS_MAX)
		incise_error_set(&err, EINVAL, "a part has 1 to %d columns",
				 WEB_COLUMNS_MAX);
	else
		rc = web_part(server->setup.file, from, to, (int)columns, out, &err);
	fputc('}', out);
	fclose(out);
	if (rc)
		answer_error(server, visitor, id, err.text);
	else
		answer(server, visitor, text);
	free(text);
}

static void answer_frame(struct http_server *server, struct visitor *visitor,
			 json_int_t id, double t_s)
{
	struct incise_error err = {0};
	struct pixels pixels = {0};
	struct message *message;

	if (web_frame(server->setup.file, &t_s, &pixels, &err)) {
		answer_error(server, visitor, id, err.text);
	} else {
		message = frame_message(ANSWER, 0, (uint32_t)id, t_s, &pixels);
		queue_message(server, visitor, message);
		drop_message(message);
	}
	free(pixels.bytes);
}

static void take_order(struct http_server *server, struct visitor *visitor, json_int_t id,
		       const json_t *request)
{
	static const char *const texts[] = {"text", "name", "tool"};
	struct http_order order = {.visitor = visitor->number, .id = id};
	const uint64_t one = 1;
	bool full;

	if (!visitor->control) {
		answer_error(
			server, visitor, id,
			"this page may only look: start 'incise serve' with --control");
		return;
	}
	snprintf(order.what, sizeof(order.what), "%s",
		 json_string_value(json_object_get(request, "do")));
	for (size_t i = 0; i < sizeof(texts) / sizeof(*texts); i++) {
		const char *text = json_string_value(json_object_get(request, texts[i]));

		if (text)
			snprintf(order.text, sizeof(order.text), "%s", text);
	}
	pthread_mutex_lock(&server->lock);
	full = server->n_orders == ORDERS;
	if (!full)
		server->order[server->n_orders++] = order;
	pthread_mutex_unlock(&server->lock);
	if (full)
		answer_error(server, visitor, id, "too many orders wait; try again");
	else if (write(server->setup.wake, &one, sizeof(one)) < 0)
		answer_error(server, visitor, id, strerror(errno));
}

/* The first message. Returns whether the visitor may stay. */
static bool let_in(struct http_server *server, struct visitor *visitor,
		   const json_t *request)
{
	const char *token = json_string_value(json_object_get(request, "token")),
		   *control = json_string_value(json_object_get(request, "control"));

	if (!token || !is_token(token, server->token)) {
		static const char why[] = "the token is wrong";

		lws_close_reason(visitor->wsi, LWS_CLOSE_STATUS_POLICY_VIOLATION,
				 (unsigned char *)(uintptr_t)why, sizeof(why) - 1);
		return false;
	}
	visitor->allowed = true;
	visitor->control =
		server->setup.control && control && is_token(control, server->control);
	pthread_mutex_lock(&server->lock);
	server->counts.visitors++;
	server->counts.now++;
	pthread_mutex_unlock(&server->lock);
	send_head(server, visitor);
	return true;
}

/* Returns whether the visitor may stay. */
static bool take_request(struct http_server *server, struct visitor *visitor)
{
	json_t *request = json_loadb(visitor->request, visitor->received,
				     JSON_REJECT_DUPLICATES, NULL);
	json_int_t id = json_integer_value(json_object_get(request, "id"));
	const json_t *get = json_object_get(request, "get"),
		     *frame = json_object_get(request, "frame");
	bool stays = true;

	pthread_mutex_lock(&server->lock);
	server->counts.requests++;
	pthread_mutex_unlock(&server->lock);
	if (!visitor->allowed)
		stays = let_in(server, visitor, request);
	else if (json_object_get(request, "do"))
		take_order(server, visitor, id, request);
	else if (get && server->setup.file)
		answer_part(server, visitor, id, get);
	else if (json_is_number(frame) && server->setup.file)
		answer_frame(server, visitor, id, json_number_value(frame));
	else
		answer_error(server, visitor, id, "no such request");
	json_decref(request);
	return stays;
}

/* --- the page ------------------------------------------------------------------------------ */

static const struct {
	const char *name, *value;
} page_headers[] = {
	{"content-security-policy:",
	 "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
	 "img-src data: blob:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; "
	 "form-action 'none'"},
	{"x-content-type-options:", "nosniff"},
	{"referrer-policy:", "no-referrer"},
	{"cache-control:", "no-store"},
	{"cross-origin-opener-policy:", "same-origin"},
};

static int refuse(struct http_server *server, struct lws *wsi, unsigned int status)
{
	pthread_mutex_lock(&server->lock);
	server->counts.refused++;
	pthread_mutex_unlock(&server->lock);
	lws_return_http_status(wsi, status, NULL);
	return -1;
}

static int start_page(struct http_server *server, struct lws *wsi, const char *path)
{
	uint8_t buffer[LWS_PRE + 2048], *start = buffer + LWS_PRE, *at = start,
					*end = buffer + sizeof(buffer) - 1;

	if (!host_is_right(wsi))
		return refuse(server, wsi, HTTP_STATUS_FORBIDDEN);
	if (!lws_hdr_total_length(wsi, WSI_TOKEN_GET_URI))
		return refuse(server, wsi, HTTP_STATUS_METHOD_NOT_ALLOWED);
	if (strcmp(path, "/"))
		return refuse(server, wsi, HTTP_STATUS_NOT_FOUND);
	if (lws_add_http_common_headers(wsi, HTTP_STATUS_OK, "text/html; charset=utf-8",
					server->page_n, &at, end))
		return -1;
	for (size_t i = 0; i < sizeof(page_headers) / sizeof(*page_headers); i++)
		if (lws_add_http_header_by_name(
			    wsi, (const uint8_t *)page_headers[i].name,
			    (const uint8_t *)page_headers[i].value,
			    (int)strlen(page_headers[i].value), &at, end))
			return -1;
	if (lws_finalize_write_http_header(wsi, start, &at, end))
		return -1;
	lws_callback_on_writable(wsi);
	return 0;
}

static int write_page(struct http_server *server, struct lws *wsi)
{
	if (lws_write(wsi, server->page + LWS_PRE, server->page_n, LWS_WRITE_HTTP_FINAL) <
	    0)
		return -1;
	return lws_http_transaction_completed(wsi) ? -1 : 0;
}

/* --- the thread ---------------------------------------------------------------------------- */

static int come(struct http_server *server, struct lws *wsi, struct visitor *visitor)
{
	*visitor = (struct visitor){.wsi = wsi};
	for (int i = 0; i < HTTP_VISITORS; i++) {
		if (server->visitor[i])
			continue;
		server->visitor[i] = visitor;
		visitor->number = ++server->next;
		lws_set_timer_usecs(wsi, PATIENCE_US);
		return 0;
	}
	return -1;
}

static void leave(struct http_server *server, struct visitor *visitor)
{
	for (int i = 0; i < HTTP_VISITORS; i++)
		if (server->visitor[i] == visitor)
			server->visitor[i] = NULL;
	while (visitor->n)
		drop_message(visitor->queue[--visitor->n]);
	pthread_mutex_lock(&server->lock);
	server->counts.now -= visitor->allowed;
	server->counts.refused += !visitor->allowed;
	pthread_mutex_unlock(&server->lock);
	visitor->allowed = false;
}

static int receive(struct http_server *server, struct visitor *visitor, const void *bytes,
		   size_t n)
{
	if (visitor->received + n > sizeof(visitor->request) ||
	    lws_frame_is_binary(visitor->wsi))
		return -1;
	memcpy(visitor->request + visitor->received, bytes, n);
	visitor->received += n;
	if (!lws_is_final_fragment(visitor->wsi) ||
	    lws_remaining_packet_payload(visitor->wsi))
		return 0;
	n = take_request(server, visitor) ? 0 : 1;
	visitor->received = 0;
	return n ? -1 : 0;
}

static int send_next(struct http_server *server, struct visitor *visitor)
{
	struct message *message;
	int rc;

	if (!visitor->n)
		return 0;
	message = visitor->queue[0];
	memmove(visitor->queue, visitor->queue + 1,
		(size_t)--visitor->n * sizeof(*visitor->queue));
	rc = lws_write(visitor->wsi, message->bytes + LWS_PRE, message->n,
		       message->binary ? LWS_WRITE_BINARY : LWS_WRITE_TEXT);
	drop_message(message);
	pthread_mutex_lock(&server->lock);
	server->counts.sent++;
	pthread_mutex_unlock(&server->lock);
	if (visitor->n)
		lws_callback_on_writable(visitor->wsi);
	return rc < 0 ? -1 : 0;
}

static int handle(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in,
		  size_t n)
{
	struct http_server *server = lws_context_user(lws_get_context(wsi));
	struct visitor *visitor = user;

	switch (reason) {
	case LWS_CALLBACK_HTTP:
		return start_page(server, wsi, in);
	case LWS_CALLBACK_HTTP_WRITEABLE:
		return write_page(server, wsi);
	case LWS_CALLBACK_HTTP_BODY:
		return -1;
	case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
		return host_is_right(wsi) && origin_is_right(wsi)
			       ? 0
			       : refuse(server, wsi, HTTP_STATUS_FORBIDDEN);
	case LWS_CALLBACK_ESTABLISHED:
		return come(server, wsi, visitor);
	case LWS_CALLBACK_CLOSED:
		leave(server, visitor);
		return 0;
	case LWS_CALLBACK_TIMER:
		return visitor->allowed ? 0 : -1; /* no token came */
	case LWS_CALLBACK_RECEIVE:
		return receive(server, visitor, in, n);
	case LWS_CALLBACK_SERVER_WRITEABLE:
		return send_next(server, visitor);
	case LWS_CALLBACK_EVENT_WAIT_CANCELLED:
		hand_out(server);
		return 0;
	default:
		return lws_callback_http_dummy(wsi, reason, user, in, n);
	}
}

/* Tell visitors how far the file is read, and at its end what is known now. */
static void tell_progress(struct http_server *server)
{
	double done = server->setup.file ? web_done(server->setup.file) : 1;
	char text[60];

	if (done == server->told)
		return;
	server->told = done;
	snprintf(text, sizeof(text), "{\"progress\":%.3f}", done);
	for (int i = 0; i < HTTP_VISITORS; i++) {
		struct visitor *visitor = server->visitor[i];

		if (!visitor || !visitor->allowed)
			continue;
		if (done >= 1)
			send_head(server, visitor);
		answer(server, visitor, text);
	}
}

static void tick_pages(lws_sorted_usec_list_t *list)
{
	struct http_server *server = (struct http_server *)list;

	tell_progress(server);
	lws_sul_schedule(server->context, 0, list, tick_pages, LWS_US_PER_SEC / 4);
}

static void *serve_pages(void *of)
{
	struct http_server *server = of;

	if (server->setup.file)
		lws_sul_schedule(server->context, 0, &server->tick, tick_pages, 1);
	while (!server->stop && lws_service(server->context, 0) >= 0)
		;
	return NULL;
}

static void *read_file(void *of)
{
	struct http_server *server = of;
	struct incise_error err = {0};
	int rc = web_read(server->setup.file, SPANS, &server->stop, &err);

	if (rc && rc != -ECANCELED)
		cli_warn("%s; what was read until then is shown", err.text);
	return NULL;
}

/* --- opening ------------------------------------------------------------------------------- */

static void make_token(char token[TOKEN], const char *before)
{
	uint8_t bytes[TOKEN / 2];

	if (before && strspn(before, "0123456789abcdef") == TOKEN - 1) {
		snprintf(token, TOKEN, "%s", before);
		return;
	}
	if (getrandom(bytes, sizeof(bytes), 0) != sizeof(bytes))
		cli_fail("--http: no random numbers: %s", strerror(errno));
	for (size_t i = 0; i < sizeof(bytes); i++)
		snprintf(token + 2 * i, 3, "%02x", bytes[i]);
}

/* The address and the port of "[ADDR:]PORT". */
static int split_address(const char *text, char host[64])
{
	const char *colon = strrchr(text, ':'), *end = colon ? colon : text;
	size_t n = (size_t)(end - text);

	if (*text == '[' && n > 1 && text[n - 1] == ']') {
		text++;
		n -= 2;
	}
	if (n >= 64)
		cli_usage("--http: '%s' is no [ADDR:]PORT", text);
	snprintf(host, 64, "%.*s", (int)n, colon ? text : "");
	if (!colon)
		snprintf(host, 64, "127.0.0.1");
	return (int)cli_integer("http", colon ? colon + 1 : text, 0, 65535);
}

static void listen_at(struct http_server *server)
{
	static const struct lws_protocols protocols[] = {
		{"incise", handle, sizeof(struct visitor), HTTP_REQUEST, 0, NULL, 0},
		{0}};
	char host[64];
	struct in6_addr any;
	int port = split_address(server->setup.address, host);
	const char *end =
		server->setup.before ? strstr(server->setup.before, "/#") : NULL;
	struct lws_context_creation_info info = {
		.protocols = protocols,
		.options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS |
			   LWS_SERVER_OPTION_FAIL_UPON_UNABLE_TO_BIND |
			   (strchr(host, ':') ? 0 : LWS_SERVER_OPTION_DISABLE_IPV6),
		.gid = (gid_t)-1,
		.uid = (uid_t)-1,
		.user = server,
		.port = port,
		.iface = strcmp(host, "0.0.0.0") && strcmp(host, "::") ? host : NULL,
		.fd_limit_per_thread = 64,
		.timeout_secs = 10,
		.keepalive_timeout = 2,
		.vhost_name = "incise",
		.alpn = "http/1.1",
	};
	struct lws_vhost *vhost = NULL;
	bool v6 = strchr(host, ':');

	while (!port && end && end > server->setup.before && end[-1] != ':')
		end--;
	info.port = port ? port : end ? atoi(end) & 0xffff : 0;
	if (inet_pton(v6 ? AF_INET6 : AF_INET, host, &any) != 1)
		cli_usage("--http: '%s' is no address; give one of this machine, such as "
			  "127.0.0.1:8080 or [::1]:8080, or the port alone",
			  host);
	lws_set_log_level(0, NULL);
	server->context = lws_create_context(&info);
	errno = 0;
	if (server->context)
		vhost = lws_create_vhost(server->context, &info);
	if (!vhost)
		cli_fail(
			"--http: cannot listen at %s: %s; is the port in use, and the address "
			"one of this machine?",
			server->setup.address, errno ? strerror(errno) : "no vhost");
	port = lws_get_vhost_listen_port(vhost);
	snprintf(server->address, sizeof(server->address), v6 ? "[%s]:%d" : "%s:%d", host,
		 port);
}

struct http_server *http_server_new(const struct http_server_setup *setup)
{
	struct http_server *server = cli_alloc(1, sizeof(*server));
	struct incise_error err = {0};
	const char *mark;
	char *page;

	server->setup = *setup;
	pthread_mutex_init(&server->lock, NULL);
	mark = setup->before ? strchr(setup->before, '#') : NULL;
	make_token(server->token, mark ? mark + 1 : NULL);
	mark = mark ? strchr(mark, '.') : NULL;
	make_token(server->control, mark ? mark + 1 : NULL);
	page = cli_require(web_page(NULL, &server->page_n, &err), &err);
	server->page = cli_alloc(1, LWS_PRE + server->page_n);
	memcpy(server->page + LWS_PRE, page, server->page_n);
	free(page);
	listen_at(server);
	if (pthread_create(&server->thread, NULL, serve_pages, server) ||
	    (setup->file && pthread_create(&server->reader, NULL, read_file, server)))
		cli_fail("--http: no thread: %s", strerror(errno));
	return server;
}

char *http_server_url(const struct http_server *server)
{
	return cli_text("http://%s/#%s%s%s", server->address, server->token,
			server->setup.control ? "." : "",
			server->setup.control ? server->control : "");
}

const char *http_server_address(const struct http_server *server)
{
	return server->address;
}

void http_server_free(struct http_server *server)
{
	server->stop = 1;
	lws_cancel_service(server->context);
	pthread_join(server->thread, NULL);
	if (server->setup.file)
		pthread_join(server->reader, NULL);
	lws_context_destroy(server->context);
	while (server->n_pending)
		drop_message(server->pending[--server->n_pending]);
	free(server->setup.head);
	web_close(server->setup.file);
	pthread_mutex_destroy(&server->lock);
	free(server->page);
	free(server);
}
